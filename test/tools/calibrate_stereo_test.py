"""calibrate_stereo on rendered boards of known cameras: files, figures, refusals, exit codes."""
import json
import math
import pathlib
import shutil
import tempfile
import unittest

from commands import DATA, run, write_png

WIDTH, HEIGHT, FOCAL, BASELINE = 240, 180, 220.0, 0.08
COLUMNS, ROWS, SQUARE = 5, 4, 0.03
# Tilt about x and y (radians), middle of the board (metres) in the left camera.
POSES = [(0.5, 0.1, 0.03, 0.00, 0.30), (-0.5, 0.2, 0.06, 0.03, 0.36), (0.1, 0.5, 0.01, -0.03, 0.34),
         (0.1, -0.5, 0.07, 0.02, 0.34), (0.4, -0.3, 0.02, 0.05, 0.40), (-0.3, -0.4, 0.08, -0.05, 0.40)]


def board_pixel(pose, offset):
    """Grey value of a pixel of a pinhole camera `offset` metres to the right of the left one."""
    a, b, mx, my, mz = pose
    ca, sa, cb, sb = math.cos(a), math.sin(a), math.cos(b), math.sin(b)
    x_axis, y_axis = (cb, 0.0, -sb), (sa * sb, ca, sa * cb)
    normal = (ca * sb, -sa, ca * cb)
    middle = (mx - offset, my, mz)
    above = sum(n * m for n, m in zip(normal, middle))
    half_x, half_y = 0.5 * (COLUMNS - 1) * SQUARE, 0.5 * (ROWS - 1) * SQUARE
    # Edges are as soft as pixels are wide on the board.
    sharp = FOCAL * SQUARE / mz

    def soft(t):
        """-1 or 1 by the parity of floor(t), with ramps one pixel wide."""
        whole = math.floor(t)
        edge = min(1.0, 2.0 * min(t - whole, whole + 1.0 - t) * sharp)
        return edge if whole % 2 == 0 else -edge

    def pixel(u, v):
        ray = ((u - 0.5 * (WIDTH - 1)) / FOCAL, (v - 0.5 * (HEIGHT - 1)) / FOCAL, 1.0)
        t = above / sum(n * r for n, r in zip(normal, ray))
        at = [t * r - m for r, m in zip(ray, middle)]
        x = (sum(p * q for p, q in zip(at, x_axis)) + half_x) / SQUARE
        y = (sum(p * q for p, q in zip(at, y_axis)) + half_y) / SQUARE
        if not (-2.0 <= x <= COLUMNS + 1.0 and -2.0 <= y <= ROWS + 1.0):
            return 120
        if not (-1.0 <= x <= COLUMNS and -1.0 <= y <= ROWS):
            return 230
        return round(130 - 100 * soft(x) * soft(y))

    return pixel


def write_pairs(folder, poses):
    folder.mkdir(parents=True, exist_ok=True)
    for i, pose in enumerate(poses, 1):
        write_png(folder / f"left{i}.png", WIDTH, HEIGHT, board_pixel(pose, 0.0))
        write_png(folder / f"right{i}.png", WIDTH, HEIGHT, board_pixel(pose, BASELINE))


class CalibrateStereo(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.pictures = pathlib.Path(cls.place.name) / "pictures"
        write_pairs(cls.pictures, POSES)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = pathlib.Path(place.name)
        self.out = self.folder / "rig.yaml"

    def calibrate(self, folder, *more, board=f"{COLUMNS}x{ROWS}", square=SQUARE):
        return run("calibrate_stereo", folder, "--board", board, "--square", square, "--out",
                   self.out, *more)

    def refused(self, folder, *more, names, **board):
        code, text, error = self.calibrate(folder, *more, **board)
        self.assertEqual(code, 1, text)
        lines = [line for line in error.strip().splitlines() if line.startswith("calibrate_stereo:")]
        self.assertEqual(error.strip().splitlines()[-1:], lines, error)
        for name in names:
            self.assertIn(str(name), lines[0])
        self.assertFalse(self.out.exists())
        return text

    def test_rig_pictures_and_report(self):
        code, text, error = self.calibrate(self.pictures)
        self.assertEqual(code, 0, error)
        for word in ("6 of 6 used", "epipolar", "baseline", "held out", "left fx", "*3.png"):
            self.assertIn(word, text)
        report = json.loads((self.folder / "rig.report.json").read_text())
        self.assertLess(report["rms_px"], 0.1)
        self.assertLess(report["epipolar"]["p95_px"], 0.15)
        self.assertAlmostEqual(report["baseline_m"], BASELINE, delta=0.0005)
        focal = report["parameters"]["left fx"]
        self.assertLess(abs(focal["value"] - FOCAL), 5 * focal["sigma"])
        self.assertLess(abs(focal["value"] - FOCAL), 0.02 * FOCAL)
        rig = self.out.read_text()
        for word in ("T_base_link_bumblebee_left_optical:", "left:", "right:", "was not measured"):
            self.assertIn(word, rig)
        for picture in ("rig.rectified.png", "rig.residuals.png"):
            self.assertEqual((self.folder / picture).read_bytes()[:4], b"\x89PNG")

    def test_same_files_on_any_number_of_threads_and_the_rig_is_kept(self):
        self.assertEqual(self.calibrate(self.pictures, "--threads", 1)[0], 0)
        first = self.out.read_text()
        first_report = (self.folder / "rig.report.json").read_text()
        self.assertEqual(self.calibrate(self.pictures, "--threads", 3)[0], 0)
        self.assertEqual(self.out.read_text(), first)
        self.assertEqual((self.folder / "rig.report.json").read_text(), first_report)
        self.out.write_text(first.replace("translation: [0.0, 0.0, 0.0]",
                                          "translation: [0.25, 0.0, 0.0]"))
        self.assertEqual(self.calibrate(self.pictures, "--rig", self.out)[0], 0)
        self.assertIn("translation: [0.25, 0.0, 0.0]", self.out.read_text())

    def test_views_too_few_or_too_alike_are_refused(self):
        few, alike = self.folder / "few", self.folder / "alike"
        few.mkdir()
        for name in ("left1.png", "right1.png", "left2.png", "right2.png"):
            shutil.copy(self.pictures / name, few)
        shutil.copy(few / "left1.png", few / "left3.png")
        write_png(few / "right3.png", WIDTH, HEIGHT, lambda u, v: 120)
        text = self.refused(few, names=[few, "too few views", "in 2", "at least 5"])
        self.assertIn("*3.png: no whole board in the right picture", text)
        alike.mkdir()
        for i in range(5):
            for side in ("left", "right"):
                shutil.copy(few / f"{side}1.png", alike / f"{side}{i}.png")
        self.refused(alike, names=[alike, "too alike"])

    def test_bad_input_is_one_line(self):
        absent, empty = self.folder / "absent", self.folder / "empty"
        self.refused(absent, names=[absent])
        empty.mkdir()
        self.refused(empty, names=[empty, "no pair of pictures", "left01.png"])
        swapped = self.folder / "swapped"
        swapped.mkdir()
        for path in self.pictures.iterdir():
            side = "right" if path.name.startswith("left") else "left"
            shutil.copy(path, swapped / (side + path.name.lstrip("leftrigh")))
        self.refused(swapped, names=["swapped", "exchange"])
        self.refused(self.pictures, names=["5x4", "--board"], board="6x5")
        self.refused(self.pictures, names=["COLUMNSxROWS"], board="5by4")
        self.refused(self.pictures, names=["2x4", "3x3"], board="2x4")
        self.refused(self.pictures, "--rig", absent, names=[absent])
        self.refused(self.pictures, "--config", absent, names=[absent])
        (empty / "left1.png").write_bytes(b"no picture")
        (empty / "right1.png").write_bytes(b"no picture")
        self.refused(empty, names=["1.png"])

    def test_place_that_cannot_be_written_is_named(self):
        self.out = self.folder / "absent" / "rig.yaml"
        self.refused(self.pictures, names=[self.out])

    def test_usage(self):
        self.assertEqual(run("calibrate_stereo")[0], 2)
        self.assertEqual(self.calibrate(self.pictures, square=0)[0], 2)
        self.assertEqual(self.calibrate(self.pictures, "--threads", 0)[0], 2)
        code, text, _ = run("calibrate_stereo", "--help")
        self.assertEqual(code, 0)
        self.assertIn("inner corners", text)

    @unittest.skipUnless((DATA / "bumblebee2" / "chessboard").is_dir(), "no recording")
    def test_real_bumblebee2(self):
        code, _, error = self.calibrate(DATA / "bumblebee2" / "chessboard", board="4x6")
        self.assertEqual(code, 0, error)
        report = json.loads((self.folder / "rig.report.json").read_text())
        self.assertLessEqual(report["rms_px"], 0.12)
        self.assertAlmostEqual(1e3 * report["baseline_m"], 120.04, delta=0.3)


if __name__ == "__main__":
    unittest.main()
