"""Bad input gives one clear line that names the thing, and a non-zero exit; earlier output stays."""
import pathlib
import tempfile
import unittest

from commands import run, write_euroc


class BadInput(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        write_euroc(cls.folder / "mav0")
        cls.bag = cls.folder / "good.bag"
        code, _, error = run("import_euroc", cls.folder / "mav0", "--out", cls.bag)
        assert code == 0, error

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def refused(self, command, *arguments, names, code=1):
        got, _, error = run(command, *arguments)
        self.assertEqual(got, code, error)
        self.assertEqual(len(error.strip().splitlines()), 1, error)
        for name in names:
            self.assertIn(str(name), error)

    def test_usage_is_2_and_help_is_0(self):
        for command in ("scan_bag", "import_euroc", "inspect_bag", "register_scans", "render_mesh",
                        "evaluate", "report", "simulate"):
            self.assertEqual(run(command)[0], 2, command)
            self.assertEqual(run(command, "--no-such-option")[0], 2, command)
            code, text, _ = run(command, "--help")
            self.assertEqual(code, 0, command)
            self.assertIn("--", text)

    def test_absent_files(self):
        absent = self.folder / "absent"
        self.refused("scan_bag", absent, "--out", self.folder / "o", names=[absent])
        self.refused("inspect_bag", absent, names=[absent])
        self.refused("import_euroc", absent, "--out", self.folder / "o.bag", names=[absent])
        self.refused("render_mesh", absent, "--out", self.folder / "o.png", names=[absent])
        self.refused("register_scans", absent, "--prior", absent, "--out", self.folder / "o",
                     names=[absent])
        self.refused("scan_bag", self.bag, "--rig", absent, "--out", self.folder / "o",
                     names=[absent])

    def test_truncated_and_foreign_bags(self):
        truncated = self.folder / "truncated.bag"
        truncated.write_bytes(self.bag.read_bytes()[:20000])
        self.refused("scan_bag", truncated, "--out", self.folder / "o", names=[truncated])
        foreign = self.folder / "foreign.bag"
        foreign.write_text("this is not a bag")
        self.refused("scan_bag", foreign, "--out", self.folder / "o", names=[foreign])

    def test_configuration(self):
        self.refused("scan_bag", self.bag, "--config", "no_such", "--out", self.folder / "o",
                     names=["no_such"])
        bad = self.folder / "bad.yaml"
        bad.write_text("stereo:\n  normals:\n    window_px: 4000\n")
        self.refused("scan_bag", self.bag, "--config", bad, "--out", self.folder / "o",
                     names=[bad, "stereo.normals.window_px", "4000"])
        bad.write_text("stereo:\n  matcher:\n    min_disparty_px: 4\n")
        self.refused("scan_bag", self.bag, "--config", bad, "--out", self.folder / "o",
                     names=["stereo.matcher.min_disparty_px", "did you mean"])

    def test_unwritable_output_leaves_what_was_there(self):
        blocked = self.folder / "blocked"
        blocked.write_text("earlier output")
        self.refused("scan_bag", self.bag, "--config", "room", "--out", blocked, names=[blocked])
        self.assertEqual(blocked.read_text(), "earlier output")
        self.refused("import_euroc", self.folder / "mav0", "--out", self.folder / "no" / "o.bag",
                     names=["o.bag"])

    def test_a_scan_that_registers_nothing_fails_but_leaves_its_report(self):
        out = self.folder / "nothing"
        config = self.folder / "strict.yaml"
        config.write_text("stereo:\n  depth:\n    max_depth_m: 0.06\n  matcher:\n    min_disparity_px: 8\n"
                          "    max_disparity_px: 64\n")
        code, text, _ = run("scan_bag", self.bag, "--config", config, "--out", out)
        self.assertEqual(code, 1)
        self.assertIn("discarded", text)
        self.assertTrue((out / "report.json").exists())

    def test_register_scans_skips_an_empty_scan_and_says_why(self):
        def cloud(name, points):
            (self.folder / name).write_text(
                f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty float x\n"
                "property float y\nproperty float z\nend_header\n"
                + "".join(f"{x} {y} {z}\n" for x, y, z in points))
            return self.folder / name

        bumps = [(i * 0.01, j * 0.01, 0.02 * ((i * 7 + j * 3) % 5 == 0) + 0.001 * i * j)
                 for i in range(40) for j in range(40)]
        files = [cloud("a.ply", bumps), cloud("b.ply", bumps), cloud("empty.ply", []),
                 cloud("nan.ply", [("nan", 0, 0)] * 100)]
        prior = self.folder / "prior.conf"
        prior.write_text("".join(f"bmesh {f.name} 0 0 0 0 0 0 1\n" for f in files))
        out = self.folder / "registered"
        code, text, error = run("register_scans", *files, "--prior", prior, "--out", out)
        self.assertEqual(code, 0, error)
        self.assertIn("2 of 4", text)
        poses = (out / "poses.json").read_text()
        self.assertIn("empty.ply", poses)


if __name__ == "__main__":
    unittest.main()
