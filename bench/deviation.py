#!/usr/bin/python3
"""Deviation of a scan from a reference mesh, by Open3D's closest points (an independent program).

    bench/deviation.py SCAN_FOLDER REFERENCE.ply TRUTH.tum

The model is placed by the true pose of its first view, then again by a best fit. Needs python3-open3d and
python3-scipy (benchmarks only). Distances are unsigned; points further than 25 mm are counted as outliers.
"""
import pathlib
import sys

import numpy as np
import open3d as o3d
from scipy.spatial.transform import Rotation

SAMPLES = 200000
OUTLIER_M = 0.025
COVERED_M = 0.005


def read_tum(path):
    rows = [line.split() for line in open(path) if not line.startswith("#")]
    return np.array([[float(v) for v in row] for row in rows])


def matrix(row):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(row[4:8]).as_matrix()
    T[:3, 3] = row[1:4]
    return T


def report(name, distances):
    kept = distances[distances < OUTLIER_M] * 1e3
    print(f"{name}: rmse {np.sqrt((kept ** 2).mean()):.3f} mm, mean {kept.mean():.3f}, median {np.median(kept):.3f}, "
          f"95 % {np.percentile(kept, 95):.3f}, outliers {100 * np.mean(distances >= OUTLIER_M):.2f} %")


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    poses, truth = read_tum(folder / "trajectory.tum"), read_tum(sys.argv[3])
    true_first = truth[np.argmin(abs(truth[:, 0] - poses[0, 0]))]
    model = o3d.io.read_triangle_mesh(str(folder / "model.ply"))
    model.transform(matrix(true_first) @ np.linalg.inv(matrix(poses[0])))
    reference = o3d.io.read_triangle_mesh(sys.argv[2])
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(reference))

    def distances(cloud):
        points = np.asarray(cloud.points, dtype=np.float32)
        closest = scene.compute_closest_points(o3d.core.Tensor(points))["points"].numpy()
        return np.linalg.norm(closest - points, axis=1)

    o3d.utility.random.seed(1)
    points = model.sample_points_uniformly(SAMPLES)
    report("placed by the first pose", distances(points))
    surface = reference.sample_points_uniformly(2 * SAMPLES)
    surface.estimate_normals()
    registration = o3d.pipelines.registration
    T = np.eye(4)
    for reach in (0.02, 0.006):
        T = registration.registration_icp(
            points, surface, reach, T, registration.TransformationEstimationPointToPlane()).transformation
    points.transform(T)
    report("best fit", distances(points))
    reach = np.asarray(surface.compute_point_cloud_distance(points))
    print(f"coverage: {100 * np.mean(reach < COVERED_M):.1f} % of the reference within 5 mm")


if __name__ == "__main__":
    main()
