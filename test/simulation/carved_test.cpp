// The totem: closed, of the right size, and the case in which registration by shape slides: its
// relief repeats along the vertical while its colours do not.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "scanner/simulation/scene.h"
#include "simulation/carving.h"
#include "simulation/mesh_topology.h"
#include "simulation/totem_shader.h"

namespace scanner::simulation {
namespace {

constexpr double kPi = 3.141592653589793;

Scene coarseTotem(int seed, double detail_m = 0.006) {
  SceneOptions options;
  options.detail_m = detail_m;
  options.background = false;
  return makeTotem(options, seed);
}

/// Rows of samples by angle; each row is a profile along z at equal steps.
using Profiles = std::vector<std::vector<double>>;

/// Correlation of every profile with itself `lag` samples further up, all profiles together. Each
/// profile's own mean over `window` samples is taken off first, so that what is compared is detail.
double autocorrelation(const Profiles& profiles, std::size_t lag, std::size_t window) {
  double aa = 0.0, bb = 0.0, ab = 0.0;
  for (const std::vector<double>& profile : profiles) {
    std::vector<double> detail;
    for (std::size_t i = window; i + window < profile.size(); ++i) {
      double mean = 0.0;
      for (std::size_t k = i - window; k <= i + window; ++k) mean += profile[k];
      detail.push_back(profile[i] - mean / static_cast<double>(2 * window + 1));
    }
    for (std::size_t i = 0; i + lag < detail.size(); ++i) {
      aa += detail[i] * detail[i];
      bb += detail[i + lag] * detail[i + lag];
      ab += detail[i] * detail[i + lag];
    }
  }
  return ab / std::sqrt(aa * bb);
}

/// Radius of the mesh over angle and height, from its vertices.
Profiles radiusProfiles(const Part& pole, double step_m) {
  constexpr std::size_t kAngles = 96;
  const double low = kFootHeight, high = kFootHeight + kTiers * kTierHeight;
  const auto rows = static_cast<std::size_t>(std::lround((high - low) / step_m));
  Profiles sums(kAngles, std::vector<double>(rows, 0.0)), counts = sums;
  for (const Eigen::Vector3f& v : pole.vertices) {
    const double row = (static_cast<double>(v.z()) - low) / step_m;
    const auto r = static_cast<long>(std::floor(row));
    if (r < 0 || r >= static_cast<long>(rows)) continue;
    const double angle = std::atan2(v.y(), v.x()) + kPi;
    const auto a = std::min(static_cast<std::size_t>(angle / (2.0 * kPi) * kAngles), kAngles - 1);
    sums[a][static_cast<std::size_t>(r)] += std::hypot(v.x(), v.y());
    counts[a][static_cast<std::size_t>(r)] += 1.0;
  }
  for (std::size_t a = 0; a < kAngles; ++a) {
    for (std::size_t r = 0; r < rows; ++r) {
      EXPECT_GT(counts[a][r], 0.0);
      sums[a][r] /= counts[a][r];
    }
  }
  return sums;
}

SurfacePoint pointAt(double angle, double z, float footprint_m) {
  const Eigen::Vector3f out(static_cast<float>(std::cos(angle)),
                            static_cast<float>(std::sin(angle)), 0.0F);
  const auto height = static_cast<float>(z);
  const float radius = kTrunkRadius + carvedHeight(locateTile(out.x(), out.y(), height));
  SurfacePoint point;
  point.position = radius * out + height * Eigen::Vector3f::UnitZ();
  point.normal = out;
  point.uv.setZero();
  point.footprint_m = footprint_m;
  return point;
}

Profiles colorProfiles(const Shader& shader, double step_m) {
  Profiles profiles;
  for (double angle = 0.02; angle < 2.0 * kPi; angle += 0.2) {
    profiles.emplace_back();
    for (double z = kFootHeight; z < kFootHeight + kTiers * kTierHeight; z += step_m) {
      const SurfacePoint point = pointAt(angle, z, static_cast<float>(step_m));
      profiles.back().push_back(std::log(static_cast<double>(shader(point).albedo.mean())));
    }
  }
  return profiles;
}

TEST(Totem, IsOneClosedSurface) {
  const Scene scene = coarseTotem(3);
  ASSERT_EQ(scene.object.size(), 1U);
  const Topology topology = topologyOf(scene.object[0]);
  EXPECT_TRUE(topology.closed_manifold);
  EXPECT_EQ(topology.euler, 2);
  EXPECT_NEAR(topology.volume, kPi * 0.275 * 0.275 * 1.91, 0.02);
}

TEST(Totem, HasTheSizeOfTheHalfPole) {
  const Scene scene = coarseTotem(3);
  EXPECT_NEAR(scene.bounds.max().z(), 1.9F, 1e-4F);
  EXPECT_LE(scene.bounds.min().z(), 0.0F);
  EXPECT_GE(scene.bounds.min().z(), -0.02F);
  float deepest = 1.0F, highest = 0.0F;
  for (const Eigen::Vector3f& v : scene.object[0].vertices) {
    if (v.z() < 0.05F || v.z() > 1.88F) continue;
    deepest = std::min(deepest, v.head<2>().norm());
    highest = std::max(highest, v.head<2>().norm());
  }
  EXPECT_GT(deepest, 0.265F);
  EXPECT_LT(highest, 0.300F);
  EXPECT_GT(highest - deepest, 0.012F);  // shallow, but there
  EXPECT_LT(highest - deepest, 0.026F);
}

TEST(Totem, NormalsPointOutwardsAndAreUnit) {
  const Part pole = std::move(coarseTotem(3).object[0]);
  ASSERT_EQ(pole.normals.size(), pole.vertices.size());
  ASSERT_EQ(pole.uvs.size(), pole.vertices.size());
  for (std::size_t i = 0; i < pole.vertices.size(); ++i) {
    ASSERT_NEAR(pole.normals[i].norm(), 1.0F, 1e-4F);
    const Eigen::Vector3f& v = pole.vertices[i];
    if (v.z() > 0.02F && v.z() < 1.87F) {
      ASSERT_GT(pole.normals[i].head<2>().dot(v.head<2>()), 0.0F);
    }
  }
}

TEST(Totem, ReliefRepeatsAlongTheVertical) {
  constexpr double kStep = 0.0125;
  const Profiles relief = radiusProfiles(coarseTotem(3).object[0], kStep);
  // 0.3 m is 24 samples; the window spans a tier, and elsewhere it must not fit.
  EXPECT_GT(autocorrelation(relief, 24, 12), 0.97);
  EXPECT_LT(autocorrelation(relief, 17, 12), 0.5);
}

TEST(Totem, TiersDifferByLessThanHalfAMillimetre) {
  const Scene scene = coarseTotem(3);
  double worst = 0.0, sum = 0.0;
  std::size_t n = 0;
  for (const Eigen::Vector3f& v : scene.object[0].vertices) {
    if (v.z() < 0.0F || v.z() > 1.885F) continue;
    const double r = std::hypot(static_cast<double>(v.x()), static_cast<double>(v.y()));
    const TilePoint tile = locateTile(v.x(), v.y(), v.z());
    const double off = r - static_cast<double>(kTrunkRadius + carvedHeight(tile));
    worst = std::max(worst, std::abs(off));
    sum += off * off;
    ++n;
  }
  EXPECT_LT(worst, 0.0008);  // a vertex on a step of the carving may fall on either side
  EXPECT_LT(std::sqrt(sum / static_cast<double>(n)), 0.0003);
  EXPECT_GT(std::sqrt(sum / static_cast<double>(n)), 0.00003);  // carved by hand, not printed
}

TEST(Totem, ColorsDoNotRepeat) {
  constexpr double kStep = 0.0005;
  const Profiles color = colorProfiles(paintedWood(7), kStep);
  const auto tier = static_cast<std::size_t>(std::lround(kTierHeight / kStep));
  // Detail below a centimetre is what stereo and tracking live on. The edges of the paints follow
  // the carving, so that something remains.
  EXPECT_LT(autocorrelation(color, tier, 10), 0.4);
  EXPECT_LT(autocorrelation(color, tier, 200), 0.5);
}

TEST(Totem, DetailSurvivesCloseUps) {
  const Shader shader = paintedWood(7);
  // Contrast around the trunk (along a stereo camera's rows) within windows of 5 mm, all over.
  int poor = 0, windows = 0;
  for (double angle = 0.0; angle < 2.0 * kPi; angle += 0.23) {
    for (double z = 0.05; z < 1.85; z += 0.061) {
      double sum = 0.0, squares = 0.0;
      constexpr int kSamples = 16;
      for (int i = 0; i < kSamples; ++i) {
        const double at = angle + i * 0.0003 / static_cast<double>(kTrunkRadius);
        const double value = static_cast<double>(shader(pointAt(at, z, 0.0003F)).albedo.mean());
        sum += value;
        squares += value * value;
      }
      const double mean = sum / kSamples;
      const double deviation = std::sqrt(std::max(0.0, squares / kSamples - mean * mean));
      ++windows;
      if (deviation < 0.04 * mean) ++poor;
    }
  }
  EXPECT_LT(poor, windows / 50);
}

TEST(Totem, ColorsFadeIntoTheirMeanInTheDistance) {
  const Shader shader = paintedWood(7);
  double near = 0.0, far = 0.0;
  constexpr int kSamples = 4000;
  for (int i = 0; i < kSamples; ++i) {
    const double angle = 0.0017 * i, z = 0.1 + 0.0004 * i;
    near += static_cast<double>(shader(pointAt(angle, z, 0.0003F)).albedo.mean());
    far += static_cast<double>(shader(pointAt(angle, z, 0.004F)).albedo.mean());
  }
  EXPECT_NEAR(far / near, 1.0, 0.06);
}

TEST(Totem, SameSeedSameScene) {
  const Scene a = coarseTotem(5, 0.01), b = coarseTotem(5, 0.01), c = coarseTotem(6, 0.01);
  EXPECT_EQ(a.object[0].vertices, b.object[0].vertices);
  EXPECT_EQ(a.object[0].normals, b.object[0].normals);
  EXPECT_EQ(a.object[0].faces, b.object[0].faces);
  int different = 0;
  for (int i = 0; i < 200; ++i) {
    const SurfacePoint point = pointAt(0.031 * i, 0.1 + 0.008 * i, 0.0005F);
    const Eigen::Vector3f color = a.object[0].shader(point).albedo;
    EXPECT_EQ(color, b.object[0].shader(point).albedo);
    if ((color - c.object[0].shader(point).albedo).norm() > 0.01F) ++different;
    EXPECT_GE(color.minCoeff(), 0.0F);
    EXPECT_LE(color.maxCoeff(), 1.0F);
  }
  EXPECT_GT(different, 150);
}

}  // namespace
}  // namespace scanner::simulation
