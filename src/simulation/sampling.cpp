#include "simulation/sampling.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "scanner/core/se3.h"
#include "scanner/simulation/random.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

constexpr float kSunRadius = 0.0047F;  ///< rad, so that shadows have soft edges

/// Places of the samples in a pixel: an n-rooks pattern that a lattice scatters (the rotated grid
/// for four), symmetric about the centre of the pixel in every size, turned by quarters from pixel
/// to pixel. A mean off the centre would shift the picture.
Eigen::Vector2f samplePlace(int sample, int count, unsigned turn) {
  constexpr double kGoldenShare = 0.618;
  const float step = 1.0F / static_cast<float>(count);
  const auto centred = [&](int i) { return (static_cast<float>(i) + 0.5F) * step - 0.5F; };
  int stride = static_cast<int>(std::lround(kGoldenShare * (count + 1)));
  while (std::gcd(stride, count + 1) != 1) ++stride;
  const Eigen::Vector2f place(centred(sample), centred((sample + 1) * stride % (count + 1) - 1));
  switch (turn % 4) {
    case 0:
      return place;
    case 1:
      return {-place.y(), place.x()};
    case 2:
      return -place;
    default:
      return {place.y(), -place.x()};
  }
}

/// Pose at a share of the exposure, 0..1, of which `poses` are at the middles of equal parts. With
/// one sample this is the exact middle of the exposure.
Eigen::Isometry3f poseAt(const std::vector<Eigen::Isometry3d>& poses, double share) {
  const auto last = static_cast<double>(poses.size() - 1);
  const double place = std::clamp(share * static_cast<double>(poses.size()) - 0.5, 0.0, last);
  const auto before = static_cast<std::size_t>(place);
  const std::size_t after = std::min(before + 1, poses.size() - 1);
  const double rest = place - static_cast<double>(before);
  if (rest == 0.0) return poses[before].cast<float>();
  return interpolate(poses[before], poses[after], rest).cast<float>();
}

std::uint64_t pixelHash(const Frame& frame, int col, int row) {
  return mixSeed(frame.seed,
                 static_cast<std::uint64_t>(row) * 65536U + static_cast<std::uint64_t>(col));
}

}  // namespace

Pattern makePattern(int count, unsigned salt, const std::vector<Eigen::Isometry3d>& poses,
                    const Vector3f& to_sun) {
  // The same places on the sun for every pixel (a sunflower's): its shadows then stay where they
  // are in the world for both eyes and all views, without noise.
  constexpr float kGolden = 2.3999632F;
  const Vector3f across = to_sun.unitOrthogonal();
  const Vector3f along = to_sun.cross(across);
  Pattern pattern;
  pattern.count = count;
  pattern.salt = salt;
  for (int i = 0; i < count; ++i) {
    const float share = (static_cast<float>(i) + 0.5F) / static_cast<float>(count);
    pattern.T_map_camera.push_back(poseAt(poses, static_cast<double>(share)));
    const float radius = count == 1 ? 0.0F : kSunRadius * std::sqrt(share);
    const float angle = kGolden * static_cast<float>(i) + static_cast<float>(salt);
    pattern.to_sun.push_back(
        (to_sun + radius * (std::cos(angle) * across + std::sin(angle) * along)).normalized());
  }
  return pattern;
}

void addSamples(const Frame& frame, const Pattern& pattern, int col, int row,
                std::vector<Sample>& samples) {
  const std::uint64_t bits = pixelHash(frame, col, row);
  const unsigned turn = static_cast<unsigned>(bits >> 7U) + pattern.salt;
  // Which part of the exposure a place in the pixel gets is shuffled, or motion in the direction of
  // the pattern would be blurred less than motion against it.
  const int first_pose = static_cast<int>((bits >> 11U) % static_cast<unsigned>(pattern.count));
  for (int i = 0; i < pattern.count; ++i) {
    const Eigen::Vector2f place = samplePlace(i, pattern.count, turn);
    const Eigen::Isometry3f& T_map_camera =
        pattern.T_map_camera[static_cast<std::size_t>((i + first_pose) % pattern.count)];
    const Vector3f direction =
        T_map_camera.linear() * frame.rays.direction(col, row, place.x(), place.y()).normalized();
    samples.push_back({col, row, i, makeRayHit(T_map_camera.translation(), direction)});
  }
}

void record(const Sample& sample, float sun, PixelTrace& trace) {
  const bool met = sample.ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  const int part = met ? static_cast<int>(sample.ray.hit.geomID) : kSkyPart;
  trace.part = trace.samples == 0 || trace.part == part ? part : kMixedParts;
  ++trace.samples;
  const float share = 1.0F / static_cast<float>(trace.samples);
  const float inverse_depth = met ? 1.0F / sample.ray.ray.tfar : 0.0F;
  trace.inverse_depth += share * (inverse_depth - trace.inverse_depth);
  trace.sun += share * (sun - trace.sun);
}

bool isEdge(const std::vector<PixelTrace>& traces, int col, int row, int width, int height) {
  const auto at = [&](int c, int r) -> const PixelTrace& {
    return traces[static_cast<std::size_t>(r) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(c)];
  };
  constexpr float kShadowStep = 0.2F, kDepthStep = 0.01F;
  const PixelTrace& here = at(col, row);
  if (here.part == kMixedParts || (here.sun > 0.0F && here.sun < 1.0F)) return true;
  for (const auto& [dc, dr] : {std::pair{1, 0}, std::pair{0, 1}}) {
    if (col < dc || row < dr || col + dc >= width || row + dr >= height) continue;
    const PixelTrace& before = at(col - dc, row - dr);
    const PixelTrace& after = at(col + dc, row + dr);
    if (before.part != here.part || after.part != here.part) return true;
    if (std::abs(before.sun - here.sun) > kShadowStep ||
        std::abs(after.sun - here.sun) > kShadowStep) {
      return true;
    }
    // The inverse depth of a plane is linear in the picture, so a slope is no edge.
    const float bend = before.inverse_depth + after.inverse_depth - 2.0F * here.inverse_depth;
    if (std::abs(bend) > kDepthStep * here.inverse_depth) return true;
  }
  return false;
}

}  // namespace scanner::simulation
