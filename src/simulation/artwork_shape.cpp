#include "simulation/artwork_shape.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scanner/simulation/noise.h"
#include "simulation/solids.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

constexpr float kPi = 3.14159265F;
constexpr float kFillet = 0.007F;  ///< where pieces meet

const Vector3f kPlinthHalf(0.165F, 0.135F, 0.035F);
const Vector3f kEggCenter(-0.025F, 0.0F, 0.205F);
const Vector3f kEggRadii(0.160F, 0.140F, 0.158F);
constexpr float kBumpCell = 0.042F;
constexpr float kBumpHeight = 0.0115F;

const Vector3f kTorsoFoot(-0.01F, 0.0F, 0.30F);
const Vector3f kTorsoTop(0.022F, -0.02F, 0.585F);
constexpr float kTileWidth = 0.034F;
constexpr float kTileHeight = 0.030F;
constexpr float kJointHalf = 0.0042F;
constexpr float kJointDepth = 0.0026F;
constexpr float kTilesRound = 19.0F;

const Vector3f kSlabHalf(0.024F, 0.105F, 0.150F);
const Vector3f kSlabCenter(0.098F, 0.045F, 0.375F);
constexpr float kImpressionDepth = 0.014F;

const Vector3f kCrownCenter(0.022F, -0.02F, 0.640F);

/// A number of [-1, 1) that depends on the seed.
float vary(std::uint32_t seed, int what) { return 2.0F * hashUnit(what, 71, 113, seed) - 1.0F; }

/// 1 near a surface, fading out: displacement is worked out only where it can matter. Slow enough
/// that the highest bumps do not make the fading steep (kSteepest).
float nearness(float distance) { return 1.0F - smoothStep(0.016F, 0.060F, std::abs(distance)); }

Eigen::Isometry3f frameAt(const Vector3f& center, float yaw_deg, float pitch_deg, float roll_deg) {
  constexpr float kRadians = kPi / 180.0F;
  Eigen::Isometry3f T = Eigen::Isometry3f::Identity();
  T.translate(center);
  T.rotate(Eigen::AngleAxisf(yaw_deg * kRadians, Vector3f::UnitZ()));
  T.rotate(Eigen::AngleAxisf(pitch_deg * kRadians, Vector3f::UnitY()));
  T.rotate(Eigen::AngleAxisf(roll_deg * kRadians, Vector3f::UnitX()));
  return T;
}

/// The torso's axis at the height of `p`, and its girth there.
struct Girth {
  float dx, dy;  ///< from the axis
  float rx, ry;  ///< radii of the ellipse
};
Girth girthAt(const Vector3f& p) {
  const float t = (p.z() - kTorsoFoot.z()) / (kTorsoTop.z() - kTorsoFoot.z());
  const float c = std::clamp(t, -0.1F, 1.1F);
  const Vector3f axis = kTorsoFoot + c * (kTorsoTop - kTorsoFoot);
  const float bulge = 1.0F + 0.14F * std::sin(3.0F * c + 0.2F) - 0.20F * c;
  return {p.x() - axis.x(), p.y() - axis.y(), 0.098F * bulge, 0.088F * bulge};
}

}  // namespace

ArtworkShape::ArtworkShape(std::uint32_t seed)
    : seed_(seed),
      T_plinth_map_(frameAt({0.0F, 0.0F, kPlinthHalf.z()}, 11.0F + 4.0F * vary(seed, 1), 0.0F, 0.0F)
                        .inverse()),
      T_slab_map_(
          frameAt(kSlabCenter, 24.0F + 4.0F * vary(seed, 2), 5.0F, 9.0F + 3.0F * vary(seed, 3))
              .inverse()),
      T_crown_map_(
          frameAt(kCrownCenter, 32.0F + 5.0F * vary(seed, 4), 6.0F, -8.0F + 3.0F * vary(seed, 5))
              .inverse()) {}

Eigen::AlignedBox3f ArtworkShape::bounds() const {
  return {Vector3f(-0.235F, -0.235F, 0.0F), Vector3f(0.235F, 0.235F, 0.80F)};
}

float ArtworkShape::plinth(const Vector3f& p) const {
  const float d = boxDistance(T_plinth_map_ * p, kPlinthHalf, 0.008F);
  const float near = nearness(d);
  if (near <= 0.0F) return d;
  const float roughness = fractalNoise(p, 0.060F, 0.010F, 0.55F, 0.0F, seed_ + 10);
  // The underside stays flat: it stands on the ground.
  return std::max(d - 0.007F * near * roughness, -p.z());
}

float ArtworkShape::egg(const Vector3f& p) const {
  const float d = ellipsoidDistance(p - kEggCenter, kEggRadii);
  const float near = nearness(d);
  if (near <= 0.0F) return d;
  const float r = cellularNoise(p, kBumpCell, seed_ + 20).nearest / 0.85F;
  const float bump = r < 1.0F ? (1.0F - r * r) * (1.0F - r * r) : 0.0F;
  const float pitting = gradientNoise(p / 0.011F, seed_ + 21);
  return d - near * (kBumpHeight * bump + 0.0007F * pitting);
}

TilePlace ArtworkShape::tileAt(const Vector3f& p) const {
  const Girth g = girthAt(p);
  const float courses = (p.z() - kTorsoFoot.z()) / kTileHeight;
  TilePlace tile;
  tile.row = static_cast<std::int32_t>(std::floor(courses));
  const float turn = std::atan2(g.dy / g.ry, g.dx / g.rx) / (2.0F * kPi) + 0.5F;
  // Every other course is shifted by half a tile.
  const float columns = turn * kTilesRound + ((tile.row & 1) != 0 ? 0.5F : 0.0F);
  tile.column = static_cast<std::int32_t>(std::floor(columns)) % static_cast<int>(kTilesRound);
  const float width = 2.0F * kPi * 0.5F * (g.rx + g.ry) / kTilesRound;
  tile.across_m = (columns - std::floor(columns) - 0.5F) * width;
  tile.up_m = (courses - static_cast<float>(tile.row) - 0.5F) * kTileHeight;
  tile.joint_m =
      std::min(0.5F * width - std::abs(tile.across_m), 0.5F * kTileHeight - std::abs(tile.up_m));
  return tile;
}

float ArtworkShape::torso(const Vector3f& p) const {
  const Girth g = girthAt(p);
  const float side = ellipsoidDistance({g.dx, g.dy, 0.0F}, {g.rx, g.ry, 1.0F});
  const float middle = 0.5F * (kTorsoFoot.z() + kTorsoTop.z());
  const float half = 0.5F * (kTorsoTop.z() - kTorsoFoot.z());
  const float d = smoothIntersection(side, std::abs(p.z() - middle) - half, 0.03F);
  const float near = nearness(d);
  if (near <= 0.0F) return d;
  const float joint = tileAt(p).joint_m;
  const float groove = joint < kJointHalf ? 0.5F + 0.5F * std::cos(kPi * joint / kJointHalf) : 0.0F;
  return d + near * kJointDepth * groove;
}

/// Tools pressed into both faces of the slab: rings, a bowl, bars, a lattice of studs. `local`: x
/// out of the face, y and z along it.
float ArtworkShape::impressions(const Vector3f& local) const {
  const float front = kSlabHalf.x(), back = -kSlabHalf.x();
  // Swapping axes turns the torus and the cylinders, which stand along z, towards the face.
  const auto facing = [](const Vector3f& q) { return Vector3f(q.y(), q.z(), q.x()); };
  const Vector3f eye = facing(local - Vector3f(front, -0.028F, 0.068F));
  float d = torusDistance(eye, 0.045F, 0.0105F);
  d = std::min(d, (eye - Vector3f(0.0F, 0.0F, 0.012F)).norm() - 0.026F);
  // Bars of unequal length.
  for (int i = 0; i < 4; ++i) {
    const float z = -0.020F - 0.028F * static_cast<float>(i);
    const float end = 0.070F - 0.030F * static_cast<float>((i * 2) % 3);
    d = std::min(d, capsuleDistance(local, {front, -0.075F, z}, {front, end, z + 0.012F}, 0.0085F));
  }
  const Vector3f plug = facing(local - Vector3f(front, 0.065F, 0.105F));
  d = std::min(d, cylinderDistance(plug, 0.020F, kImpressionDepth, 0.002F));
  d = std::min(d, boxDistance(local - Vector3f(front, 0.068F, 0.035F),
                              {kImpressionDepth, 0.017F, 0.024F}, 0.002F));
  // The back: a cross and a row of pits.
  d = std::min(d, capsuleDistance(local, {back, -0.07F, -0.09F}, {back, 0.06F, 0.09F}, 0.010F));
  d = std::min(d, capsuleDistance(local, {back, 0.07F, -0.05F}, {back, -0.05F, 0.07F}, 0.010F));
  for (int i = 0; i < 4; ++i) {
    const Vector3f pit(back - 0.004F, -0.075F + 0.048F * static_cast<float>(i), 0.118F);
    d = std::min(d, (local - pit).norm() - 0.017F);
  }
  return d;
}

float ArtworkShape::slab(const Vector3f& p) const {
  const Vector3f local = T_slab_map_ * p;
  const float board = boxDistance(local, kSlabHalf, 0.005F);
  const float near = nearness(board);
  if (near <= 0.0F && board > 0.0F) return board;
  const float chisel = near > 0.0F ? 0.0006F * near * gradientNoise(p / 0.013F, seed_ + 30) : 0.0F;
  return smoothDifference(board, impressions(local), 0.003F) - chisel;
}

float ArtworkShape::impressionDepth(const Vector3f& p) const {
  const Vector3f local = T_slab_map_ * p;
  return std::clamp(-boxDistance(local, kSlabHalf, 0.005F) / kImpressionDepth, 0.0F, 1.0F);
}

/// A ball grown together with a block, pierced from three sides, with an arc over it and a horn.
float ArtworkShape::crown(const Vector3f& p) const {
  const Vector3f local = T_crown_map_ * p;
  const float away = local.norm() - 0.150F;
  if (away > 0.05F) return away;
  float d = local.norm() - 0.078F;
  const Eigen::AngleAxisf turn(0.6F, Vector3f(1.0F, 0.4F, 0.2F).normalized());
  d = smoothUnion(d,
                  boxDistance(turn * (local - Vector3f(0.0F, 0.02F, -0.012F)),
                              {0.062F, 0.066F, 0.052F}, 0.006F),
                  0.008F);
  const Vector3f along_x(local.y(), local.z() + 0.004F, local.x());
  const Vector3f along_y(local.z() - 0.008F, local.x() - 0.012F, local.y());
  d = smoothDifference(d, cylinderDistance(along_x, 0.030F, 0.2F, 0.004F), 0.004F);
  d = smoothDifference(d, cylinderDistance(along_y, 0.024F, 0.2F, 0.004F), 0.004F);
  d = smoothDifference(d, (local - Vector3f(-0.055F, -0.05F, 0.055F)).norm() - 0.042F, 0.004F);
  d = smoothDifference(
      d, boxDistance(local - Vector3f(0.075F, 0.06F, 0.045F), {0.035F, 0.035F, 0.03F}, 0.003F),
      0.004F);
  const Vector3f arc(local.x(), local.z() - 0.045F, local.y() - 0.004F);
  d = smoothUnion(d, torusDistance(arc, 0.066F, 0.0125F), kFillet);
  d = smoothUnion(d,
                  capsuleDistance(local, {-0.05F, 0.02F, 0.03F}, {-0.095F, 0.055F, 0.085F}, 0.013F),
                  kFillet);
  return smoothUnion(d, (local - Vector3f(-0.095F, 0.055F, 0.085F)).norm() - 0.021F, kFillet);
}

float ArtworkShape::distance(const Vector3f& p) const {
  float d = smoothUnion(plinth(p), egg(p), kFillet);
  d = smoothUnion(d, torso(p), kFillet);
  d = smoothUnion(d, slab(p), 0.5F * kFillet);
  return std::max(smoothUnion(d, crown(p), kFillet), -p.z());
}

ArtworkKind ArtworkShape::kindAt(const Vector3f& p) const {
  const std::array<float, 5> pieces = {plinth(p), egg(p), torso(p), slab(p), crown(p)};
  const auto nearest = std::min_element(pieces.begin(), pieces.end());
  return static_cast<ArtworkKind>(nearest - pieces.begin());
}

}  // namespace scanner::simulation
