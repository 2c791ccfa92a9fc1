"""evaluate_stereo on a tiny scene of known disparity: its figures, files and refusals."""
import json
import pathlib
import tempfile
import unittest
import zlib

from commands import run, write_png

WIDTH, HEIGHT, SHIFT = 160, 120, 9


def texture(x, y):
    return zlib.crc32(bytes([x % 256 // 2, x // 256, y // 2])) & 255


def write_scene(folder):
    folder.mkdir(parents=True)
    write_png(folder / "a.png", WIDTH, HEIGHT, texture)
    write_png(folder / "b.png", WIDTH, HEIGHT, lambda x, y: texture(x + SHIFT, y))
    write_png(folder / "gt.png", WIDTH, HEIGHT, lambda x, y: 10 * SHIFT)
    (folder / "scene.txt").write_text("left = a.png\nright = b.png\ntruth = gt.png\nscale = 10\n"
                                      "max_disparity = 20\n")


class EvaluateStereo(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = pathlib.Path(place.name)

    def refused(self, *arguments, names, code=1):
        got, _, error = run("evaluate_stereo", *arguments)
        self.assertEqual(got, code, error)
        self.assertEqual(len(error.strip().splitlines()), 1, error)
        for name in names:
            self.assertIn(str(name), error)

    def test_all_methods_find_a_plain_shift(self):
        write_scene(self.folder / "set" / "one")
        write_scene(self.folder / "set" / "two")
        out, figures = self.folder / "out", self.folder / "figures.json"
        code, text, error = run("evaluate_stereo", self.folder / "set", "--repeat", 1, "--threads", 1,
                                "--out", out, "--json", figures, "--full")
        self.assertEqual(code, 0, error)
        methods = ("ours_block", "ours_semi_global", "bm", "sgbm")
        for word in methods + ("one", "two", "nonocc", "disc", "MODE_SGBM (5 paths)",
                               "at equal or higher density on", "of 2 scenes"):
            self.assertIn(word, text)
        root = json.loads(figures.read_text())
        self.assertEqual([s["name"] for s in root["scenes"]], ["one", "two"])
        for method in methods:
            result = root["scenes"][0]["methods"][method]["regions"]["nonocc"]
            self.assertEqual(result["pixels"], (WIDTH - SHIFT) * HEIGHT, method)
            self.assertGreater(result["density"], 0.5, method)
            self.assertLess(result["bad_valid"]["1.0"], 0.02, method)
            self.assertLess(result["inlier_rms_px"], 0.2, method)
            for kind in ("disparity", "filled", "error"):
                self.assertTrue((out / "set" / "one" / f"{method}_{kind}.png").is_file())
        self.assertTrue((out / "set" / "two" / "sheet.png").is_file())

    def test_chosen_methods_only(self):
        write_scene(self.folder / "one")
        code, text, error = run("evaluate_stereo", "--repeat", 1, "--no-fill", "--methods", "bm,sgbm",
                                self.folder / "one")
        self.assertEqual(code, 0, error)
        self.assertNotIn("ours", text)
        self.assertNotIn("mean of nonocc", text)  # of the filled maps

    def test_bad_input_is_one_line(self):
        absent = self.folder / "absent"
        self.refused(absent, names=[absent])
        self.refused(self.folder, names=[self.folder, "no stereo scene"])
        scene = self.folder / "scene"
        write_scene(scene)
        self.refused(scene, "--methods", "bm,elas", names=["elas", "ours_semi_global"])
        self.refused(scene, "--config", "no_such", names=["no_such"])
        self.refused(scene, "--json", absent / "f.json", "--methods", "bm", names=["f.json"])
        (scene / "b.png").unlink()
        self.refused(scene, names=[scene / "b.png"])
        write_png(scene / "b.png", 20, 20, texture)
        self.refused(scene, names=[scene / "b.png", "20x20", f"{WIDTH}x{HEIGHT}"])

    def test_usage(self):
        self.assertEqual(run("evaluate_stereo")[0], 2)
        self.assertEqual(run("evaluate_stereo", self.folder, "--bm-window", 8)[0], 2)
        code, text, _ = run("evaluate_stereo", "--help")
        self.assertEqual(code, 0)
        self.assertIn("--methods", text)


if __name__ == "__main__":
    unittest.main()
