"""What the tests of the commands share."""
import contextlib
import fcntl
import os
import pathlib
import struct
import subprocess
import tempfile
import zlib

BIN = pathlib.Path(os.environ["SCANNER_BIN"])
ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = pathlib.Path(os.environ.get("SCANNER_DATA", ROOT.parent / "shared" / "data"))


def run(command, *arguments):
    """Exit code, standard output and standard error of one command of the package."""
    done = subprocess.run([str(BIN / command), *map(str, arguments)], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True, check=False)
    return done.returncode, done.stdout, done.stderr


@contextlib.contextmanager
def camera_port():
    """One emulated camera per machine: the same lock as test/support/camera_port_lock.h."""
    path = pathlib.Path(tempfile.gettempdir()) / "scanner_camera_port.lock"
    with open(path, "r" if path.exists() else "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def write_png(path, width, height, pixel):
    """8-bit grey PNG; pixel(x, y) gives 0..255."""
    rows = b"".join(b"\0" + bytes(pixel(x, y) for x in range(width)) for y in range(height))

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    path.write_bytes(b"\x89PNG\r\n\x1a\n"
                     + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
                     + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def write_euroc(folder, frames=3, frame_step_ns=100_000_000):
    """A tiny EuRoC folder: random texture, a sensor that stands still."""
    start = 1_500_000_000_000_000_000
    for name, x in (("cam0", 0.0), ("cam1", 0.11)):
        data = folder / name / "data"
        data.mkdir(parents=True)
        (folder / name / "sensor.yaml").write_text(
            "%YAML:1.0\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
            f"  data: [0, 0, 1, 0, -1, 0, 0, {-x}, 0, -1, 0, 0, 0, 0, 0, 1]\n"
            "rate_hz: 10\nresolution: [160, 120]\ncamera_model: pinhole\n"
            "intrinsics: [150, 150, 79.5, 59.5]\ndistortion_model: radial-tangential\n"
            "distortion_coefficients: [0, 0, 0, 0]\n")
        lines = ["#timestamp [ns],filename"]
        for i in range(frames):
            stamp = start + i * frame_step_ns
            shift = 8 if name == "cam1" else 0
            write_png(data / f"{stamp}.png", 160, 120,
                      lambda u, v, s=shift: zlib.crc32(bytes([(u + s) % 256 // 2, v // 2])) & 255)
            lines.append(f"{stamp},{stamp}.png")
        (folder / name / "data.csv").write_text("\n".join(lines) + "\n")
    imu = folder / "imu0"
    imu.mkdir()
    (imu / "sensor.yaml").write_text(
        "%YAML:1.0\nsensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n"
        "  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nrate_hz: 200\n")
    samples = ["#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z"]
    for i in range(400):
        samples.append(f"{start - 500_000_000 + i * 5_000_000},0,0,0,0,0,9.82")
    (imu / "data.csv").write_text("\n".join(samples) + "\n")
