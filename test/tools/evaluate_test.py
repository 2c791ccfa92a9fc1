"""evaluate: figures, files and messages, on small meshes made here."""
import json
import pathlib
import struct
import tempfile
import unittest

from commands import run


def write_ply(path, points, faces=()):
    """Binary PLY."""
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
              "property float x\nproperty float y\nproperty float z\n"
              f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    body = b"".join(struct.pack("<fff", *p) for p in points)
    body += b"".join(struct.pack("<Biii", 3, *f) for f in faces)
    path.write_bytes(header.encode() + body)


def blocks(scale=1.0, shift=(0.0, 0.0, 0.0), steps=12):
    """A box of 0.2 x 0.3 x 0.4 m, each side a grid: vertices of neighbouring sides coincide."""
    half = [0.1 * scale, 0.15 * scale, 0.2 * scale]
    points, faces = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1, 1):
            first = len(points)
            for i in range(steps + 1):
                for j in range(steps + 1):
                    p = [0.0, 0.0, 0.0]
                    p[axis] = sign * half[axis]
                    p[u] = half[u] * (2 * i / steps - 1)
                    p[v] = half[v] * (2 * j / steps - 1)
                    points.append([a + b for a, b in zip(p, shift)])
            for i in range(steps):
                for j in range(steps):
                    a = first + i * (steps + 1) + j
                    b, c, d = a + steps + 1, a + steps + 2, a + 1
                    for face in ((a, b, c), (a, c, d)):
                        faces.append(face if sign > 0 else face[::-1])
    return points, faces


class Evaluate(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.place.name)
        self.reference = self.folder / "reference.ply"
        write_ply(self.reference, *blocks())
        self.out = self.folder / "out"

    def tearDown(self):
        self.place.cleanup()

    def evaluate(self, model, *arguments, out=None):
        out = out or self.out
        code, text, error = run("evaluate", model, "--reference", self.reference, "--out", out,
                                *arguments)
        self.assertEqual(code, 0, error)
        self.assertEqual(error, "")
        return json.loads((out / "deviation.json").read_text()), text

    def refused(self, *arguments, names):
        code, _, error = run("evaluate", *arguments)
        self.assertEqual(code, 1, error)
        self.assertEqual(len(error.strip().splitlines()), 1, error)
        for name in names:
            self.assertIn(str(name), error)

    def test_a_larger_box_lies_outside(self):
        model = self.folder / "model.ply"
        write_ply(model, *blocks(scale=1.01))
        result, text = self.evaluate(model)
        self.assertAlmostEqual(result["min_m"], 0.001, places=6)  # on the sides of 0.2 m
        self.assertAlmostEqual(result["max_m"], (1 + 1.5 ** 2 + 2 ** 2) ** 0.5 * 1e-3, places=6)
        self.assertIsNone(result["mean_negative_m"])
        self.assertEqual(result["points"], len(blocks()[0]))
        self.assertEqual(result["coverage"], 1.0)
        self.assertEqual(result["placement"], "as_given")
        self.assertIn("coverage", text)
        for name in ("deviation.ply", "deviation.png", "histogram.png"):
            self.assertGreater((self.out / name).stat().st_size, 1000, name)

    def test_align_takes_the_motion_out(self):
        model = self.folder / "model.ply"
        write_ply(model, *blocks(shift=(0.02, -0.01, 0.015)))
        result, _ = self.evaluate(model, "--align")
        self.assertLess(result["rmse_m"], 1e-6)
        self.assertEqual(result["placement"], "best_fit")
        for row, expected in zip(result["alignment"], (-0.02, 0.01, -0.015)):
            self.assertAlmostEqual(row[3], expected, places=6)

    def test_same_bytes_for_any_number_of_threads(self):
        model = self.folder / "model.ply"
        write_ply(model, *blocks(scale=1.01, shift=(0.003, 0.0, 0.0)))
        for threads in ("1", "2"):
            self.evaluate(model, "--align", "--per-point", "--threads", threads,
                          out=self.folder / threads)
        for name in ("deviation.json", "deviation.ply", "deviation.png", "histogram.png",
                     "deviation.asc"):
            self.assertEqual((self.folder / "1" / name).read_bytes(),
                             (self.folder / "2" / name).read_bytes(), name)

    def scan_folder(self):
        """A scan whose map is shifted by (1, 2, 3), with three views, one of them discarded."""
        scan = self.folder / "scan"
        for name in ("views", "groups"):
            (scan / name).mkdir(parents=True)
        points, faces = blocks(shift=(1.0, 2.0, 3.0))
        write_ply(scan / "model.ply", points, faces)
        write_ply(scan / "groups" / "group_000.ply", points)
        stamps = [10_000_000_000, 11_000_000_001, 12_000_000_000]
        poses, views = [], []
        for i, stamp in enumerate(stamps):
            base = (0.1 * i, 0.5, -0.2)  # of base_link in the map
            bumped = [1.0 - base[0] + 0.001 * i, 2.0 - base[1], 3.0 - base[2]]
            write_ply(scan / "views" / f"view_{i:03d}.ply", blocks(shift=bumped)[0])
            views.append({"index": i, "stamp_ns": stamp, "registered": i != 1, "reason": None})
            if i != 1:
                poses.append(f"{stamp // 10**9}.{stamp % 10**9:09d} {base[0]} {base[1]} {base[2]}"
                             " 0 0 0 1")
        (scan / "trajectory.tum").write_text("\n".join(poses) + "\n")
        (scan / "report.json").write_text(json.dumps({"tables": {"views": views}}))
        truth = self.folder / "truth.tum"
        truth.write_text("10.0 -1.0 -1.5 -3.2 0 0 0 1\n12.0 -0.8 -1.5 -3.2 0 0 0 1\n")
        return scan, truth

    def test_scan_folder_gives_tables(self):
        scan, truth = self.scan_folder()
        result, text = self.evaluate(scan, "--truth", truth, out=scan)
        self.assertEqual(result["placement"], "first_pose")
        self.assertLess(result["rmse_m"], 1e-6)
        self.assertEqual([row["index"] for row in result["tables"]["views"]], [0, 2])
        self.assertLess(result["tables"]["views"][0]["rmse_m"], 1e-6)
        self.assertAlmostEqual(result["tables"]["views"][1]["max_m"], 0.002, places=6)
        self.assertAlmostEqual(result["summaries"]["views"]["mean"]["max_m"], 0.001, places=5)
        self.assertEqual([row["index"] for row in result["tables"]["groups"]], [0])
        self.assertEqual(result["warnings"], [])
        self.assertIn("views", text)

    def test_truth_and_align_report_both(self):
        scan, truth = self.scan_folder()
        write_ply(scan / "model.ply", *blocks(shift=(1.002, 2.0, 3.0)))
        result, text = self.evaluate(scan, "--truth", truth, "--align")
        self.assertAlmostEqual(result["first_pose"]["max_m"], 0.002, places=6)
        self.assertLess(result["rmse_m"], 1e-6)
        self.assertIn("placed by the first pose", text)
        self.assertIn("best fit", text)

    def test_what_is_missing_in_a_scan_folder_is_said(self):
        scan, truth = self.scan_folder()
        (scan / "report.json").unlink()
        result, text = self.evaluate(scan, "--truth", truth)
        self.assertEqual(result["tables"]["views"], [])
        self.assertEqual(len(result["warnings"]), 1)
        self.assertIn("report.json", text)

    def test_bad_input(self):
        absent, empty = self.folder / "absent.ply", self.folder / "empty.ply"
        write_ply(empty, [])
        points = self.folder / "points.ply"
        write_ply(points, blocks()[0])
        rest = ("--out", self.out)
        self.refused(absent, "--reference", self.reference, *rest, names=[absent])
        self.refused(points, "--reference", absent, *rest, names=[absent])
        self.refused(points, "--reference", points, *rest, names=[points, "no faces"])
        self.refused(empty, "--reference", self.reference, *rest, names=[empty])
        self.refused(empty, "--reference", self.reference, "--align", *rest, names=[empty])
        self.refused(self.folder, "--reference", self.reference, *rest,
                     names=[self.folder, "model.ply"])
        self.refused(points, "--reference", self.reference, "--truth", absent, *rest,
                     names=["trajectory.tum"])
        self.refused(points, "--reference", self.reference, "--out", points, names=[points])
        far = self.folder / "far.ply"
        write_ply(far, blocks(shift=(9.0, 0.0, 0.0))[0])
        self.refused(far, "--reference", self.reference, *rest, names=[far, "0.025"])

    def test_usage(self):
        self.assertEqual(run("evaluate")[0], 2)
        self.assertEqual(run("evaluate", self.reference, "--reference", self.reference, "--out",
                             self.out, "--range", "-1")[0], 2)
        self.assertEqual(run("evaluate", "--help")[0], 0)


if __name__ == "__main__":
    unittest.main()
