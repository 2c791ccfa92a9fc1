#!/usr/bin/python3
"""Pulls the cables of the simulated rig's devices while field.launch scans, and puts them back.

    bench/replug.py [--times 10] [--simulation FILE] [--config FILE] [--patience-s 30]

Starts `field.launch sim:=true` on a master of its own, waits until the rig has gone its way and
stands (a rig that goes on without a camera leaves what the next view could be placed by), then pulls
and replaces each cable `--times` times. Prints how long each driver
took from the cable being back to its first message, and what the scan had before and after. Exits
with 1 when a driver did not come back, when stamps went backwards, when views were lost from the map, or
when none was added after the last cable was back. Needs the environment of devel/setup.bash.
"""
import argparse
import collections
import os
import pathlib
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time


def free_port():
    with socket.socket() as s:
        s.bind(("", 0))
        return s.getsockname()[1]


def listening(port):
    with socket.socket() as s:
        return s.connect_ex(("localhost", port)) == 0


class Stream:
    """Counts a topic's messages and checks that their stamps increase."""

    def __init__(self, rospy, topic, message):
        self.topic, self.count, self.backward, self.last = topic, 0, 0, None
        self.news = threading.Condition()
        self.subscriber = rospy.Subscriber(topic, message, self.take, queue_size=1000)

    def take(self, message):
        with self.news:
            if self.last is not None and message.header.stamp <= self.last:
                self.backward += 1
            self.last = message.header.stamp
            self.count += 1
            self.latest = message
            self.news.notify_all()

    def next(self, patience_s):
        """Seconds until the next message; None when none came."""
        with self.news:
            begin, count = time.monotonic(), self.count
            came = self.news.wait_for(lambda: self.count > count, timeout=patience_s)
            return time.monotonic() - begin if came else None

    def silent(self, quiet_s, patience_s):
        """Waits until nothing has come for so long."""
        deadline = time.monotonic() + patience_s
        while time.monotonic() < deadline:
            if self.next(quiet_s) is None:
                return True
        return False


def registered(status):
    with status.news:
        return status.latest.views_registered if status.count else 0


def wait_for(condition, patience_s, alive=lambda: True):
    deadline = time.monotonic() + patience_s
    while not condition() and time.monotonic() < deadline and alive():
        time.sleep(0.1)
    return condition()


def exercise(options, alive):
    import rospy
    from geometry_msgs.msg import PoseStamped
    from sensor_msgs.msg import Image, Imu
    from std_srvs.srv import SetBool
    from scanner.msg import RegisteredView, RegistrationStatus

    rospy.init_node("replug", disable_signals=True)
    streams = {"camera": Stream(rospy, "/bumblebee/left/image_raw", Image),
               "mti": Stream(rospy, "/mti/imu/data", Imu)}
    status = Stream(rospy, "/registration/status", RegistrationStatus)
    if not wait_for(lambda: registered(status) >= 2, options.start_patience_s, alive):
        print("replug: the scan did not start", file=sys.stderr)
        return 1
    reasons = collections.Counter()
    rospy.Subscriber("/registration/views", RegisteredView,
                     lambda view: reasons.update([view.reason] if view.reason else []), queue_size=1000)
    truth = Stream(rospy, "/ground_truth/pose", PoseStamped)
    if not truth.silent(3.0, options.start_patience_s):
        print("replug: the rig does not come to rest", file=sys.stderr)
        return 1
    begin = registered(status)
    failures, seconds = [], {name: [] for name in streams}
    for turn in range(options.times):
        for name, stream in streams.items():
            plug = rospy.ServiceProxy(f"/rig_simulator_node/plug_{name}", SetBool)
            before = registered(status)
            plug(False)
            quiet = 1.0 if name == "mti" else 3.0
            if not stream.silent(quiet, options.patience_s):
                failures.append(f"{name}, turn {turn + 1}: went on without its cable")
            plug(True)
            took = stream.next(options.patience_s)
            if took is None:
                failures.append(f"{name}, turn {turn + 1}: did not come back")
                continue
            seconds[name].append(took)
            if registered(status) < before:
                failures.append(f"{name}, turn {turn + 1}: the map lost views")
            print(f"{name:7s} turn {turn + 1:2d}: back after {took:5.2f} s; views {before} -> {registered(status)}",
                  flush=True)
    if registered(status) <= begin:
        failures.append("no view was added in between")
    last = registered(status)
    if not wait_for(lambda: registered(status) > last, options.patience_s):
        failures.append("no view was added after the last cable was back")
    for name, stream in streams.items():
        if stream.backward:
            failures.append(f"{name}: {stream.backward} stamps went backwards")
        if seconds[name]:
            print(f"{name:7s} {len(seconds[name])} of {options.times} times back; seconds median "
                  f"{statistics.median(seconds[name]):.2f}, longest {max(seconds[name]):.2f}")
    scan = status.latest
    print(f"views registered {scan.views_registered} of {scan.views_total}, {scan.queue_length} waiting")
    for reason, count in reasons.most_common(5):
        print(f"  {count} not placed: {reason}")
    for failure in failures:
        print("replug: " + failure, file=sys.stderr)
    return 1 if failures else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=10, help="how often each cable is pulled")
    parser.add_argument("--simulation", default="", help="YAML file for field.launch simulation:=")
    parser.add_argument("--config", default="field", help="for field.launch config:=")
    parser.add_argument("--patience-s", type=float, default=30.0, help="that a driver may take to come back")
    parser.add_argument("--start-patience-s", type=float, default=400.0, help="until the scan runs")
    options = parser.parse_args()
    port = free_port()
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{port}"
    with tempfile.TemporaryDirectory() as place:
        os.environ["ROS_HOME"] = place
        log = pathlib.Path(place) / "launch.log"
        with open(log, "w") as output:
            launch = subprocess.Popen(
                ["roslaunch", "-p", str(port), "scanner", "field.launch", "sim:=true", f"config:={options.config}",
                 f"simulation:={options.simulation}", f"mti_link:={place}/mti"],
                stdout=output, stderr=subprocess.STDOUT)
            try:
                alive = lambda: launch.poll() is None
                wait_for(lambda: listening(port), 60, alive)
                result = exercise(options, alive) if alive() else 1
            finally:
                launch.send_signal(signal.SIGINT)
                launch.wait(timeout=60)
        if result:
            print(log.read_text()[-4000:], file=sys.stderr)
    return result


if __name__ == "__main__":
    sys.exit(main())
