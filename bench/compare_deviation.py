#!/usr/bin/python3
"""Deviation by `evaluate` beside CloudCompare's cloud-to-mesh distance, point by point.

    bench/compare_deviation.py MODEL.ply REFERENCE.ply [options of evaluate, such as --align]

Both get the same points (in the frame of the reference) and the same mesh. Prints how far the
distances differ, once without and once with their signs, and exits with 1 when the sizes differ by
more than 0.01 mm anywhere. Needs cloudcompare and python3-numpy (benchmarks only), and `evaluate`
in SCANNER_BIN (default: build/devel/lib/scanner).
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
BIN = pathlib.Path(os.environ.get("SCANNER_BIN", ROOT / "build" / "devel" / "lib" / "scanner"))
AGREED_MM = 0.01


def by_evaluate(model, reference, options, folder):
    subprocess.run([BIN / "evaluate", model, "--reference", reference, "--out", folder,
                    "--per-point", *options], check=True)
    return np.loadtxt(folder / "deviation.asc", ndmin=2)


def by_cloudcompare(points, reference, folder):
    """Columns x y z distance. CloudCompare writes beside its input, so it gets copies."""
    mesh = folder / "reference.ply"
    shutil.copyfile(reference, mesh)
    cloud = folder / "points.asc"
    np.savetxt(cloud, points, fmt="%.9g")
    program = shutil.which("CloudCompare") or shutil.which("cloudcompare")
    if program is None:
        sys.exit("cloudcompare is not installed")
    subprocess.run([program, "-SILENT", "-AUTO_SAVE", "OFF", "-C_EXPORT_FMT", "ASC", "-PREC", "9",
                    "-NO_TIMESTAMP", "-O", cloud, "-O", mesh, "-C2M_DIST", "-SAVE_CLOUDS"],
                   check=True, stdout=subprocess.DEVNULL, timeout=600,
                   env={**os.environ, "QT_QPA_PLATFORM": "offscreen"})
    written = [f for f in folder.glob("points*.asc") if f != cloud]
    if len(written) != 1:
        sys.exit(f"CloudCompare wrote {len(written)} clouds instead of one")
    return np.loadtxt(written[0], ndmin=2)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        ours = by_evaluate(sys.argv[1], sys.argv[2], sys.argv[3:], folder)
        theirs = by_cloudcompare(ours[:, :3], sys.argv[2], folder)
    if len(ours) != len(theirs) or abs(ours[:, :3] - theirs[:, :3]).max() > 1e-6:
        sys.exit("the two programs did not keep the same points in the same order")
    a, b = 1e3 * ours[:, 3], 1e3 * theirs[:, -1]
    size = abs(abs(a) - abs(b))
    flipped = (np.sign(a) != np.sign(b)) & (abs(a) > AGREED_MM)
    print(f"{len(a)} points; mean / sigma: evaluate {a.mean():+.5f} / {a.std():.5f} mm, "
          f"CloudCompare {b.mean():+.5f} / {b.std():.5f} mm")
    print(f"difference of the sizes: max {size.max():.6f} mm, 99.9 % {np.percentile(size, 99.9):.6f}, "
          f"median {np.median(size):.6f}; above {AGREED_MM} mm: {(size > AGREED_MM).sum()}")
    print(f"other sign (and further than {AGREED_MM} mm): {flipped.sum()}"
          + (f", {abs(a[flipped]).min():.3f} to {abs(a[flipped]).max():.3f} mm away"
             if flipped.any() else ""))
    return int(size.max() > AGREED_MM)


if __name__ == "__main__":
    sys.exit(main())
