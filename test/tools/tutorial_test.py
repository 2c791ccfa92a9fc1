"""The recording that ships, as the README's tutorial uses it."""
import hashlib
import json
import pathlib
import tempfile
import unittest

from commands import ROOT, run

BAG = ROOT / "bags" / "artwork.bag"


class Tutorial(unittest.TestCase):
    def test_checksum_is_the_one_in_the_readme(self):
        checksum = hashlib.sha256(BAG.read_bytes()).hexdigest()
        self.assertIn(checksum, (ROOT / "bags" / "README.md").read_text())

    def test_scan(self):
        code, text, error = run("inspect_bag", BAG)
        self.assertEqual(code, 0, text + error)
        with tempfile.TemporaryDirectory() as place:
            out = pathlib.Path(place)
            code, text, error = run("scan_bag", BAG, "--out", out)
            self.assertEqual(code, 0, text + error)
            report = json.loads((out / "report.json").read_text())
            self.assertEqual(report["views"]["registered"], 11, text)
            self.assertLess(report["truth"]["position_rmse_m"], 0.003)
            self.assertGreater(report["model"]["faces"], 50000)
            self.assertGreater((out / "report.html").stat().st_size, 100000)


if __name__ == "__main__":
    unittest.main()
