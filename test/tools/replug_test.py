"""Cables pulled and put back under field.launch sim:=true; bench/replug.py does it ten times."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

from commands import ROOT, camera_port
from simulated_rig_test import HERE, half_resolution


class Replug(unittest.TestCase):
    def test_both_devices_come_back_and_the_map_survives(self):
        with tempfile.TemporaryDirectory() as place, camera_port():
            config = pathlib.Path(place) / "half.yaml"
            config.write_text(half_resolution((ROOT / "config" / "field.yaml").read_text()))
            done = subprocess.run(
                [sys.executable, ROOT / "bench" / "replug.py", "--times", "2", "--config", config,
                 "--start-patience-s", "120", "--simulation", HERE / "simulated_rig.yaml", "--patience-s", "60"],
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, timeout=600,
                check=False)
            self.assertEqual(done.returncode, 0, done.stdout)


if __name__ == "__main__":
    unittest.main()
