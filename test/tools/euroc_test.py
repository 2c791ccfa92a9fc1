"""The main job on a real recording: import, inspect, scan; twice, with the same bytes."""
import json
import pathlib
import sys
import tempfile
import unittest

from commands import DATA, run

MAV = DATA / "euroc_v1_01" / "mav0"


class Euroc(unittest.TestCase):
    def test_a_standing_vehicle_scans_its_room(self):
        with tempfile.TemporaryDirectory() as place:
            folder = pathlib.Path(place)
            bag = folder / "v101.bag"
            code, _, error = run("import_euroc", MAV, "--out", bag)
            self.assertEqual(code, 0, error)
            code, text, _ = run("inspect_bag", bag, "--config", "room")
            self.assertEqual(code, 0, text)
            code, text, _ = run("inspect_bag", bag, "--config", "thesis")
            self.assertIn("room", text)  # the configuration that suits is named
            for threads in (1, 2):
                code, text, error = run("scan_bag", bag, "--config", "room", "--threads", threads,
                                        "--out", folder / str(threads))
                self.assertEqual(code, 0, error)
            report = json.loads((folder / "2" / "report.json").read_text())
            self.assertEqual(report["views"], {"total": 48, "registered": 48, "discarded": 0,
                                               "discarded_views": []})
            self.assertLessEqual(report["truth"]["position_rmse_m"], 0.02)
            self.assertGreater(report["model"]["faces"], 10000)
            for name in ("model.ply", "cloud.ply", "trajectory.tum"):
                self.assertEqual((folder / "1" / name).read_bytes(),
                                 (folder / "2" / name).read_bytes(), name)


if __name__ == "__main__":
    if not MAV.is_dir():
        print(f"SKIPPED: no recording in {MAV}")
        sys.exit(0)
    unittest.main()
