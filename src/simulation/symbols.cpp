#include "simulation/symbols.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scanner/simulation/noise.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kLargeCell = 0.020F;  ///< m
constexpr int kSizes = 3;
constexpr float kStroke = 0.068F;  ///< half width of strokes, of the cell
constexpr float kReach = 0.42F;    ///< radius of a symbol, of the cell

float segment(const Vector2f& p, const Vector2f& a, const Vector2f& b) {
  const Vector2f pa = p - a, ba = b - a;
  const float t = std::clamp(pa.dot(ba) / std::max(ba.squaredNorm(), 1e-6F), 0.0F, 1.0F);
  return (pa - t * ba).norm();
}

float box(const Vector2f& p, float half_x, float half_y) {
  return std::max(std::abs(p.x()) - half_x, std::abs(p.y()) - half_y);
}

float triangle(const Vector2f& p, float radius) {
  constexpr float kSin60 = 0.8660254F;
  return std::max(std::abs(p.x()) * kSin60 + 0.5F * p.y(), -p.y()) - 0.5F * radius;
}

/// The random numbers of one symbol.
struct Dice {
  std::int32_t x, y;
  std::uint32_t seed;
  float operator()(int number) const { return hashUnit(x, y, number, seed); }
};

/// Strokes between points of a 3 x 3 raster, as letters have.
float letter(const Vector2f& p, const Dice& dice) {
  const auto point = [&](int number) -> Vector2f {
    const int place = static_cast<int>(dice(number) * 9.0F);
    const int column = place % 3, row = place / 3;
    return Vector2f(static_cast<float>(column - 1), static_cast<float>(row - 1)) * 0.26F;
  };
  float distance = 1.0F;
  Vector2f from = point(20);
  for (int stroke = 0; stroke < 4; ++stroke) {
    const Vector2f to = point(21 + stroke);
    distance = std::min(distance, segment(p, from, to));
    from = to;
  }
  return distance - kStroke;
}

/// Signed distance to a symbol, in cells; p relative to its middle.
float symbol(const Vector2f& p, const Dice& dice) {
  const float radius = p.norm();
  const float r = kReach, tip = kReach - kStroke;
  switch (static_cast<int>(dice(10) * 14.0F)) {
    case 0:  // ring
      return std::abs(radius - r + kStroke) - kStroke;
    case 1:  // disc
      return radius - 0.8F * r;
    case 2:  // cross
      return std::min(box(p, r, kStroke), box(p, kStroke, r));
    case 3:  // bars
      return std::max(std::abs(std::abs(p.x()) - 0.19F) - 0.09F, std::abs(p.y()) - 0.34F);
    case 4:
      return triangle(p, r);
    case 5:  // its outline
      return std::abs(triangle(p, r - kStroke)) - kStroke;
    case 6:  // holed square
      return std::max(box(p, 0.31F, 0.31F), 0.15F - radius);
    case 7:  // crescent
      return std::max(radius - r, 0.33F - (p - Vector2f(0.18F, 0.06F)).norm());
    case 8:  // ring with a dot
      return std::min(std::abs(radius - r + kStroke) - kStroke, radius - 0.15F);
    case 9:  // arrow
      return std::min({segment(p, {0.0F, -tip}, {0.0F, tip}),
                       segment(p, {0.0F, tip}, {-0.2F, 0.1F}),
                       segment(p, {0.0F, tip}, {0.2F, 0.1F})}) -
             kStroke;
    case 10:  // star
      return 0.8F * (radius - r * (0.68F + 0.32F * std::cos(5.0F * std::atan2(p.y(), p.x()))));
    default:
      return letter(p, dice);
  }
}

}  // namespace

float symbolInk(const Vector2f& sheet_m, float footprint_m, std::uint32_t seed, float* tone) {
  float cell = kLargeCell;
  for (int size = 0; size < kSizes; ++size, cell *= 0.5F) {
    const Vector2f q = sheet_m / cell;
    const auto x = static_cast<std::int32_t>(std::floor(q.x()));
    const auto y = static_cast<std::int32_t>(std::floor(q.y()));
    const Dice dice{x, y, seed + 101U * static_cast<std::uint32_t>(size)};
    // A cell holds one symbol or is divided into four.
    if (size + 1 < kSizes && dice(0) < 0.70F) continue;
    const float angle = 6.2831853F * dice(1);
    const Vector2f shift(0.12F * (dice(2) - 0.5F), 0.12F * (dice(3) - 0.5F));
    const Vector2f p =
        q - Vector2f(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F) - shift;
    const float c = std::cos(angle), s = std::sin(angle);
    const float distance = cell * symbol({c * p.x() + s * p.y(), c * p.y() - s * p.x()}, dice);
    const float shade = dice(4);
    *tone = shade < 0.7F ? 0.035F : 0.03F + 0.25F * (shade - 0.7F) / 0.3F;
    const float ink = std::clamp(0.5F - distance / std::max(footprint_m, 0.00008F), 0.0F, 1.0F);
    constexpr float kMeanInk = 0.26F;
    const float blur = std::clamp(footprint_m / (0.5F * cell) - 0.5F, 0.0F, 1.0F);
    return ink + blur * (kMeanInk - ink);
  }
  return 0.0F;
}

Shader printedSymbols(std::uint32_t seed) {
  return [seed](const SurfacePoint& s) {
    float tone = 0.0F;
    const float ink = symbolInk(s.uv, s.footprint_m, seed, &tone);
    const Vector3f sheet(s.uv.x(), s.uv.y(), 0.0F);
    const float grain = fractalNoise(sheet, 0.0024F, 0.0003F, 0.9F, s.footprint_m, seed + 7);
    const float soiled = fractalNoise(sheet, 0.08F, 0.02F, 0.6F, s.footprint_m, seed + 17);
    const float paper = 0.74F * (1.0F + 0.10F * grain) - 0.06F * std::max(0.0F, soiled);
    const float value = paper + ink * (tone * (1.0F + 0.5F * grain) - paper);
    Appearance look;
    look.albedo = value * Vector3f(1.0F, 0.985F, 0.95F);
    look.normal = s.normal;
    look.specular = 0.02F;
    look.roughness = 0.7F;
    return look;
  };
}

}  // namespace scanner::simulation
