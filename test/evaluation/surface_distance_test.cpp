#include <gtest/gtest.h>

#include <algorithm>

#include "evaluation/shapes.h"
#include "scanner/evaluation/deviation.h"

namespace scanner::evaluation {
namespace {

using Eigen::Vector3d;

/// The exact signed distance of the cube of shapes::cube().
double cubeDistance(const Vector3d& p) {
  const Vector3d q = p.cwiseAbs() - Vector3d::Ones();
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

TEST(SurfaceDistance, OfACubeIsExactInsideAndOutside) {
  const SurfaceDistance surface(shapes::cube());
  std::mt19937_64 random(1);
  for (int i = 0; i < 20000; ++i) {
    const Vector3d p = shapes::uniformPoint(random, -2.0, 2.0);
    EXPECT_NEAR(surface.nearest(p).signed_m, cubeDistance(p), 1e-12) << p.transpose();
  }
}

TEST(SurfaceDistance, SignsHoldBesideEdgesAndCorners) {
  const SurfaceDistance surface(shapes::cube());
  std::mt19937_64 random(2);
  int from_edges_and_corners = 0;
  for (int i = 0; i < 20000; ++i) {
    Vector3d p(1.0, 1.0, i % 2 == 0 ? 1.0 : 0.3);
    p += shapes::uniformPoint(random, -1e-3, 1e-3);
    if (std::abs(cubeDistance(p)) < 1e-9) continue;
    const auto nearest = surface.nearest(p);
    EXPECT_EQ(nearest.signed_m > 0.0, cubeDistance(p) > 0.0) << p.transpose();
    if ((nearest.point.cwiseAbs() - Vector3d::Ones()).cwiseAbs().maxCoeff() < 1e-15 || i % 2 != 0) {
      ++from_edges_and_corners;
    }
  }
  EXPECT_GT(from_edges_and_corners, 5000);
}

/// A blade so thin that beside its tip the normals of both faces point away from the outside: the
/// case for which signs by the face's normal, or by the mean of the faces' normals, fail.
TEST(SurfaceDistance, SignsHoldAtASharpTipWithUnevenFans) {
  const Vector3d tip(1.0, 0.0, 0.0);
  std::vector<Vector3d> points{tip};
  const int fan = 8;  // the upper side has many thin faces at the tip, the lower side one
  for (int i = 0; i <= fan; ++i) points.emplace_back(-1.0, -0.5 + 1.0 * i / fan, 0.3);
  points.emplace_back(-1.0, 0.0, -0.3);
  std::vector<shapes::FaceIndices> faces;
  const std::uint32_t low = fan + 2;
  for (std::uint32_t i = 1; i <= fan; ++i) {
    faces.push_back({0, i + 1, i});    // top
    faces.push_back({low, i, i + 1});  // back
  }
  faces.push_back({0, 1, low});
  faces.push_back({0, low, low - 1});
  const SurfaceDistance surface(shapes::makeMesh(points, faces));
  EXPECT_LT(surface.nearest({-0.5, 0.0, 0.0}).signed_m, 0.0) << "the test's blade is inside out";
  std::mt19937_64 random(3);
  int at_tip = 0;
  for (int i = 0; i < 20000; ++i) {
    // The blade ends at x = 1: everything beyond is outside.
    Vector3d p = tip + shapes::uniformPoint(random, -0.2, 0.2);
    p.x() = 1.0 + std::abs(p.x() - 1.0) + 1e-9;
    const auto nearest = surface.nearest(p);
    EXPECT_GT(nearest.signed_m, 0.0) << p.transpose();
    if ((nearest.point - tip).norm() < 1e-12) ++at_tip;
  }
  EXPECT_GT(at_tip, 1000);
}

TEST(SurfaceDistance, SeamsOfDuplicatedVerticesDoNotDisturbSigns) {
  const Mesh whole = shapes::cube();
  Mesh soup;
  for (const auto& face : whole.faces) {
    const auto first = static_cast<std::uint32_t>(soup.vertices.size());
    for (const auto corner : face) soup.vertices.points.push_back(whole.vertices.points[corner]);
    soup.faces.push_back({first, first + 1, first + 2});
  }
  const SurfaceDistance surface(soup);
  std::mt19937_64 random(4);
  for (int i = 0; i < 5000; ++i) {
    const Vector3d p = shapes::uniformPoint(random, -2.0, 2.0);
    const auto nearest = surface.nearest(p);
    EXPECT_NEAR(nearest.signed_m, cubeDistance(p), 1e-12);
    EXPECT_FALSE(nearest.on_boundary);
  }
}

/// Nearest point of a triangle by another way: projection onto the plane if it falls inside, else
/// the nearest of the three segments.
double bruteDistance(const Vector3d& p, const std::array<Vector3d, 3>& t) {
  const Vector3d n = (t[1] - t[0]).cross(t[2] - t[0]).normalized();
  double best = std::numeric_limits<double>::infinity();
  bool inside = true;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3d a = t[i], e = t[(i + 1) % 3] - a;
    inside = inside && n.dot(e.cross(p - a)) >= 0.0;
    const double s = std::clamp(e.dot(p - a) / e.squaredNorm(), 0.0, 1.0);
    best = std::min(best, (p - a - s * e).norm());
  }
  return inside ? std::abs(n.dot(p - t[0])) : best;
}

TEST(SurfaceDistance, AgreesWithBruteForceOnASoupFarFromTheOrigin) {
  std::mt19937_64 random(5);
  const Vector3d far(300.0, -200.0, 100.0);
  Mesh soup;
  for (std::uint32_t i = 0; i < 400; ++i) {
    const Vector3d at = far + shapes::uniformPoint(random, -1.0, 1.0);
    for (int k = 0; k < 3; ++k) {
      soup.vertices.points.emplace_back(
          (at + shapes::uniformPoint(random, -0.1, 0.1)).cast<float>());
    }
    soup.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const SurfaceDistance surface(soup);
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p = far + shapes::uniformPoint(random, -2.0, 2.0);
    double truth = std::numeric_limits<double>::infinity();
    for (const auto& [a, b, c] : soup.faces) {
      const auto& v = soup.vertices.points;
      truth = std::min(
          truth, bruteDistance(p, {v[a].cast<double>(), v[b].cast<double>(), v[c].cast<double>()}));
    }
    const auto nearest = surface.nearest(p);
    EXPECT_NEAR(std::abs(nearest.signed_m), truth, 1e-10);
    EXPECT_NEAR((nearest.point - p).norm(), truth, 1e-10);
    EXPECT_TRUE(surface.isWithin(p, truth + 1e-9));
    EXPECT_FALSE(surface.isWithin(p, truth - 1e-9));
  }
}

TEST(SurfaceDistance, ABoundSavesTimeAndChangesNothing) {
  const SurfaceDistance surface(shapes::starShaped(4, shapes::bumpyRadius));
  std::mt19937_64 random(6);
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p = shapes::uniformPoint(random, -0.5, 0.5);
    const auto free = surface.nearest(p);
    for (const double factor : {0.0, 0.5, 1.0, 3.0}) {  // too small a bound is noticed
      const auto bound = surface.nearest(p, factor * std::abs(free.signed_m));
      EXPECT_EQ(bound.signed_m, free.signed_m);
      EXPECT_EQ(bound.face, free.face);
    }
  }
}

TEST(SurfaceDistance, KnowsTheRimOfAnOpenSurface) {
  const Mesh square =
      shapes::makeMesh({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}});
  const SurfaceDistance surface(square);
  const auto above = surface.nearest({0.25, 0.25, 0.1});
  EXPECT_FALSE(above.on_boundary);  // over the diagonal, an edge with two faces
  EXPECT_NEAR(above.signed_m, 0.1, 1e-12);
  EXPECT_EQ(above.face, 0u);
  EXPECT_NEAR((above.normal - Vector3d::UnitZ()).norm(), 0.0, 1e-12);
  EXPECT_NEAR(surface.nearest({0.3, 0.2, -0.1}).signed_m, -0.1, 1e-12);
  EXPECT_TRUE(surface.nearest({1.2, 0.5, 0.0}).on_boundary);
  EXPECT_TRUE(surface.nearest({1.2, 1.3, 0.0}).on_boundary);
}

TEST(SurfaceDistance, NotANumberGivesNotANumber) {
  const SurfaceDistance surface(shapes::cube());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(surface.nearest({0.0, nan, 0.0}).signed_m));
  EXPECT_TRUE(
      std::isnan(surface.nearest({std::numeric_limits<double>::infinity(), 0.0, 0.0}).signed_m));
  EXPECT_FALSE(surface.isWithin({nan, 0.0, 0.0}, 1.0));
}

TEST(SurfaceDistance, RefusesWhatIsNoSurface) {
  Mesh mesh = shapes::cube();
  mesh.faces.clear();
  EXPECT_THROW(SurfaceDistance{mesh}, ConfigurationError);
  mesh.faces = {{0, 1, 8}};
  EXPECT_THROW(SurfaceDistance{mesh}, ConfigurationError);
  mesh.faces = {{0, 1, 1}};  // no area
  EXPECT_THROW(SurfaceDistance{mesh}, ConfigurationError);
  mesh = shapes::cube();
  mesh.vertices.points[3].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(SurfaceDistance{mesh}, ConfigurationError);
  EXPECT_THROW(SurfaceDistance{Mesh{}}, ConfigurationError);
}

TEST(SurfaceDistance, FacesWithoutAreaAreLeftOut) {
  Mesh mesh = shapes::cube();
  mesh.faces.insert(mesh.faces.begin(), {0, 7, 7});
  const SurfaceDistance surface(mesh);
  EXPECT_NEAR(surface.nearest(Vector3d::Zero()).signed_m, -1.0, 1e-12);
  EXPECT_GE(surface.nearest({0.2, 0.1, 0.9}).face, 1u);  // numbers are those of the mesh
}

}  // namespace
}  // namespace scanner::evaluation
