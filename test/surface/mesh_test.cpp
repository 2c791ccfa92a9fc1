#include <gtest/gtest.h>

#include "fixtures.h"
#include "scanner/surface/ball_pivot.h"
#include "scanner/surface/clean.h"
#include "scanner/surface/holes.h"
#include "scanner/surface/smooth.h"
#include "scanner/surface/statistics.h"

namespace scanner::surface {
namespace {

/// Nothing is removed for being small: the meshes of these tests are.
CleaningOptions keepPieces() {
  CleaningOptions options;
  options.min_piece_faces = 0;
  options.min_piece_diameter = 0.0;
  return options;
}

TEST(MeshStatistics, KnownMeshes) {
  const MeshStatistics one = meshStatistics(test::cube());
  EXPECT_EQ(one.vertices, 8U);
  EXPECT_EQ(one.faces, 12U);
  EXPECT_EQ(one.components, 1U);
  EXPECT_EQ(one.boundary_edges, 0U);
  EXPECT_EQ(one.non_manifold_edges, 0U);
  EXPECT_NEAR(one.mean_spacing_m, (12.0 + 6.0 * std::sqrt(2.0)) / 18.0, 1e-6);
  EXPECT_NEAR(test::volume(test::cube()), 1.0, 1e-12);
  EXPECT_EQ(meshStatistics(test::joined(test::cube(), test::cube({3, 0, 0}))).components, 2U);
  Mesh open = test::cube();
  open.faces.resize(10);
  EXPECT_EQ(meshStatistics(open).boundary_edges, 4U);
  Mesh fin = test::cube();
  fin.vertices.appendFrom(test::cube().vertices, 0);
  fin.vertices.points.back() = {-1, -1, -1};
  fin.faces.push_back({0, 1, 8});
  EXPECT_EQ(meshStatistics(fin).non_manifold_edges, 1U);
  EXPECT_EQ(meshStatistics({}).faces, 0U);
}

TEST(Clean, LeavesAGoodMeshAlone) {
  CleaningStatistics s;
  const Mesh mesh = clean(test::cube(), keepPieces(), &s);
  EXPECT_TRUE(test::sameBytes(mesh, test::cube()));
  EXPECT_EQ(s.invalid_faces + s.duplicate_vertices + s.degenerate_faces + s.duplicate_faces +
                s.non_manifold_faces + s.pieces + s.split_vertices + s.unreferenced_vertices,
            0U);
  EXPECT_TRUE(clean({}, {}).faces.empty());
}

TEST(Clean, InvalidAndUnreferenced) {
  Mesh mesh = test::cube();
  mesh.faces.push_back({0, 1, 99});
  mesh.vertices.appendFrom(test::cube({5, 5, 5}).vertices, 0);
  CleaningStatistics s;
  EXPECT_TRUE(test::sameBytes(clean(mesh, keepPieces(), &s), test::cube()));
  EXPECT_EQ(s.invalid_faces, 1U);
  EXPECT_EQ(s.unreferenced_vertices, 1U);
}

TEST(Clean, DuplicateVertices) {
  // Every face with its own three corners, as in an STL file.
  Mesh soup;
  for (const auto& f : test::cube().faces) {
    const auto at = static_cast<std::uint32_t>(soup.vertices.size());
    for (const std::uint32_t v : f) soup.vertices.points.push_back(test::cube().vertices.points[v]);
    soup.faces.push_back({at, at + 1, at + 2});
  }
  CleaningStatistics s;
  const Mesh mesh = clean(soup, keepPieces(), &s);
  EXPECT_EQ(s.duplicate_vertices, 28U);
  EXPECT_EQ(meshStatistics(mesh).vertices, 8U);
  EXPECT_EQ(meshStatistics(mesh).boundary_edges, 0U);
}

TEST(Clean, KeepsCoincidentVerticesOfOpposedSides) {
  Mesh sheet = test::gridMesh(4);
  Mesh back = test::gridMesh(4);
  for (auto& n : back.vertices.normals) n = -n;
  for (auto& f : back.faces) std::swap(f[0], f[1]);
  CleaningStatistics s;
  const Mesh mesh = clean(test::joined(sheet, back), keepPieces(), &s);
  EXPECT_EQ(s.duplicate_vertices, 0U);
  EXPECT_EQ(mesh.faces.size(), 64U);
}

TEST(Clean, DegenerateAndDuplicateFaces) {
  Mesh mesh = test::gridMesh(2);
  mesh.faces.push_back({0, 1, 2});  // three in a row
  mesh.faces.push_back({0, 0, 4});
  mesh.faces.push_back({mesh.faces[0][1], mesh.faces[0][2], mesh.faces[0][0]});
  mesh.faces.push_back({mesh.faces[1][1], mesh.faces[1][0], mesh.faces[1][2]});  // turned round
  CleaningStatistics s;
  EXPECT_TRUE(test::sameBytes(clean(mesh, keepPieces(), &s), test::gridMesh(2)));
  EXPECT_EQ(s.degenerate_faces, 2U);
  EXPECT_EQ(s.duplicate_faces, 2U);
}

TEST(Clean, NonManifoldFaces) {
  Mesh mesh = test::cube();
  mesh.vertices.appendFrom(test::cube().vertices, 0);
  mesh.vertices.points.back() = {0.5F, -0.1F, -0.1F};
  mesh.faces.push_back({0, 1, 8});
  CleaningStatistics s;
  EXPECT_TRUE(test::sameBytes(clean(mesh, keepPieces(), &s), test::cube()));
  EXPECT_EQ(s.non_manifold_faces, 1U);
  EXPECT_EQ(s.unreferenced_vertices, 1U);
}

TEST(Clean, SplitsVerticesWhereFansMeet) {
  // Two tetrahedron-like fans sharing vertex 0 only: a bow tie.
  Mesh mesh;
  mesh.vertices = test::planePoints(5, 1, 1.0, 0.0);
  mesh.vertices.points[1] = {1, 0, 0};
  mesh.vertices.points[2] = {1, 1, 0};
  mesh.vertices.points[3] = {-1, 0, 0};
  mesh.vertices.points[4] = {-1, -1, 0};
  mesh.faces = {{0, 1, 2}, {0, 3, 4}};
  CleaningStatistics s;
  const Mesh split = clean(mesh, keepPieces(), &s);
  EXPECT_EQ(s.split_vertices, 1U);
  EXPECT_EQ(split.vertices.size(), 6U);
  EXPECT_EQ(split.faces[1][0], 5U);
  EXPECT_EQ(split.vertices.points[5], split.vertices.points[0]);
}

TEST(Clean, ColorWithTolerance) {
  Mesh mesh = test::gridMesh(4);
  mesh.vertices.colors.assign(25, Rgb8{200, 200, 200});
  mesh.vertices.colors[12] = {10, 250, 5};  // the middle
  CleaningOptions options = keepPieces();
  options.remove_color = true;
  options.color_g = 255;
  CleaningStatistics s;
  const Mesh cleaned = clean(mesh, options, &s);
  EXPECT_EQ(s.colored_vertices, 1U);
  EXPECT_EQ(s.colored_faces, 6U);
  EXPECT_EQ(cleaned.faces.size(), 26U);
  options.color_tolerance = 9;
  EXPECT_EQ(clean(mesh, options).faces.size(), 32U);
}

TEST(Clean, IsolatedPieces) {
  Mesh mesh = test::gridMesh(10);  // 200 faces, diameter 1.41
  Mesh small = test::cube({3, 0, 0});
  for (auto& p : small.vertices.points)
    p = Eigen::Vector3f(3, 0, 0) + 0.01F * (p - Eigen::Vector3f(3, 0, 0));
  mesh.vertices.colors.assign(mesh.vertices.size(), Rgb8{});
  mesh = test::joined(test::joined(mesh, small), test::cube({9, 0, 0}));
  const auto faces = [&](int count, double diameter, double distance, bool largest) {
    CleaningOptions options = keepPieces();
    options.min_piece_faces = count;
    options.min_piece_diameter = diameter;
    options.max_piece_distance_m = distance;
    options.keep_largest_piece = largest;
    CleaningStatistics s;
    const Mesh cleaned = clean(mesh, options, &s);
    EXPECT_EQ(s.piece_faces + cleaned.faces.size(), 224U);
    EXPECT_EQ(s.pieces, cleaned.faces.size() == 12 ? 2U : 1U);
    return cleaned.faces.size();
  };
  // The largest piece by area is the unit cube (area 6 against 1).
  EXPECT_EQ(faces(13, 0.0, 0.0, false), 212U);
  EXPECT_EQ(faces(0, 0.1, 0.0, false), 212U);
  EXPECT_EQ(faces(0, 0.0, 8.7, false), 24U);
  EXPECT_EQ(faces(0, 0.0, 0.0, true), 12U);
}

TEST(FillHoles, PlaneWithAHole) {
  const int n = 20;
  Mesh mesh = test::gridMesh(n);
  mesh.vertices.colors.assign(mesh.vertices.size(), Rgb8{100, 150, 200});
  Mesh open = mesh;
  open.faces.clear();
  for (const auto& f : mesh.faces) {
    Eigen::Vector3f center = Eigen::Vector3f::Zero();
    for (const std::uint32_t v : f) center += mesh.vertices.points[v] / 3.0F;
    if ((center - Eigen::Vector3f(0.5F, 0.5F, 0.0F)).norm() > 0.2F) open.faces.push_back(f);
  }
  HoleOptions options;
  options.max_diameter_m = 1.0;
  HoleStatistics s;
  const Mesh filled = fillHoles(open, options, &s);
  EXPECT_EQ(s.filled, 1U);
  EXPECT_EQ(s.outer_rims, 1U);
  EXPECT_GT(s.vertices_added, 10U);
  EXPECT_NEAR(test::area(filled), 1.0, 1e-5);
  const MeshStatistics m = meshStatistics(filled);
  EXPECT_EQ(m.boundary_edges, 80U);
  EXPECT_EQ(m.non_manifold_edges, 0U);
  for (std::size_t i = mesh.vertices.size(); i < filled.vertices.size(); ++i) {
    EXPECT_EQ(filled.vertices.colors[i], (Rgb8{100, 150, 200}));
    EXPECT_NEAR(filled.vertices.normals[i].z(), 1.0F, 1e-4F);
    EXPECT_NEAR(filled.vertices.points[i].z(), 0.0F, 1e-6F);
  }
  for (std::size_t f = open.faces.size(); f < filled.faces.size(); ++f) {
    const auto& p = filled.vertices.points;
    const auto& t = filled.faces[f];
    EXPECT_GT((p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]).z(), 0.0F) << "face " << f;
  }
  options.max_edges = 10;
  EXPECT_EQ(fillHoles(open, options).faces.size(), open.faces.size());
  options.max_edges = 100;
  options.max_diameter_m = 0.3;
  EXPECT_EQ(fillHoles(open, options).faces.size(), open.faces.size());
}

TEST(FillHoles, ClosesACubeAndASphere) {
  Mesh open = test::cube();
  open.faces.resize(10);
  const Mesh box = fillHoles(open, {});
  EXPECT_EQ(meshStatistics(box).boundary_edges, 0U);
  EXPECT_NEAR(test::volume(box), 1.0, 1e-6);
  Mesh sphere = ballPivot(test::spherePoints(2000, 1.0), {}).value();
  Mesh cut = sphere;
  cut.faces.clear();
  for (const auto& f : sphere.faces) {
    if (sphere.vertices.points[f[0]].z() < 0.97F) cut.faces.push_back(f);
  }
  const Mesh closed = fillHoles(clean(cut, {}), {});
  EXPECT_EQ(meshStatistics(closed).boundary_edges, 0U);
  EXPECT_EQ(test::eulerCharacteristic(closed), 2);
  EXPECT_NEAR(test::volume(closed), test::volume(sphere), 0.01);
}

Mesh noisySphere(double noise) {
  Mesh mesh = ballPivot(test::spherePoints(4000, 0.1), {}).value();
  std::mt19937 rng(11);
  std::normal_distribution<double> gauss(0.0, noise);
  for (auto& p : mesh.vertices.points) p *= static_cast<float>(1.0 + gauss(rng) / 0.1);
  return mesh;
}

/// Standard deviation of the radius: noise without the shrinking of the whole.
double roughness(const Mesh& mesh) {
  double mean = 0.0;
  for (const auto& p : mesh.vertices.points) mean += double{p.norm()};
  return test::radialRms(mesh.vertices, mean / static_cast<double>(mesh.vertices.size()));
}

TEST(Smooth, EveryMethodShrinksNoise) {
  const Mesh noisy = noisySphere(0.5e-3);
  const double before = roughness(noisy);
  for (const auto method :
       {SmoothingMethod::kLaplacian, SmoothingMethod::kHcLaplacian, SmoothingMethod::kTwoStep}) {
    SmoothingOptions options;
    options.method = method;
    const Mesh smoothed = smooth(noisy, options);
    EXPECT_LT(roughness(smoothed), 0.6 * before) << static_cast<int>(method);
    EXPECT_EQ(smoothed.faces, noisy.faces);
    EXPECT_TRUE(allFinite(smoothed.vertices));
  }
  EXPECT_TRUE(test::sameBytes(smooth(noisy, {}), noisy));
}

TEST(Smooth, HcKeepsTheVolumeThatLaplacianLoses) {
  const Mesh noisy = noisySphere(0.3e-3);
  SmoothingOptions options;
  options.iterations = 30;
  options.method = SmoothingMethod::kLaplacian;
  const double lost = 1.0 - test::volume(smooth(noisy, options)) / test::volume(noisy);
  options.method = SmoothingMethod::kHcLaplacian;
  const double hc_lost = 1.0 - test::volume(smooth(noisy, options)) / test::volume(noisy);
  EXPECT_GT(lost, 0.01);
  EXPECT_LT(std::abs(hc_lost), 0.002);
}

TEST(Smooth, TwoStepKeepsASharpEdge) {
  // A roof: two planes at 90 degrees, with noise.
  const int n = 30;
  Mesh roof = test::gridMesh(n);
  std::mt19937 rng(5);
  std::normal_distribution<float> gauss(0.0F, 0.002F);
  std::vector<float> truth;
  for (auto& p : roof.vertices.points) {
    truth.push_back(-std::abs(p.x() - 0.5F));
    p.z() = truth.back() + gauss(rng);
  }
  const auto error = [&](const Mesh& mesh, bool ridge) {
    double sum = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const auto& p = mesh.vertices.points[i];
      if ((std::abs(p.x() - 0.5F) < 0.01F) != ridge || std::abs(p.y() - 0.5F) > 0.4F) continue;
      sum += std::pow(double{p.z() + std::abs(p.x() - 0.5F)}, 2);
      ++count;
    }
    return std::sqrt(sum / count);
  };
  SmoothingOptions options;
  options.method = SmoothingMethod::kTwoStep;
  const Mesh two_step = smooth(roof, options);
  options.method = SmoothingMethod::kLaplacian;
  options.iterations = 10;
  const Mesh laplacian = smooth(roof, options);
  EXPECT_LT(error(two_step, false), 0.6 * error(roof, false));
  EXPECT_LT(error(two_step, true), 0.5 * error(laplacian, true));
}

TEST(Smooth, BoundaryStays) {
  Mesh mesh = test::gridMesh(10);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    mesh.vertices.points[i].z() = i % 2 == 0 ? 0.01F : -0.01F;
  }
  for (const auto method :
       {SmoothingMethod::kLaplacian, SmoothingMethod::kHcLaplacian, SmoothingMethod::kTwoStep}) {
    SmoothingOptions options;
    options.method = method;
    const Mesh smoothed = smooth(mesh, options);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      const bool rim = i < 11 || i >= 110 || i % 11 == 0 || i % 11 == 10;
      EXPECT_EQ(smoothed.vertices.points[i] == mesh.vertices.points[i], rim) << i;
    }
  }
}

}  // namespace
}  // namespace scanner::surface
