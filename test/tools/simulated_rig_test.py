"""field.launch with the simulated rig: nodes up, motion, scan, finish, and what is left behind."""
import json
import os
import pathlib
import re
import socket
import subprocess
import tempfile
import unittest

from commands import ROOT, camera_port, run

HERE = ROOT / "test" / "tools"


def free_port():
    with socket.socket() as s:
        s.bind(("", 0))
        return s.getsockname()[1]


def half_resolution(field):
    """config/field.yaml for pictures of half the size: half the disparities, a quarter of the points."""
    for option, value in (("min_disparity_px", 40), ("max_disparity_px", 168), ("moving_factor", 25),
                          ("reference_factor", 3)):
        field, count = re.subn(rf"({option}): \d+", rf"\1: {value}", field)
        assert count == 1, option
    return field


class SimulatedRig(unittest.TestCase):
    def test_a_live_scan_without_hardware(self):
        with tempfile.TemporaryDirectory() as place, camera_port():
            out = pathlib.Path(place) / "scan"
            config = pathlib.Path(place) / "half.yaml"
            config.write_text(half_resolution((ROOT / "config" / "field.yaml").read_text()))
            port = free_port()
            environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}", ROS_HOME=place)
            done = subprocess.run(
                ["roslaunch", "-p", str(port), "scanner", "field.launch", "sim:=true", "finish:=true",
                 f"simulation:={HERE / 'simulated_rig.yaml'}", f"out:={out}",
                 f"config:={config}", f"mti_link:={place}/mti"],
                env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                universal_newlines=True, timeout=240, check=False)
            self.assertEqual(done.returncode, 0, done.stdout)
            for name in ("model.ply", "cloud.ply", "trajectory.tum", "report.json", "report.html",
                         "reference.ply"):
                self.assertTrue((out / name).stat().st_size > 0, name + "\n" + done.stdout)
            report = json.loads((out / "report.json").read_text())
            # The camera also looks before the rig moves and after it stands.
            self.assertGreaterEqual(report["views"]["total"], 6, done.stdout)
            self.assertGreaterEqual(report["views"]["registered"], report["views"]["total"] - 1)
            self.assertLess(report["truth"]["position_rmse_m"], 0.02)
            code, _, error = run("evaluate", out, "--reference", out / "reference.ply", "--align",
                                 "--out", out)
            self.assertEqual(code, 0, error)
            deviation = json.loads((out / "deviation.json").read_text())
            self.assertLess(deviation["rmse_m"], 0.004)


if __name__ == "__main__":
    unittest.main()
