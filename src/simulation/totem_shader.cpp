#include "simulation/totem_shader.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scanner/simulation/noise.h"
#include "simulation/carving.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

/// Paints of a northern carver, weathered for decades.
enum Paint { kBare, kBlack, kRed, kTeal, kWhite, kYellow };
struct Rgb {
  float r, g, b;
  Vector3f vector() const { return {r, g, b}; }
};
constexpr std::array<Rgb, 6> kPaints = {{{0.30F, 0.24F, 0.17F},
                                         {0.030F, 0.029F, 0.030F},
                                         {0.29F, 0.070F, 0.036F},
                                         {0.055F, 0.19F, 0.18F},
                                         {0.55F, 0.52F, 0.44F},
                                         {0.42F, 0.26F, 0.075F}}};

/// Wood and what is on it: every octave is alike but for the grain, which runs along z.
struct Weather {
  float grain;   ///< fine fibres, about -1..1
  float growth;  ///< broad bands of the wood, about -1..1
  float wear;    ///< patches and flakes, about -1..1
  float mottle;  ///< millimetres: chalking, mould, scratches
  float broad;   ///< decimetres: sun, damp
  float speck;   ///< 0..1: small dark dots
};

/// Dots of dirt and mould: at most one per cell of the unrolled trunk, wholly inside it.
float speckAt(const TilePoint& tile, float z, float footprint, std::uint32_t seed) {
  constexpr float kCell = 0.0049F;
  const float x = (tile.u + static_cast<float>(tile.sector)) / kCell;
  const float y = z / kCell;
  const auto column = static_cast<int>(std::floor(x));
  const auto row = static_cast<int>(std::floor(y));
  if (hashUnit(column, row, 0, seed) > 0.38F) return 0.0F;
  const float size = hashUnit(column, row, 3, seed);
  const float radius = 0.03F + 0.19F * size * size * size * size;  // of the cell
  const float dx = x - static_cast<float>(column) - 0.25F - 0.5F * hashUnit(column, row, 1, seed);
  const float dy = y - static_cast<float>(row) - 0.25F - 0.5F * hashUnit(column, row, 2, seed);
  const float soft = std::max(0.03F, footprint / kCell);
  const float inside = 0.5F + (radius - std::sqrt(dx * dx + dy * dy)) / soft;
  return std::clamp(inside, 0.0F, 1.0F) * std::min(1.0F, 2.0F * radius / soft);
}

Weather weatherAt(const SurfacePoint& s, const TilePoint& tile, std::uint32_t seed) {
  const Vector3f& p = s.position;
  const float f = s.footprint_m;
  Weather w{};
  const Vector3f fibre(p.x(), p.y(), 0.06F * p.z());
  w.grain = fractalNoise(fibre, 0.0048F, 0.0003F, 0.85F, f, seed + 1);
  w.growth = gradientNoise(Vector3f(p.x(), p.y(), 0.04F * p.z()) / 0.024F, seed + 11);
  const Vector3f flake(p.x(), p.y(), 0.45F * p.z());
  w.mottle = fractalNoise(flake, 0.0040F, 0.0005F, 0.9F, f, seed + 31);
  w.wear = 0.65F * fractalNoise(flake, 0.070F, 0.0175F, 0.65F, f, seed + 21) + 0.35F * w.mottle;
  w.broad = fractalNoise(p, 0.42F, 0.21F, 0.6F, f, seed + 41);
  w.speck = speckAt(tile, p.z(), f, seed + 51);
  return w;
}

/// Drying checks: long narrow cracks along the grain, one or none per patch of the unrolled trunk.
/// Returns how dark it is, 0..1.
float crackAt(const TilePoint& tile, float z, float wander, float footprint, std::uint32_t seed) {
  constexpr float kWide = 0.061F, kHigh = 0.33F, kHalf = 0.0012F, kDark = 0.95F;
  const float around = tile.u + static_cast<float>(tile.sector) + 0.007F * wander;
  const int column = static_cast<int>(std::floor(around / kWide));
  // Columns are shifted against each other, so that cracks do not end in rows.
  const float up = z / kHigh + hashUnit(column, 0, 1, seed);
  const int row = static_cast<int>(std::floor(up));
  if (hashUnit(column, row, 2, seed) > 0.55F) return 0.0F;
  const float middle = (0.12F + 0.76F * hashUnit(column, row, 3, seed)) * kWide;
  const float along = 2.0F * (up - static_cast<float>(row)) - 1.0F;  // -1..1
  const float reach = 0.25F + 0.7F * hashUnit(column, row, 4, seed);
  const float taper = 1.0F - (along * along) / (reach * reach);
  if (taper <= 0.0F) return 0.0F;
  const float wide = hashUnit(column, row, 5, seed);
  const float half = (0.15F + 0.85F * wide * wide * wide) * kHalf * taper;
  const float distance = std::abs(around - static_cast<float>(column) * kWide - middle) - half;
  const float soft = std::max(footprint, 0.0002F);
  return kDark * std::clamp(0.5F - distance / soft, 0.0F, 1.0F) *
         std::min(1.0F, 2.0F * half / soft);
}

/// What is painted at a place: layers, the last one on top.
class Coat {
 public:
  Coat(float blur, float wobble) : blur_(blur), wobble_(wobble) {}

  void paint(float line, Paint paint) {
    const float c = std::clamp(0.5F - (line + wobble_) / blur_, 0.0F, 1.0F);
    if (c <= 0.0F) return;
    const float painted = paint == kBare ? 0.0F : 1.0F;
    if (painted > 0.0F) color_ += c * (kPaints[paint].vector() - color_);
    amount_ += c * (painted - amount_);
  }

  const Vector3f& color() const { return color_; }
  float amount() const { return amount_; }

 private:
  float blur_, wobble_;
  Vector3f color_ = kPaints[kBare].vector();
  float amount_ = 0.0F;
};

/// The carver's choice of a paint for a part of a figure: the same for the whole part.
template <std::size_t N>
Paint choose(const std::array<Paint, N>& among, const TilePoint& tile, int part,
             std::uint32_t seed) {
  const float pick = hashUnit(tile.tier, tile.sector, part, seed) * static_cast<float>(N);
  return among[std::min(static_cast<std::size_t>(pick), N - 1)];
}

void paintFace(const TilePoint& tile, std::uint32_t seed, Coat* coat) {
  const FaceLines l = faceLines(tile.u, tile.v);
  const auto pick = [&](auto among, int part) { return choose(among, tile, part, seed); };
  coat->paint(-1.0F, pick(std::array{kBare, kBare, kTeal, kYellow, kRed}, 0));
  coat->paint(l.cheek + 0.004F, pick(std::array{kRed, kBare, kTeal, kBlack}, 1));
  coat->paint(l.socket, pick(std::array{kTeal, kWhite, kBare, kRed, kYellow}, 2));
  coat->paint(l.eye - 0.0045F, kBlack);
  coat->paint(l.eye + 0.001F, pick(std::array{kWhite, kWhite, kYellow}, 3));
  coat->paint(l.pupil, kBlack);
  coat->paint(l.brow, pick(std::array{kBlack, kBlack, kTeal, kRed}, 4));
  coat->paint(l.nose, pick(std::array{kBare, kRed, kTeal, kYellow}, 5));
  coat->paint(l.nostril, kBlack);
  coat->paint(l.lips, pick(std::array{kRed, kRed, kBlack, kTeal}, 6));
  coat->paint(l.mouth, kBlack);
  coat->paint(l.tooth + 0.0015F, pick(std::array{kWhite, kBare, kYellow}, 7));
}

void paintWing(const TilePoint& tile, std::uint32_t seed, Coat* coat) {
  const FeatherLines l = featherLines(tile.u, tile.v);
  // A feather is one object across the wing's middle: the right-hand sector names it.
  const int column = tile.mirrored ? -l.column : l.column;
  const float lot = hashUnit(64 * tile.tier + 8 * tile.sector + l.row, column, 9, seed);
  const auto pick = [&](auto among, int part) { return choose(among, tile, part, seed); };
  const Paint rim = pick(std::array{kBlack, kRed, kTeal}, 10);
  const Paint inner = pick(std::array{kBare, kWhite, kYellow, kRed}, 11);
  coat->paint(-1.0F, rim);
  coat->paint(l.outline + 0.010F, lot < 0.3F ? kBare : inner);
  if (l.along > 0.02F && l.along < 0.10F) coat->paint(l.quill - 0.0022F, kBlack);
  coat->paint(std::abs(l.outline) - 0.0012F, kBlack);
}

void paintFigure(const TilePoint& tile, std::uint32_t seed, Coat* coat) {
  const auto pick = [&](auto among, int part) { return choose(among, tile, part, seed); };
  if (onWing(tile.u)) {
    paintWing(tile, seed, coat);
  } else {
    paintFace(tile, seed, coat);
  }
  coat->paint(ribLine(tile.u), pick(std::array{kBlack, kRed, kBare}, 12));
  coat->paint(bandLine(tile.v) - 0.003F, kBare);
  if (tile.v > 0.0F && tile.v < kTierHeight) {
    const Paint stripe = choose(std::array{kBare, kRed, kBlack, kTeal, kWhite},
                                {tile.tier, 0, 0.0F, 0.0F, false}, 13, seed);
    coat->paint(std::abs(tile.v - 0.265F) - 0.017F, stripe);
  }
}

/// Silvered wood with its fibres, paler where the paint came off late.
Vector3f bareWood(const Weather& w) {
  const Vector3f brown(0.27F, 0.19F, 0.115F), silver(0.37F, 0.345F, 0.305F);
  const float silvered = std::clamp(0.55F + 0.8F * w.broad + 0.4F * w.wear, 0.0F, 1.0F);
  const Vector3f wood = brown + silvered * (silver - brown);
  return wood * std::max(0.18F, 1.0F + w.grain + 0.35F * w.growth + 0.4F * w.mottle);
}

/// Sawn across on top: year rings round a heart off the middle, and checks that open towards the
/// rim.
Vector3f endGrain(const SurfacePoint& s, const Weather& w, std::uint32_t seed) {
  constexpr float kTurn = 6.2831853F, kRing = 0.0036F, kWidest = 0.0022F;
  constexpr int kChecks = 17;
  const float x = s.position.x() - 0.02F, y = s.position.y() + 0.015F;
  const float radius = std::sqrt(x * x + y * y);
  const float phase = (radius + 0.02F * w.broad + 0.001F * w.growth) / kRing;
  const float ring = octaveWeight(kRing, s.footprint_m) * std::sin(kTurn * phase);

  const float slot = (std::atan2(y, x) / kTurn + 0.5F) * static_cast<float>(kChecks);
  const int check = static_cast<int>(slot);
  const float middle = 0.3F + 0.4F * hashUnit(check, 0, 0, seed);
  const float aside = std::abs(slot - static_cast<float>(check) - middle);
  const float off = aside * radius * kTurn / static_cast<float>(kChecks) + 0.001F * w.growth;
  const float start = 0.2F * hashUnit(check, 1, 0, seed);  // m from the heart
  const float half = kWidest * std::clamp((radius - start) / 0.25F, 0.0F, 1.0F);
  const float soft = std::max(s.footprint_m, 0.0003F);
  const float crack =
      std::clamp(0.5F - (off - half) / soft, 0.0F, 1.0F) * std::min(1.0F, 2.0F * half / soft);
  const float detail = 1.0F + 0.16F * ring + 0.5F * w.wear + 0.6F * w.mottle + 0.4F * w.grain;
  return Vector3f(0.29F, 0.26F, 0.22F) * std::max(0.15F, detail) * (1.0F - 0.92F * crack) *
         (1.0F - 0.7F * w.speck);
}

/// Only shaded: the fibres stand out of weathered wood.
Vector3f roughened(const SurfacePoint& s, float depth, std::uint32_t seed) {
  constexpr float kFibre = 0.0022F, kAlong = 0.06F;
  const float fade = octaveWeight(kFibre, s.footprint_m);
  if (fade <= 0.0F) return s.normal;
  const Vector3f& p = s.position;
  Vector3f slope;
  gradientNoise(Vector3f(p.x(), p.y(), kAlong * p.z()) / kFibre, seed + 61, &slope);
  slope.z() *= kAlong;
  slope *= depth * fade;
  slope -= slope.dot(s.normal) * s.normal;
  return (s.normal - slope).normalized();
}

Appearance shade(const SurfacePoint& s, std::uint32_t seed) {
  const Vector3f& p = s.position;
  const TilePoint tile = locateTile(p.x(), p.y(), p.z());
  const Weather w = weatherAt(s, tile, seed);
  Appearance look;
  if (s.normal.z() > 0.8F && p.z() > kPoleHeight - 0.005F) {
    look.albedo = endGrain(s, w, seed).cwiseMax(0.01F);
    look.normal = s.normal;
    return look;
  }
  Coat coat(std::max(s.footprint_m, 0.0007F), 0.0022F * w.wear + 0.0006F * w.grain);
  paintFigure(tile, seed, &coat);

  // Paint stays in the hollows and goes first where the surface stands out or rain splashes up.
  const float standing = std::clamp(s.uv.x() / 0.003F, -1.0F, 1.0F);
  const float splash = std::max(0.0F, 1.0F - p.z() / 0.35F);
  const float hold = 0.17F - 0.09F * standing - 0.35F * splash + 0.35F * w.broad + w.wear -
                     0.35F * std::max(0.0F, w.grain) + 0.15F * w.growth;
  const float flakes = std::clamp(hold / 0.07F + 0.5F, 0.0F, 1.0F) * coat.amount();
  const Vector3f faded =
      coat.color() * std::max(0.2F, 1.0F + 0.5F * w.wear + 0.6F * w.mottle + w.grain) +
      Vector3f::Constant(0.022F + 0.03F * std::max(0.0F, w.broad) +
                         0.05F * std::max(0.0F, w.mottle));
  Vector3f color = bareWood(w);
  color += flakes * (faded - color);

  const float crack = crackAt(tile, p.z(), w.growth + 0.15F * w.grain, s.footprint_m, seed + 71);
  const float grime = std::clamp(-0.55F * standing + 0.3F * w.broad, 0.0F, 0.6F);
  color *= (1.0F - grime) * (1.0F - 0.75F * w.speck) * (1.0F - crack);
  color += 0.6F * splash * (Vector3f(0.17F, 0.14F, 0.10F) - color) *
           std::clamp(0.5F + w.wear, 0.0F, 1.0F);

  look.albedo = color.cwiseMax(0.008F).cwiseMin(0.9F);
  look.normal = roughened(s, 0.16F * (1.0F - 0.65F * flakes), seed);
  look.specular = 0.02F + 0.02F * flakes;
  look.roughness = 0.75F - 0.25F * flakes;
  return look;
}

}  // namespace

Shader paintedWood(std::uint32_t seed) {
  return [seed](const SurfacePoint& point) { return shade(point, seed); };
}

}  // namespace scanner::simulation
