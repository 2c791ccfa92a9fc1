#include <gtest/gtest.h>

#include "evaluation/shapes.h"
#include "scanner/core/se3.h"
#include "scanner/evaluation/deviation.h"

namespace scanner::evaluation {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

/// Points of the bumpy shape's faces with noise along all axes, and one in seven of a ground plane
/// that the reference lacks.
Mesh noisyCloud(const Mesh& surface, std::size_t count, double noise_m) {
  std::mt19937_64 random(7);
  Mesh cloud;
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::Vector3d p;
    if (i % 7 == 3) {
      p = Eigen::Vector3d(shapes::uniform(random, -0.6, 0.6), shapes::uniform(random, -0.6, 0.6),
                          -0.28);
    } else {
      const auto& [a, b, c] = surface.faces[random() % surface.faces.size()];
      const auto& v = surface.vertices.points;
      const double u = shapes::uniform(random, 0.0, 0.5), w = shapes::uniform(random, 0.0, 0.5);
      p = (1.0 - u - w) * v[a].cast<double>() + u * v[b].cast<double>() + w * v[c].cast<double>();
      p += shapes::uniformPoint(random, -noise_m, noise_m);
    }
    cloud.vertices.points.emplace_back(p.cast<float>());
  }
  return cloud;
}

Mesh moved(const Mesh& mesh, const Eigen::Isometry3d& T) {
  Mesh out = mesh;
  out.vertices = transformed(mesh.vertices, T);
  return out;
}

void expectPose(const Eigen::Isometry3d& got, const Eigen::Isometry3d& truth, double within_m,
                double within_deg) {
  const Eigen::Isometry3d error = got * truth.inverse();  // at the reference, about the origin
  EXPECT_LT(error.translation().norm(), within_m);
  EXPECT_LT(rotationAngle(error) / kDegree, within_deg);
}

class Align : public ::testing::Test {
 protected:
  const Mesh reference_ = shapes::starShaped(5, shapes::bumpyRadius);
  const SurfaceDistance surface_{reference_};
};

TEST_F(Align, RecoversAKnownMotionExactly) {
  for (const auto& T : {makePose({0.03, -0.02, 0.025}, expSo3({0.1, -0.08, 0.12})),
                        makePose({-0.05, 0.01, 0.0}, expSo3({0.0, 0.2, -0.1}))}) {
    const auto found = align(moved(reference_, T.inverse()), surface_, reference_,
                             Eigen::Isometry3d::Identity(), {}, 2);
    ASSERT_TRUE(found) << found.status().message();
    expectPose(*found, T, 1e-6, 1e-4);
  }
}

TEST_F(Align, RecoversAKnownMotionFromNoiseAndOutliers) {
  DeviationOptions options;
  options.align_samples = 100000;  // sigma / sqrt(n) over the shape's levers: 3e-4 deg
  const Mesh cloud = noisyCloud(reference_, 100000, 1e-4);
  const auto T = makePose({0.02, 0.03, -0.02}, expSo3({-0.07, 0.05, 0.1}));
  const auto found = align(moved(cloud, T.inverse()), surface_, reference_,
                           Eigen::Isometry3d::Identity(), options, 2);
  ASSERT_TRUE(found) << found.status().message();
  expectPose(*found, T, 1e-5, 1e-3);
}

TEST_F(Align, APartOfTheModelIsEnough) {
  Mesh part = reference_;
  part.faces.clear();
  for (const auto& face : reference_.faces) {
    if (reference_.vertices.points[face[0]].x() > -0.05F) part.faces.push_back(face);
  }
  const auto T = makePose({0.02, -0.03, 0.01}, expSo3({0.05, 0.05, -0.1}));
  const auto found =
      align(moved(part, T.inverse()), surface_, reference_, Eigen::Isometry3d::Identity(), {}, 2);
  ASSERT_TRUE(found) << found.status().message();
  expectPose(*found, T, 1e-6, 1e-4);
}

TEST_F(Align, APartOfTheReferenceIsEnough) {
  Mesh open = reference_;
  open.faces.clear();
  for (const auto& face : reference_.faces) {
    if (reference_.vertices.points[face[0]].x() > -0.1F) open.faces.push_back(face);
  }
  const auto T = makePose({0.01, -0.02, 0.01}, expSo3({0.03, 0.05, -0.05}));
  const auto found = align(moved(reference_, T.inverse()), SurfaceDistance(open), open,
                           Eigen::Isometry3d::Identity(), {}, 2);
  ASSERT_TRUE(found) << found.status().message();
  expectPose(*found, T, 1e-6, 1e-4);
}

TEST_F(Align, DirectionsThatTheShapeLeavesFreeAreKept) {
  // A wavy sheet that does not change along y.
  std::vector<Eigen::Vector3d> points;
  std::vector<shapes::FaceIndices> faces;
  const std::uint32_t n = 41;
  for (std::uint32_t i = 0; i < n; ++i) {
    for (const double y : {-1.0, 1.0}) {
      points.emplace_back(0.05 * i - 1.0, y, 0.1 * std::sin(0.4 * i));
    }
    if (i == 0) continue;
    faces.push_back({2 * i - 2, 2 * i, 2 * i - 1});
    faces.push_back({2 * i, 2 * i + 1, 2 * i - 1});
  }
  const Mesh sheet = shapes::makeMesh(points, faces);
  Mesh inner = sheet;
  for (auto& p : inner.vertices.points) p = p.cwiseProduct(Eigen::Vector3f(1.0F, 0.5F, 1.0F));
  const auto T = makePose({0.02, 0.0, 0.03}, expSo3({0.0, 0.0, 0.0}));
  const auto start = makePose({0.0, 0.07, 0.0}, Eigen::Quaterniond::Identity());
  const auto found = align(moved(inner, T.inverse()), SurfaceDistance(sheet), sheet, start, {}, 2);
  ASSERT_TRUE(found) << found.status().message();
  EXPECT_NEAR(found->translation().x(), 0.02, 1e-5);
  EXPECT_NEAR(found->translation().y(), 0.07, 1e-4);
  EXPECT_NEAR(found->translation().z(), 0.03, 1e-5);
}

TEST_F(Align, ASideThatIsDisplacedIsNoOutlier) {
  // All but two sides of a cube slide along themselves and fit perfectly.
  const Mesh cube = shapes::cube();
  const auto T = makePose({0.02, 0.0, 0.0}, Eigen::Quaterniond::Identity());
  const auto found = align(moved(cube, T.inverse()), SurfaceDistance(cube), cube,
                           Eigen::Isometry3d::Identity(), {}, 2);
  ASSERT_TRUE(found) << found.status().message();
  expectPose(*found, T, 1e-6, 1e-4);
}

TEST_F(Align, DoesNotDependOnThreads) {
  const Mesh cloud = noisyCloud(reference_, 10000, 2e-4);
  const auto start = makePose({0.02, 0.0, 0.0}, expSo3({0.0, 0.05, 0.0}));
  const auto one = align(cloud, surface_, reference_, start, {}, 1);
  const auto two = align(cloud, surface_, reference_, start, {}, 2);
  ASSERT_TRUE(one && two);
  EXPECT_EQ(one->matrix(), two->matrix());
}

TEST_F(Align, TooLittleToAlignIsAStatus) {
  EXPECT_EQ(
      align(Mesh{}, surface_, reference_, Eigen::Isometry3d::Identity(), {}, 1).status().code(),
      StatusCode::kNotEnoughData);
  Mesh few;
  few.vertices.points = {{0.3F, 0.0F, 0.0F}, {0.0F, 0.3F, 0.0F}};
  EXPECT_EQ(align(few, surface_, reference_, Eigen::Isometry3d::Identity(), {}, 1).status().code(),
            StatusCode::kNotEnoughData);
}

TEST_F(Align, PlacementIsFoundFromAnyHeading) {
  const Mesh cloud = noisyCloud(reference_, 20000, 2e-4);
  for (const double heading : {0.5, 2.0, 3.1, -1.2}) {
    const auto T = makePose({2.0, -1.0, 0.5}, expSo3(heading * Eigen::Vector3d::UnitZ()));
    const Mesh model = moved(cloud, T.inverse());
    const auto start =
        searchPlacement(model, surface_, reference_, Eigen::Isometry3d::Identity(), {}, 2);
    ASSERT_TRUE(start) << start.status().message();
    const auto found = align(model, surface_, reference_, *start, {}, 2);
    ASSERT_TRUE(found) << found.status().message();
    expectPose(*found, T, 3e-5, 5e-3);
  }
}

}  // namespace
}  // namespace scanner::evaluation
