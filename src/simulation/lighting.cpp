#include "simulation/lighting.h"

#include <algorithm>
#include <cmath>

#include "scanner/core/parallel.h"
#include "scanner/simulation/noise.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

constexpr float kPi = 3.14159265F;
constexpr float kOffset_m =
    2e-4F;  ///< rays start off the surface, so that they do not meet it again
/// Parts whose triangles are larger than this have no light per vertex.
constexpr float kFineEdge_m = 0.05F;
constexpr float kGroundCell_m = 0.02F;
constexpr float kGroundMargin_m = 1.2F;
constexpr std::size_t kPointsPerTask = 256;

/// Directions spread evenly over the sphere (Fibonacci lattice). The same ones everywhere, so that
/// the light is smooth from vertex to vertex, and nearby rays run side by side.
std::vector<Vector3f> sphereDirections() {
  constexpr int kCount = 160;
  const float golden = kPi * (3.0F - std::sqrt(5.0F));
  std::vector<Vector3f> directions;
  for (int i = 0; i < kCount; ++i) {
    const float z = 1.0F - (2.0F * static_cast<float>(i) + 1.0F) / kCount;
    const float radius = std::sqrt(1.0F - z * z);
    const float angle = golden * static_cast<float>(i);
    directions.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
  }
  return directions;
}

float visibleSky(const EmbreeScene& scene, const std::vector<Vector3f>& directions,
                 const Vector3f& position, const Vector3f& normal, std::vector<RTCRay>& rays) {
  constexpr float kGrazing = 0.05F;
  rays.clear();
  float all = 0.0F;
  for (const Vector3f& direction : directions) {
    const float cosine = direction.dot(normal);
    if (cosine <= kGrazing) continue;
    all += cosine;
    if (direction.z() > 0.0F) {
      rays.push_back(makeRay(position + kOffset_m * normal, direction));
      rays.back().tnear = 0.0F;
    }
  }
  if (rays.empty()) return 0.0F;
  scene.occluded(rays);
  float seen = 0.0F;
  for (const RTCRay& ray : rays) {
    if (ray.tfar >= 0.0F)
      seen += ray.dir_x * normal.x() + ray.dir_y * normal.y() + ray.dir_z * normal.z();
  }
  return seen / all;
}

bool isFine(const Part& part) {
  double sum = 0.0;
  for (const auto& face : part.faces) {
    sum += static_cast<double>((part.vertices[face[0]] - part.vertices[face[1]]).norm());
  }
  return sum / static_cast<double>(part.faces.size()) < static_cast<double>(kFineEdge_m);
}

float smoothStep(float lo, float hi, float x) {
  const float t = std::clamp((x - lo) / (hi - lo), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

/// Microfacet reflection (Walter et al. 2007, GGX; Schlick's Fresnel) times the cosine of the
/// light.
float gloss(const Appearance& look, const Vector3f& to_eye, const Vector3f& to_light) {
  const Vector3f half = (to_eye + to_light).normalized();
  const float n_h = std::max(0.0F, look.normal.dot(half));
  const float n_l = std::max(0.0F, look.normal.dot(to_light));
  const float n_v = std::max(0.05F, look.normal.dot(to_eye));
  const float alpha = std::max(0.03F, look.roughness * look.roughness);
  const float spread = n_h * n_h * (alpha * alpha - 1.0F) + 1.0F;
  const float facets = alpha * alpha / (kPi * spread * spread);
  const float k = 0.5F * alpha;
  const float shadowing = 1.0F / ((n_l * (1.0F - k) + k) * (n_v * (1.0F - k) + k));
  const float away = 1.0F - std::max(0.0F, half.dot(to_eye));
  const float grazing = (away * away) * (away * away) * away;
  const float fresnel = look.specular + (1.0F - look.specular) * grazing;
  return 0.25F * facets * fresnel * shadowing * n_l;
}

}  // namespace

SkyVisibility::SkyVisibility(const EmbreeScene& scene, const Eigen::AlignedBox3f& object,
                             int threads)
    : scene_(scene), vertices_(scene.parts().size()) {
  const std::vector<Vector3f> directions = sphereDirections();
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const Part& part = scene.parts()[i];
    if (!isFine(part)) continue;
    vertices_[i].resize(part.vertices.size());
    parallelFor(part.vertices.size(), kPointsPerTask, threads,
                [&](std::size_t begin, std::size_t end) {
                  std::vector<RTCRay> rays;
                  for (std::size_t k = begin; k < end; ++k) {
                    vertices_[i][k] =
                        visibleSky(scene, directions, part.vertices[k], part.normals[k], rays);
                  }
                });
  }
  const Eigen::Vector2f size = object.sizes().head<2>().array() + 2.0F * kGroundMargin_m;
  ground_origin_ = object.min().head<2>().array() - kGroundMargin_m;
  ground_cells_ = static_cast<int>(std::ceil(size.maxCoeff() / kGroundCell_m)) + 1;
  ground_.resize(static_cast<std::size_t>(ground_cells_) * static_cast<std::size_t>(ground_cells_));
  parallelFor(ground_.size(), kPointsPerTask, threads, [&](std::size_t begin, std::size_t end) {
    std::vector<RTCRay> rays;
    const auto cells = static_cast<std::size_t>(ground_cells_);
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t column = k % cells, row = k / cells;
      Vector3f place(0.0F, 0.0F, 0.002F);
      place.head<2>() = ground_origin_ + kGroundCell_m * Eigen::Vector2f(static_cast<float>(column),
                                                                         static_cast<float>(row));
      ground_[k] = visibleSky(scene, directions, place, Vector3f::UnitZ(), rays);
    }
  });
}

float SkyVisibility::onGround(const Vector3f& position) const {
  const Eigen::Vector2f cell = (position.head<2>() - ground_origin_) / kGroundCell_m;
  const int x = static_cast<int>(std::floor(cell.x())), y = static_cast<int>(std::floor(cell.y()));
  if (x < 0 || y < 0 || x + 1 >= ground_cells_ || y + 1 >= ground_cells_) return 1.0F;
  const float fx = cell.x() - static_cast<float>(x), fy = cell.y() - static_cast<float>(y);
  const auto value = [&](int column, int row) {
    return ground_[static_cast<std::size_t>(row) * static_cast<std::size_t>(ground_cells_) +
                   static_cast<std::size_t>(column)];
  };
  return (1.0F - fy) * ((1.0F - fx) * value(x, y) + fx * value(x + 1, y)) +
         fy * ((1.0F - fx) * value(x, y + 1) + fx * value(x + 1, y + 1));
}

float SkyVisibility::at(const SurfaceHit& hit, const SurfacePoint& point) const {
  const std::vector<float>& vertices = vertices_[hit.part];
  if (!vertices.empty()) return scene_.interpolate(hit, vertices);
  constexpr float kLevel = 0.9F, kNearGround_m = 0.05F;
  const float open = 0.5F * (1.0F + point.normal.z());
  const bool ground = point.normal.z() > kLevel && std::abs(point.position.z()) < kNearGround_m;
  return ground ? open * onGround(point.position) : open;
}

Vector3f skyRadiance(const Daylight& light, const Vector3f& direction) {
  const float height = std::clamp(direction.z(), 0.0F, 1.0F);
  const float rise = std::sqrt(height);
  Vector3f sky = (1.0F - rise) * light.horizon + rise * light.zenith;
  constexpr float kLowest = 0.02F, kCloudLength = 1.6F, kShortest = 0.1F, kPersistence = 0.55F;
  if (height > kLowest) {
    const Vector3f plane = direction / height;
    const float cloud = fractalNoise({plane.x(), plane.y(), 0.0F}, kCloudLength, kShortest,
                                     kPersistence, 0.0F, 17U);
    const float cover = smoothStep(0.05F, 0.5F, cloud) * smoothStep(kLowest, 0.25F, height);
    sky = (1.0F - 0.7F * cover) * sky + 0.7F * cover * Vector3f(0.95F, 0.95F, 0.96F);
  }
  return sky;
}

Vector3f shade(const Daylight& light, const Appearance& look, const Vector3f& to_eye, float sun,
               float sky, bool specular) {
  // What does not see the sky sees ground and neighbours, which send back some of the day's light.
  constexpr float kReflected = 0.2F;
  const Vector3f bounced = kReflected * (light.sun * std::max(0.0F, light.to_sun.z()) + light.sky);
  const float facing = std::max(0.0F, look.normal.dot(light.to_sun)) * sun;
  const Vector3f irradiance = facing * light.sun + sky * light.sky + (1.0F - sky) * bounced;
  Vector3f radiance = look.albedo.cwiseProduct(irradiance) / kPi;
  if (specular && look.specular > 0.0F) {
    if (facing > 0.0F) radiance += sun * gloss(look, to_eye, light.to_sun) * light.sun;
    radiance += look.specular * sky * light.sky / kPi;
  }
  return radiance;
}

}  // namespace scanner::simulation
