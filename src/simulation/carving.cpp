#include "simulation/carving.h"

#include <algorithm>
#include <cmath>

namespace scanner::simulation {
namespace {

constexpr float kPi = 3.14159265F;
constexpr float kSectorAngle = 2.0F * kPi / static_cast<float>(kSectors);
constexpr float kHalfSector = 0.5F * kSectorAngle * kTrunkRadius;
constexpr float kRibAt = 0.186F;  ///< from the middle of the face
constexpr float kRibHalfWidth = 0.007F;
constexpr float kFeatherLength = 0.115F;
constexpr float kFeatherWidth = 0.065F;
constexpr float kFeatherTip = 0.042F;  ///< length of the rounded part

/// std::hypot minds overflow and takes five times as long.
float length(float x, float y) { return std::sqrt(x * x + y * y); }

/// About the distance to an ellipse: exact on it.
float ellipse(float x, float y, float rx, float ry) {
  const float k0 = length(x / rx, y / ry);
  const float k1 = length(x / (rx * rx), y / (ry * ry));
  return k1 > 1e-6F ? k0 * (k0 - 1.0F) / k1 : -std::min(rx, ry);
}

float roundedBox(float x, float y, float half_x, float half_y, float radius) {
  const float qx = std::abs(x) - half_x + radius;
  const float qy = std::abs(y) - half_y + radius;
  return length(std::max(qx, 0.0F), std::max(qy, 0.0F)) + std::min(std::max(qx, qy), 0.0F) - radius;
}

/// 0 outside, rising to 1 at `width` inside: a crisp foot and a rounded top, as a gouge leaves it.
float raised(float line, float width) {
  const float s = std::clamp(-line / width, 0.0F, 1.0F);
  return s * (2.0F - s);
}

/// Likewise, smooth at both ends.
float blended(float line, float width) {
  const float s = std::clamp(0.5F - line / width, 0.0F, 1.0F);
  return s * s * (3.0F - 2.0F * s);
}

float groove(float distance, float half_width) {
  const float s = std::max(0.0F, 1.0F - std::abs(distance) / half_width);
  return s * s * (3.0F - 2.0F * s);
}

float noseProfile(float v) { return std::clamp((0.190F - v) / 0.085F, 0.0F, 1.0F); }

float faceHeight(float u, float v) {
  const FaceLines l = faceLines(u, v);
  const float swell = std::max(0.0F, 1.0F - (u * u) / (kRibAt * kRibAt));
  float h = 0.006F + 0.005F * swell;
  h += 0.005F * raised(l.cheek, 0.030F);
  h -= 0.007F * blended(l.socket, 0.016F);
  h += 0.008F * raised(l.eye, 0.019F);
  h -= 0.0015F * groove(l.eye - 0.006F, 0.004F);
  h -= 0.0012F * groove(l.pupil, 0.0025F);
  h += 0.008F * raised(l.brow, 0.014F);
  h += (0.004F + 0.009F * noseProfile(v)) * raised(l.nose, 0.022F);
  h -= 0.004F * raised(l.nostril, 0.007F);
  h += 0.007F * raised(l.lips, 0.011F);
  h -= 0.008F * blended(l.mouth, 0.006F);
  h += 0.005F * raised(l.tooth, 0.006F);
  return h;
}

float wingHeight(float u, float v) {
  const FeatherLines l = featherLines(u, v);
  // Each feather rises from under the row above it towards its tip.
  float h = 0.004F + 0.007F * std::exp(-l.along / 0.045F) * raised(l.outline, 0.009F);
  const bool split = l.along > 0.018F && l.along < 0.100F;
  h -= 0.0018F * groove(l.quill, 0.0035F) *
       (split ? std::min({1.0F, (l.along - 0.018F) / 0.01F, (0.100F - l.along) / 0.02F}) : 0.0F);
  h -= 0.0010F * groove(l.outline + 0.012F, 0.003F);
  return h;
}

}  // namespace

TilePoint locateTile(float x, float y, float z) {
  TilePoint tile;
  float angle = std::atan2(x, -y);  // zero towards -y
  if (angle < -0.5F * kSectorAngle) angle += 2.0F * kPi;
  tile.sector = std::min(static_cast<int>(std::lround(angle / kSectorAngle)), kSectors - 1);
  tile.u = (angle - static_cast<float>(tile.sector) * kSectorAngle) * kTrunkRadius;
  tile.mirrored = tile.u < 0.0F;
  const float above = z - kFootHeight;
  tile.tier = std::clamp(static_cast<int>(std::floor(above / kTierHeight)), 0, kTiers - 1);
  tile.v = above - static_cast<float>(tile.tier) * kTierHeight;
  return tile;
}

FaceLines faceLines(float u, float v) {
  const float a = std::abs(u);
  FaceLines l{};
  const float bend = v - (0.194F - 2.4F * (a - 0.065F) * (a - 0.065F));
  const float past = std::max({0.026F - a, a - 0.128F, 0.0F});
  l.brow = length(past, bend) - (0.015F - 0.05F * std::abs(a - 0.065F));
  l.socket = ellipse(a - 0.078F, v - 0.146F, 0.056F, 0.031F);
  // The eye's corners are drawn out: the lids are two arcs.
  const float lid = std::abs(a - 0.078F);
  l.eye = std::max(ellipse(a - 0.078F, v - 0.146F, 0.040F, 0.021F), lid - 0.040F);
  l.pupil = length(a - 0.074F, v - 0.147F) - 0.0125F;
  const float half_nose = 0.010F + 0.026F * noseProfile(v);
  l.nose = std::max({a - half_nose, v - 0.192F,
                     length(a, v - 0.128F) - 0.040F - 0.5F * std::max(0.0F, v - 0.128F)});
  l.nostril = ellipse(a - 0.018F, v - 0.104F, 0.009F, 0.006F);
  l.lips = roundedBox(a, v - 0.046F, 0.128F, 0.034F, 0.030F);
  l.mouth = l.lips + 0.013F;
  const float tooth = a - 0.026F * std::floor(a / 0.026F) - 0.013F;
  const float row = std::abs(v - 0.046F) - 0.0105F;
  l.tooth = std::max(roundedBox(tooth, row, 0.0118F, 0.0092F, 0.004F), l.mouth + 0.002F);
  l.cheek = ellipse(a - 0.143F, v - 0.098F, 0.034F, 0.030F);
  return l;
}

FeatherLines featherLines(float u, float v) {
  const float from_middle = kHalfSector - std::abs(u);  // the wing is mirrored about its middle
  FeatherLines l{};
  l.row = static_cast<int>(std::floor(v / kFeatherLength));
  l.along = v - static_cast<float>(l.row) * kFeatherLength;
  for (int below = 0; below < 2; ++below) {
    // Rows are staggered by half a feather.
    const float shifted = from_middle / kFeatherWidth + ((l.row & 1) != 0 ? 0.5F : 0.0F) + 0.5F;
    l.column = static_cast<int>(std::floor(shifted));
    l.across = (shifted - static_cast<float>(l.column) - 0.5F) * kFeatherWidth;
    l.quill = std::abs(l.across);
    const float half = 0.5F * kFeatherWidth;
    l.outline = l.along < kFeatherTip
                    ? ellipse(l.across, l.along - kFeatherTip, half - 0.001F, kFeatherTip - 0.001F)
                    : l.quill - half + 0.001F;
    if (l.outline <= 0.0F || l.along > kFeatherTip) break;
    // In the corner beside a tip the row below is seen, near its root.
    --l.row;
    l.along += kFeatherLength;
  }
  return l;
}

float bandLine(float v) { return v < 0.5F * kFaceHeight ? v : kFaceHeight - v; }

float ribLine(float u) { return std::abs(std::abs(u) - kRibAt) - kRibHalfWidth; }

bool onWing(float u) { return std::abs(u) > kRibAt; }

float carvedHeight(const TilePoint& tile) {
  constexpr float kBandHeight = 0.010F;
  const float band = blended(bandLine(tile.v) - 0.004F, 0.010F);
  if (band >= 1.0F) return kBandHeight;
  const float pattern = onWing(tile.u) ? wingHeight(tile.u, tile.v) : faceHeight(tile.u, tile.v);
  // Both sides meet in the rib's flanks.
  const float rib = blended(ribLine(tile.u), 0.010F);
  const float h = pattern + rib * (0.012F - pattern);
  return h + band * (kBandHeight - h);
}

}  // namespace scanner::simulation
