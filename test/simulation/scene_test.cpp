#include "scanner/simulation/scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "scanner/core/status.h"
#include "scanner/simulation/random.h"
#include "simulation/mesh_topology.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

SceneOptions coarse() {
  SceneOptions options;
  options.detail_m = 0.004;
  options.background = false;
  return options;
}

Part asPart(const Mesh& mesh) {
  Part part;
  part.vertices = mesh.vertices.points;
  part.faces = mesh.faces;
  return part;
}

float luminance(const Vector3f& rgb) { return rgb.dot(Vector3f(0.2126F, 0.7152F, 0.0722F)); }

TEST(ArtworkTest, IsClosedAndStandsOnTheGround) {
  const Scene scene = makeArtwork(coarse(), 3);
  const Mesh mesh = referenceMesh(scene);
  const Topology topology = topologyOf(asPart(mesh));
  EXPECT_TRUE(topology.closed_manifold);
  EXPECT_LT(topology.euler, 2) << "the crown is pierced";
  EXPECT_GT(topology.volume, 0.01);
  EXPECT_TRUE(mesh.vertices.hasColors());
  EXPECT_TRUE(mesh.vertices.hasNormals());

  const Vector3f size = scene.bounds.sizes();
  EXPECT_GT(size.z(), 0.5F);
  EXPECT_LT(size.z(), 0.9F);
  EXPECT_LT(std::max(size.x(), size.y()), 0.46F);
  EXPECT_NEAR(scene.bounds.min().z(), 0.0F, 1e-5F);
  EXPECT_TRUE(scene.bounds.contains(Vector3f(0.0F, 0.0F, 0.2F)));
}

TEST(ArtworkTest, HasTheSurfaceKindsOfTheThesis) {
  const Scene scene = makeArtwork(coarse(), 3);
  for (const std::string name : {"bumpy", "tiled", "impressed", "solids"}) {
    const auto part = std::find_if(scene.object.begin(), scene.object.end(),
                                   [&](const Part& p) { return p.name == name; });
    ASSERT_NE(part, scene.object.end()) << name;
    double area = 0.0;
    for (const auto& [a, b, c] : part->faces) {
      const Vector3f& v = part->vertices[a];
      area +=
          0.5 * static_cast<double>((part->vertices[b] - v).cross(part->vertices[c] - v).norm());
    }
    EXPECT_GT(area, 0.08) << name;
  }
}

TEST(ArtworkTest, SameSeedSameBytesOtherSeedOtherShape) {
  const Scene a = makeArtwork(coarse(), 3), b = makeArtwork(coarse(), 3);
  ASSERT_EQ(a.object.size(), b.object.size());
  for (std::size_t i = 0; i < a.object.size(); ++i) {
    ASSERT_EQ(a.object[i].vertices.size(), b.object[i].vertices.size());
    EXPECT_EQ(0, std::memcmp(a.object[i].vertices.data(), b.object[i].vertices.data(),
                             a.object[i].vertices.size() * sizeof(Vector3f)));
    EXPECT_EQ(a.object[i].faces, b.object[i].faces);
    SurfacePoint point{a.object[i].vertices[0], a.object[i].normals[0], {0.0F, 0.0F}, 0.0007F};
    EXPECT_EQ(a.object[i].shader(point).albedo, b.object[i].shader(point).albedo);
  }
  const Scene other = makeArtwork(coarse(), 4);
  EXPECT_NE(other.object[1].vertices, a.object[1].vertices);
}

/// Relative standard deviation of the brightness in a window of a stereo matcher on the surface.
float contrastAt(const Part& part, std::size_t vertex, float pixel_m) {
  const Vector3f normal = part.normals[vertex];
  const Vector3f u = normal.unitOrthogonal(), v = normal.cross(u);
  constexpr int kHalf = 6;
  double sum = 0.0, squares = 0.0, count = 0.0;
  for (int row = -kHalf; row <= kHalf; ++row) {
    for (int column = -kHalf; column <= kHalf; ++column) {
      SurfacePoint point;
      point.position = part.vertices[vertex] +
                       pixel_m * (static_cast<float>(column) * u + static_cast<float>(row) * v);
      point.normal = normal;
      point.uv.setZero();
      point.footprint_m = pixel_m;
      const double brightness = static_cast<double>(luminance(part.shader(point).albedo));
      sum += brightness;
      squares += brightness * brightness;
      count += 1.0;
    }
  }
  const double mean = sum / count;
  return static_cast<float>(std::sqrt(std::max(squares / count - mean * mean, 0.0)) / mean);
}

TEST(ArtworkTest, HasTextureEverywhereForCloseUps) {
  const Scene scene = makeArtwork(coarse(), 3);
  Random random(5);
  for (const Part& part : scene.object) {
    for (const float pixel_m : {0.0003F, 0.0006F, 0.0009F}) {
      float least = 1.0F;
      for (int i = 0; i < 150; ++i) {
        const auto vertex =
            static_cast<std::size_t>(random.uniform() * static_cast<double>(part.vertices.size()));
        least = std::min(least, contrastAt(part, vertex, pixel_m));
      }
      EXPECT_GT(least, 0.1F) << part.name << " at " << pixel_m;
    }
  }
}

TEST(ArtworkTest, ColoursAreReflectances) {
  const Scene scene = makeArtwork(SceneOptions(), 3);
  for (const std::vector<Part>* parts : {&scene.object, &scene.surroundings}) {
    for (const Part& part : *parts) {
      ASSERT_EQ(part.normals.size(), part.vertices.size()) << part.name;
      for (std::size_t i = 0; i < part.vertices.size(); i += 1 + part.vertices.size() / 300) {
        for (const float footprint : {0.0003F, 0.001F, 0.01F, 0.2F}) {
          const Appearance a =
              part.shader({part.vertices[i], part.normals[i], {0.0F, 0.0F}, footprint});
          EXPECT_GE(a.albedo.minCoeff(), 0.0F) << part.name;
          EXPECT_LE(a.albedo.maxCoeff(), 1.0F) << part.name;
          EXPECT_NEAR(a.normal.norm(), 1.0F, 1e-4F) << part.name;
        }
      }
    }
  }
}

TEST(SurroundingsTest, LeaveTheObjectFree) {
  SceneOptions options;
  options.detail_m = 0.01;
  const Scene scene = makeArtwork(options, 3);
  const Eigen::AlignedBox3f above(scene.bounds.min() + Vector3f(0.0F, 0.0F, 0.001F),
                                  scene.bounds.max());
  bool has_hedge = false;
  for (const Part& part : scene.surroundings) {
    has_hedge = has_hedge || part.name == "hedge";
    for (const Vector3f& v : part.vertices) EXPECT_FALSE(above.contains(v)) << part.name;
  }
  EXPECT_TRUE(has_hedge);
  options.background = false;
  EXPECT_LT(makeArtwork(options, 3).surroundings.size(), scene.surroundings.size());
}

TEST(SceneTest, UnknownNameIsRefusedByName) {
  try {
    makeScene("no_such_statue", SceneOptions(), 1);
    FAIL() << "was accepted";
  } catch (const ConfigurationError& error) {
    EXPECT_NE(std::string(error.what()).find("no_such_statue"), std::string::npos);
  }
}

}  // namespace
}  // namespace scanner::simulation
