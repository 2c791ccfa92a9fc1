"""A simulated scan as a recording: what is in it, that it can be scanned, the same bytes twice."""
import pathlib
import tempfile
import unittest

import rosbag

from commands import ROOT, run

SMALL = ROOT / "test" / "tools" / "simulated_rig.yaml"


class Simulate(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def simulate(self, name, *arguments):
        bag = self.folder / name
        code, text, error = run("simulate", "--scene", "artwork", "--out", bag, "--config", SMALL,
                                "--frames", 3, *arguments)
        self.assertEqual(code, 0, error)
        self.assertIn("table 5.2", text)
        return bag

    def test_topics_stamps_and_truth(self):
        bag = self.simulate("a.bag")
        code, text, _ = run("inspect_bag", bag)
        self.assertIn("3", text)
        with rosbag.Bag(str(bag)) as recording:
            stamps = {}
            for topic, message, recorded in recording.read_messages():
                if topic == "/tf_static":
                    frames = [t.child_frame_id for t in message.transforms]
                    self.assertEqual(frames, ["bumblebee_left_optical", "bumblebee_right_optical"])
                    continue
                stamps.setdefault(topic, []).append(message.header.stamp)
                self.assertEqual(message.header.stamp, recorded)
        self.assertEqual(stamps["/bumblebee/left/image_raw"], stamps["/bumblebee/right/image_raw"])
        self.assertEqual(len(stamps["/bumblebee/left/camera_info"]), 3)
        steps = [(b - a).to_sec() for a, b in zip(stamps["/mti/imu/data"], stamps["/mti/imu/data"][1:])]
        self.assertTrue(all(abs(step - 0.01) < 1e-6 for step in steps))
        truth = set(stamps["/ground_truth/pose"])
        self.assertTrue(all(stamp in truth for stamp in stamps["/bumblebee/left/image_raw"]))

    def test_same_seed_same_bytes(self):
        first = self.simulate("b.bag", "--seed", 4, "--threads", 1)
        again = self.simulate("c.bag", "--seed", 4, "--threads", 2)
        other = self.simulate("d.bag", "--seed", 5)
        self.assertEqual(first.read_bytes(), again.read_bytes())
        self.assertNotEqual(first.read_bytes(), other.read_bytes())
        references = [pathlib.Path(f"{bag}.reference.ply").read_bytes() for bag in (first, again)]
        self.assertEqual(*references)

    def test_part_of_a_walk(self):
        bag = self.simulate("part.bag", "--first", 1, "--last", 2, "--compressed")
        with rosbag.Bag(str(bag)) as recording:
            self.assertEqual(recording.get_message_count("/bumblebee/left/image_raw"), 2)

    def test_bad_input(self):
        for arguments, name in ((("--scene", "no_such"), "no_such"),
                                (("--scene", "artwork", "--config", "absent.yaml"), "absent.yaml"),
                                (("--scene", "artwork", "--config", SMALL, "--first", 9), "9")):
            code, _, error = run("simulate", *arguments, "--out", self.folder / "x.bag")
            self.assertEqual(code, 1, error)
            self.assertEqual(len(error.strip().splitlines()), 1, error)
            self.assertIn(name, error)
        self.assertFalse((self.folder / "x.bag").exists())
        self.assertEqual(run("simulate", "--scene", "artwork", "--noise", "some", "--out", "x")[0], 2)


if __name__ == "__main__":
    unittest.main()
