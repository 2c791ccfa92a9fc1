#include "simulation/polygonize.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "scanner/core/status.h"
#include "scanner/simulation/noise.h"
#include "simulation/mesh_topology.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

Eigen::AlignedBox3f cube(float half) {
  return {Vector3f::Constant(-half), Vector3f::Constant(half)};
}

Implicit sphere(float radius) {
  return {[radius](const Vector3f& p) { return p.norm() - radius; }, cube(radius)};
}

Implicit torus(float major, float minor) {
  return {[major, minor](const Vector3f& p) {
            return std::hypot(std::hypot(p.x(), p.y()) - major, p.z()) - minor;
          },
          {Vector3f(-major - minor, -major - minor, -minor),
           Vector3f(major + minor, major + minor, minor)}};
}

/// A sponge full of thin walls and tunnels of about a cell: the hard case for a manifold.
Implicit sponge() {
  return {[](const Vector3f& p) {
            const float noise = 0.004F * gradientNoise(p / 0.008F, 5);
            return std::max(noise, (p.norm() - 0.05F));
          },
          cube(0.05F)};
}

TEST(PolygonizeTest, SphereLiesOnTheSphere) {
  const Part part = polygonize(sphere(0.1F), 0.004F, 2);
  ASSERT_EQ(part.normals.size(), part.vertices.size());
  for (std::size_t i = 0; i < part.vertices.size(); ++i) {
    EXPECT_NEAR(part.vertices[i].norm(), 0.1F, 1e-5F);
    EXPECT_GT(part.normals[i].dot(part.vertices[i].normalized()), 0.9999F);
  }
  const Topology topology = topologyOf(part);
  EXPECT_TRUE(topology.closed_manifold);
  EXPECT_EQ(topology.euler, 2);
  EXPECT_NEAR(topology.volume, 4.0 / 3.0 * M_PI * 1e-3, 1e-5);
}

TEST(PolygonizeTest, TorusHasOneHole) {
  const Part part = polygonize(torus(0.08F, 0.03F), 0.004F, 2);
  const Topology topology = topologyOf(part);
  EXPECT_TRUE(topology.closed_manifold);
  EXPECT_EQ(topology.euler, 0);
  EXPECT_NEAR(topology.volume, 2.0 * M_PI * M_PI * 0.08 * 0.03 * 0.03, 1e-5);
  for (const Vector3f& v : part.vertices) {
    EXPECT_NEAR(std::hypot(std::hypot(v.x(), v.y()) - 0.08F, v.z()), 0.03F, 1e-5F);
  }
}

TEST(PolygonizeTest, ThinWallsAndTunnelsStayManifold) {
  const Topology topology = topologyOf(polygonize(sponge(), 0.003F, 2));
  EXPECT_TRUE(topology.closed_manifold);
  EXPECT_LT(topology.euler, -100) << "the sponge should be full of tunnels";
}

TEST(PolygonizeTest, FacesTurnOutwards) {
  const Part part = polygonize(torus(0.08F, 0.03F), 0.004F, 1);
  for (const auto& [a, b, c] : part.faces) {
    const Vector3f n =
        (part.vertices[b] - part.vertices[a]).cross(part.vertices[c] - part.vertices[a]);
    EXPECT_GT(n.dot(part.normals[a]), 0.0F);
  }
}

TEST(PolygonizeTest, SameBytesForEveryThreadCount) {
  const Part one = polygonize(sponge(), 0.003F, 1);
  const Part four = polygonize(sponge(), 0.003F, 4);
  ASSERT_EQ(one.vertices.size(), four.vertices.size());
  EXPECT_EQ(0, std::memcmp(one.vertices.data(), four.vertices.data(),
                           one.vertices.size() * sizeof(Vector3f)));
  EXPECT_EQ(one.faces, four.faces);
}

TEST(PolygonizeTest, RefusesWhatIsNotThereOrLeavesTheBounds) {
  EXPECT_THROW(polygonize({[](const Vector3f&) { return 1.0F; }, cube(0.1F)}, 0.01F, 1),
               ConfigurationError);
  Implicit cut = sphere(0.1F);
  cut.bounds = cube(0.08F);
  EXPECT_THROW(polygonize(cut, 0.004F, 1), ConfigurationError);
  EXPECT_THROW(polygonize(sphere(0.1F), 0.0F, 1), ConfigurationError);
}

}  // namespace
}  // namespace scanner::simulation
