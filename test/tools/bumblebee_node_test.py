"""bumblebee_node as a command: what is connected, without a master; and parameters it refuses."""
import os
import pathlib
import subprocess
import tempfile
import time
import unittest

from commands import BIN, run, write_png
from simulated_rig_test import free_port

NODE = "bumblebee_node"
COLUMNS = ["transport", "address", "vendor", "model", "serial", "firmware", "problem"]
EYE = """  size: [{width}, 120]
  D: [0, 0, 0, 0, 0]
  K: [168, 0, 80, 0, 168, 60, 0, 0, 1]
  R: [1, 0, 0, 0, 1, 0, 0, 0, 1]
  P: [168, 0, 80, {p3}, 0, 168, 60, 0, 0, 0, 1, 0]
"""
POSE = "T_base_link_bumblebee_left_optical:\n  translation: [0, 0, 0]\n  rotation_xyzw: [0, 0, 0, 1]\n"


class Command(unittest.TestCase):
    """Nothing here needs a master, and there is none."""

    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.place.name)
        self.master = os.environ.get("ROS_MASTER_URI")
        os.environ["ROS_MASTER_URI"] = f"http://localhost:{free_port()}"

    def tearDown(self):
        if self.master is not None:
            os.environ["ROS_MASTER_URI"] = self.master
        self.place.cleanup()

    def refused(self, *arguments, names, code=1):
        got, text, error = run(NODE, *arguments)
        self.assertEqual(got, code, error)
        self.assertEqual(text, "")
        self.assertEqual(len(error.strip().splitlines()), 1, error)
        for name in names:
            self.assertIn(str(name), error)

    def test_help_is_0_and_usage_is_2(self):
        code, text, _ = run(NODE, "--help")
        self.assertEqual(code, 0)
        for option in ("--list", "--probe"):
            self.assertIn(option, text)
        for arguments in (["--no-such-option"], ["stray"], ["--list", "--probe"],
                          ["--probe", "one", "two"]):
            self.assertEqual(run(NODE, *arguments)[0], 2, arguments)

    def test_list_is_a_table(self):
        code, text, error = run(NODE, "--list", "__name:=other", "_parameter:=1", "a:=b")
        self.assertEqual(code, 0, error)
        rows = [line.split("\t") for line in text.splitlines()]
        if not rows:
            self.assertIn("no camera", error)
            return
        self.assertEqual(rows[0], COLUMNS)
        for row in rows:
            self.assertEqual(len(row), len(COLUMNS), row)

    def test_probe_of_pictures(self):
        for eye, value in (("left", 40), ("right", 90)):
            (self.folder / eye).mkdir()
            write_png(self.folder / eye / "1.png", 48, 32, lambda x, y, v=value: v + x)
        code, text, error = run(NODE, "--probe", self.folder, "__name:=other")
        self.assertEqual(code, 0, error)
        self.assertIn("transport: file", text)
        self.assertIn("pixels: mono8", text)
        self.assertIn("registers: false", text)

    def test_probe_of_what_is_not_there(self):
        self.refused("--probe", "no-such-camera", names=["no-such-camera"])
        self.refused("--probe", self.folder, names=[self.folder])


class Parameters(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        port = free_port()
        cls.environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}",
                               ROS_HOME=cls.place.name)
        cls.master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)],
                                      env=cls.environment, stdout=subprocess.DEVNULL,
                                      stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and cls.parameter("/") is None:
            time.sleep(0.1)

    @classmethod
    def tearDownClass(cls):
        cls.master.terminate()
        cls.master.wait(timeout=60)
        cls.place.cleanup()

    @classmethod
    def parameter(cls, name):
        done = subprocess.run(["rosparam", "get", name], env=cls.environment,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              universal_newlines=True, check=False)
        return done.stdout if done.returncode == 0 else None

    def refused(self, *parameters, names):
        """The node is named anew each time: private parameters stay on the server."""
        name = f"__name:=node_{time.monotonic_ns()}"
        done = subprocess.run([str(BIN / NODE), name, *parameters], env=self.environment,
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                              universal_newlines=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
        for part in names:
            self.assertIn(str(part), done.stderr)

    def rig(self, width=160, p3=-20.16):
        path = self.folder / "rig.yaml"
        path.write_text(POSE + "left:\n" + EYE.format(width=160, p3=0)
                        + "right:\n" + EYE.format(width=width, p3=p3))
        return path

    def test_options_that_cannot_be(self):
        self.refused("_nonesuch:=3", names=["nonesuch"])
        self.refused("_rig:=7", names=["rig", "7"])
        self.refused("_bumblebee/rate_hz:=-1", names=["bumblebee.rate_hz", "-1"])
        self.refused("_bumblebee/exposure_s:=long", names=["bumblebee.exposure_s", "long"])
        self.refused("_bumblebee/transport:=pigeon", names=["bumblebee.transport", "pigeon"])
        self.refused("_bumblebee/exposure:=0.1", names=["bumblebee.exposure", "exposure_s"])
        self.refused("_left_camera_info_url:=/left.yaml",
                     names=["left_camera_info_url", "/left.yaml"])

    def test_rig_files_that_cannot_be(self):
        self.refused("_rig:=/no/such/rig.yaml", names=["/no/such/rig.yaml"])
        self.refused(f"_rig:={self.rig(p3=0)}", names=["rig.yaml", "P[3]"])
        self.refused(f"_rig:={self.rig(p3=20.16)}", names=["rig.yaml", "P[3]"])
        self.refused(f"_rig:={self.rig(width=320)}", names=["rig.yaml", "size"])


if __name__ == "__main__":
    unittest.main()
