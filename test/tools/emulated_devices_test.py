"""rig_simulator_node as the two devices: what a driver finds on the terminal and on the network."""
import os
import pathlib
import select
import socket
import subprocess
import tempfile
import time
import unittest

from commands import ROOT, camera_port
from simulated_rig_test import free_port

GO_TO_MEASUREMENT = bytes([0xFA, 0xFF, 0x10, 0x00, 0xF1])
MT_DATA = bytes([0xFA, 0xFF, 0x32])
GVCP_DISCOVERY = bytes([0x42, 0x01, 0x00, 0x02, 0x00, 0x00, 0x00, 0x07])
PATIENCE_S = 60.0


def eventually(condition):
    """Polls until the condition holds or patience ends; the last value."""
    deadline = time.monotonic() + PATIENCE_S
    value = condition()
    while not value and time.monotonic() < deadline:
        time.sleep(0.1)
        value = condition()
    return value


def camera_answers():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.settimeout(0.5)
        try:
            s.sendto(GVCP_DISCOVERY, ("127.0.0.1", 3956))
            answer = s.recv(2048)
        except (socket.timeout, ConnectionRefusedError):
            return False
    return answer[2:4] == b"\x00\x03" and answer[6:8] == b"\x00\x07"


def measures(link):
    """True when the device at the link, asked to measure, sends MTData."""
    terminal = os.open(str(link), os.O_RDWR | os.O_NOCTTY)
    try:
        received = b""
        deadline = time.monotonic() + PATIENCE_S
        while MT_DATA not in received and time.monotonic() < deadline:
            os.write(terminal, GO_TO_MEASUREMENT)
            if select.select([terminal], [], [], 0.5)[0]:
                received += os.read(terminal, 4096)
        return MT_DATA in received
    finally:
        os.close(terminal)


class EmulatedDevices(unittest.TestCase):
    def setUp(self):
        lock = camera_port()
        lock.__enter__()
        self.addCleanup(lock.__exit__, None, None, None)
        self.place = tempfile.TemporaryDirectory()
        self.link = pathlib.Path(self.place.name) / "mti"
        port = free_port()
        self.environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}",
                                ROS_HOME=self.place.name)
        launch = pathlib.Path(self.place.name) / "devices.launch"
        launch.write_text(
            "<launch><rosparam command='load' ns='scanner' file='%s'/>"
            "<node pkg='scanner' type='rig_simulator_node' name='rig' required='true' output='screen'>"
            "<param name='devices' value='true'/><param name='full_quality' value='false'/>"
            "<param name='mti_link' type='str' value='%s'/></node></launch>"
            % (ROOT / "test" / "tools" / "simulated_rig.yaml", self.link))
        self.log = open(pathlib.Path(self.place.name) / "output", "w+")
        self.node = subprocess.Popen(["roslaunch", "-p", str(port), str(launch)],
                                     env=self.environment, stdout=self.log, stderr=self.log)

    def tearDown(self):
        self.node.terminate()
        self.node.wait(timeout=60)
        self.log.close()
        self.place.cleanup()

    def call(self, service, argument):
        done = subprocess.run(["rosservice", "call", service, argument], env=self.environment,
                              stdout=subprocess.PIPE, universal_newlines=True, timeout=60, check=True)
        self.assertIn("success: True", done.stdout)

    def test_devices_answer_and_can_be_unplugged(self):
        self.assertTrue(eventually(self.link.exists), pathlib.Path(self.log.name).read_text())
        self.assertTrue(measures(self.link))
        self.assertTrue(eventually(camera_answers))
        self.call("/rig/plug_mti", "false")
        self.assertFalse(self.link.exists())
        self.call("/rig/plug_mti", "true")
        self.assertTrue(measures(self.link))
        self.call("/rig/plug_camera", "false")
        self.assertFalse(camera_answers())
        self.call("/rig/plug_camera", "true")
        self.assertTrue(eventually(camera_answers))
        self.call("/rig/faults", "{corrupt_bytes: 0.01, mute: false}")


if __name__ == "__main__":
    unittest.main()
