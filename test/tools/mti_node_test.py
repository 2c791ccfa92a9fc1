"""mti_node as a command: --list, --probe, --help, and what it does with bad parameters."""
import os
import pathlib
import pty
import signal
import subprocess
import tempfile
import time
import unittest

from commands import BIN, run
from simulated_rig_test import free_port


class WithoutAMaster(unittest.TestCase):
    """An unreachable master: these must not wait for one."""

    def setUp(self):
        os.environ["ROS_MASTER_URI"] = "http://localhost:1"

    def test_help(self):
        code, out, error = run("mti_node", "--help")
        self.assertEqual((code, error), (0, ""))
        self.assertIn("--list", out)
        self.assertIn("--probe", out)

    def test_list_is_a_table_or_one_line_that_says_there_is_none(self):
        code, out, error = run("mti_node", "--list")
        self.assertEqual(code, 0, error)
        if out:
            lines = out.splitlines()
            self.assertEqual(lines[0], "port\tdescription\tproblem")
            self.assertTrue(all(line.count("\t") == 2 for line in lines), out)
        else:
            self.assertEqual(error, "no serial port found\n")

    def test_usage(self):
        for arguments in (["--nonesuch"], ["--list", "--probe"], ["surplus"],
                          ["--probe", "/dev/null", "surplus"]):
            code, out, error = run("mti_node", *arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertTrue(error)

    def failed_probe(self, port):
        code, out, error = run("mti_node", "--probe", port)
        self.assertEqual((code, out), (1, ""), error)
        self.assertEqual(error.count("\n"), 1, error)
        self.assertTrue(error.startswith("mti_node: " + str(port)), error)
        self.assertEqual(error.count(str(port)), 1, error)
        return error

    def test_probe_of_what_is_no_serial_port(self):
        self.failed_probe("/dev/null")
        self.failed_probe("/no/such/port")
        with tempfile.NamedTemporaryFile() as file:
            self.failed_probe(file.name)

    def test_probe_of_a_line_with_nothing_behind_it(self):
        host, device = pty.openpty()
        try:
            begin = time.monotonic()
            self.assertIn("no answer", self.failed_probe(os.ttyname(device)))
            self.assertLess(time.monotonic() - begin, 60.0)
        finally:
            os.close(device)
            os.close(host)


class Parameters(unittest.TestCase):
    nodes = 0

    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        port = free_port()
        cls.environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}",
                               ROS_HOME=cls.place.name)
        cls.log = open(pathlib.Path(cls.place.name) / "output", "w+")
        cls.master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)],
                                      env=cls.environment, stdout=cls.log, stderr=cls.log)
        for _ in range(300):
            if subprocess.run(["rosparam", "list"], env=cls.environment, stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL, check=False).returncode == 0:
                return
            time.sleep(0.1)
        raise RuntimeError("no master")

    @classmethod
    def tearDownClass(cls):
        cls.master.terminate()
        cls.master.wait(timeout=30)
        cls.log.close()
        cls.place.cleanup()

    def with_parameter(self, key, value):
        """Command line of a node of a new name with this private parameter, so that none lasts."""
        type(self).nodes += 1
        name = f"mti_node_{self.nodes}"
        subprocess.run(["rosparam", "set", f"/{name}/{key}", value], env=self.environment, check=True,
                       timeout=60)
        return [str(BIN / "mti_node"), "__name:=" + name]

    def refused(self, key, value, *words):
        done = subprocess.run(self.with_parameter(key, value),
                              env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              universal_newlines=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_each_is_one_line_with_key_and_value(self):
        self.refused("frame_id", "/imu", "frame_id", "/imu")
        self.refused("field_strength_t", "50.0", "field_strength_t", "50")
        self.refused("heading_sigma_deg", "wide", "heading_sigma_deg", "wide")
        self.refused("nonesuch", "1", "nonesuch")
        self.refused("mti/rate_hz", "5000.0", "mti.rate_hz", "5000")
        self.refused("mti/baud_rate", "12345", "mti.baud_rate", "12345")
        self.refused("mti/orientation", "rpy", "mti.orientation", "rpy")
        self.refused("mti/retry_min_s", "50.0", "mti.retry_max_s", "50")

    def test_runs_without_a_device_until_interrupted(self):
        node = subprocess.Popen(self.with_parameter("mti/port", "/no/such/port"), env=self.environment,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)
        try:
            line = node.stderr.readline()  # the log's first warning
            self.assertIn("/no/such/port", line)
            self.assertIsNone(node.poll())
        finally:
            node.send_signal(signal.SIGINT)
            _, error = node.communicate(timeout=60)
        self.assertEqual(node.returncode, 0, error)


if __name__ == "__main__":
    unittest.main()
