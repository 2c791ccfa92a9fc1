#include "scanner/simulation/renderer.h"

#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "scanner/core/parallel.h"
#include "scanner/simulation/random.h"
#include "simulation/embree_scene.h"
#include "simulation/lighting.h"
#include "simulation/ray_table.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

constexpr std::size_t kRowsPerTask = 8;
constexpr int kExtraSamples = 8;
constexpr float kSunRadius = 0.0047F;  ///< rad, so that shadows have soft edges
constexpr std::uint8_t kSkyPart = 255;
constexpr double kReferenceWidth_px = 1024.0;  ///< that the blur is given for

/// Places of the samples in a pixel: an n-rooks pattern, whose mean is the centre of the pixel in
/// every size, turned by a quarter from pixel to pixel. A bias of the mean would shift the picture.
Eigen::Vector2f samplePlace(int sample, int count, unsigned turn) {
  const float step = 1.0F / static_cast<float>(count);
  const auto centred = [&](int i) { return (static_cast<float>(i) + 0.5F) * step - 0.5F; };
  // A stride without common divisor with the count scatters the rows.
  int stride = 1;
  for (const int candidate : {3, 5, 7, 2}) {
    if (count > candidate && count % candidate != 0) {
      stride = candidate;
      break;
    }
  }
  const Eigen::Vector2f place(centred(sample), centred((sample * stride + stride / 2) % count));
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

/// What is remembered of the first samples of a pixel, to find edges.
struct PixelTrace {
  std::uint8_t part = kSkyPart;
  float inverse_depth = 0.0F;
  float shadow = 0.0F;
};

struct Sample {
  int col = 0;
  int row = 0;
  RTCRayHit ray;
};

struct Frame {
  const RayTable& rays;
  const std::vector<Eigen::Isometry3f>& poses;  ///< T_map_camera
  float pixel_angle;                            ///< rad
  std::uint64_t seed;
};

}  // namespace

struct Renderer::Impl {
  Impl(const Scene& scene, const RenderOptions& render_options, int thread_count)
      : light(scene.light), options(render_options), threads(thread_count), embree(scene) {
    if (options.sky_occlusion) sky.emplace(embree, scene.bounds, threads);
  }

  void renderRows(const Frame& frame, std::size_t begin, std::size_t end, cv::Mat& sum,
                  cv::Mat& weight, std::vector<PixelTrace>& traces) const;
  void refineRows(const Frame& frame, std::size_t begin, std::size_t end,
                  const std::vector<PixelTrace>& traces, cv::Mat& sum, cv::Mat& weight) const;
  void addSamples(const Frame& frame, int col, int row, int count, int salt,
                  std::vector<Sample>& samples) const;
  /// Adds the light of the samples to their pixels; with `traces`, what they met as well.
  void resolve(const Frame& frame, std::vector<Sample>& samples, cv::Mat& sum, cv::Mat& weight,
               std::vector<PixelTrace>* traces) const;
  std::vector<float> sunlight(const Frame& frame, const std::vector<Sample>& samples,
                              const std::vector<SurfacePoint>& points) const;

  Daylight light;
  RenderOptions options;
  int threads;
  EmbreeScene embree;
  std::optional<SkyVisibility> sky;
};

namespace {

std::uint64_t pixelHash(const Frame& frame, int col, int row) {
  return mixSeed(frame.seed,
                 static_cast<std::uint64_t>(row) * 65536U + static_cast<std::uint64_t>(col));
}

bool isEdge(const std::vector<PixelTrace>& traces, int col, int row, int width, int height) {
  const auto at = [&](int c, int r) -> const PixelTrace& {
    return traces[static_cast<std::size_t>(r) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(c)];
  };
  constexpr float kShadowStep = 0.2F, kDepthStep = 0.01F;
  const PixelTrace& here = at(col, row);
  for (const auto& [dc, dr] : {std::pair{1, 0}, std::pair{0, 1}}) {
    if (col < dc || row < dr || col + dc >= width || row + dr >= height) continue;
    const PixelTrace& before = at(col - dc, row - dr);
    const PixelTrace& after = at(col + dc, row + dr);
    if (before.part != here.part || after.part != here.part) return true;
    if (std::abs(before.shadow - here.shadow) > kShadowStep ||
        std::abs(after.shadow - here.shadow) > kShadowStep) {
      return true;
    }
    // The inverse depth of a plane is linear in the picture, so a slope is no edge.
    const float bend = before.inverse_depth + after.inverse_depth - 2.0F * here.inverse_depth;
    if (std::abs(bend) > kDepthStep * here.inverse_depth) return true;
  }
  return false;
}

}  // namespace

void Renderer::Impl::addSamples(const Frame& frame, int col, int row, int count, int salt,
                                std::vector<Sample>& samples) const {
  const auto turn =
      static_cast<unsigned>((pixelHash(frame, col, row) >> 7U) + static_cast<unsigned>(salt));
  const int poses = static_cast<int>(frame.poses.size());
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2f place = samplePlace(i, count, turn);
    // The samples of a pixel share out the poses of the exposure.
    const int pose = std::min(poses - 1, (2 * i + 1) * poses / (2 * count));
    const Eigen::Isometry3f& T_map_camera = frame.poses[static_cast<std::size_t>(pose)];
    const Vector3f direction =
        T_map_camera.linear() * frame.rays.direction(col, row, place.x(), place.y()).normalized();
    samples.push_back({col, row, makeRayHit(T_map_camera.translation(), direction)});
  }
}

std::vector<float> Renderer::Impl::sunlight(const Frame& frame, const std::vector<Sample>& samples,
                                            const std::vector<SurfacePoint>& points) const {
  constexpr float kOffset_m = 2e-4F;
  std::vector<float> sun(samples.size(), 1.0F);
  if (!options.shadows) return sun;
  const Vector3f& to_sun = light.to_sun;
  const Vector3f across = to_sun.unitOrthogonal();
  const Vector3f along = to_sun.cross(across);
  std::vector<RTCRay> rays;
  std::vector<std::size_t> owners;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const RTCHit& hit = samples[i].ray.hit;
    if (hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
    const Vector3f facet = Vector3f(hit.Ng_x, hit.Ng_y, hit.Ng_z).normalized();
    if (points[i].normal.dot(to_sun) <= 0.0F) {
      sun[i] = 0.0F;
      continue;
    }
    const std::uint64_t bits = mixSeed(pixelHash(frame, samples[i].col, samples[i].row), i);
    const float radius = kSunRadius * std::sqrt(static_cast<float>(bits >> 40U) * 0x1.0p-24F);
    const float angle = static_cast<float>(bits & 0xffffffU) * (0x1.0p-24F * 6.2831853F);
    const Vector3f direction =
        (to_sun + radius * (std::cos(angle) * across + std::sin(angle) * along)).normalized();
    const Vector3f side = facet.dot(points[i].normal) >= 0.0F ? facet : Vector3f(-facet);
    rays.push_back(makeRay(points[i].position + kOffset_m * side, direction));
    owners.push_back(i);
  }
  if (rays.empty()) return sun;
  embree.occluded(rays);
  for (std::size_t k = 0; k < rays.size(); ++k) sun[owners[k]] = rays[k].tfar < 0.0F ? 0.0F : 1.0F;
  return sun;
}

void Renderer::Impl::resolve(const Frame& frame, std::vector<Sample>& samples, cv::Mat& sum,
                             cv::Mat& weight, std::vector<PixelTrace>* traces) const {
  if (samples.empty()) return;
  std::vector<RTCRayHit> rays;
  rays.reserve(samples.size());
  for (const Sample& sample : samples) rays.push_back(sample.ray);
  embree.intersect(rays);
  std::vector<SurfacePoint> points(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].ray = rays[i];
    if (rays[i].hit.geomID != RTC_INVALID_GEOMETRY_ID)
      points[i] = embree.pointAt(embree.hitOf(rays[i]));
  }
  const std::vector<float> sun = sunlight(frame, samples, points);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& sample = samples[i];
    const RTCRay& ray = sample.ray.ray;
    const Vector3f direction(ray.dir_x, ray.dir_y, ray.dir_z);
    const bool met = sample.ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    Vector3f radiance;
    if (met) {
      const SurfaceHit hit = embree.hitOf(sample.ray);
      SurfacePoint& point = points[i];
      if (point.normal.dot(direction) > 0.0F) point.normal = -point.normal;  // seen from behind
      constexpr float kGrazing = 0.25F;
      point.footprint_m =
          ray.tfar * frame.pixel_angle / std::sqrt(std::max(kGrazing, -point.normal.dot(direction)));
      const Appearance look = embree.parts()[hit.part].shader(point);
      const float open = sky ? sky->at(hit, point) : 0.5F * (1.0F + point.normal.z());
      radiance = shade(light, look, -direction, sun[i], open, options.specular);
    } else {
      radiance = skyRadiance(light, direction);
    }
    sum.at<cv::Vec3f>(sample.row, sample.col) +=
        cv::Vec3f(radiance.x(), radiance.y(), radiance.z());
    weight.at<float>(sample.row, sample.col) += 1.0F;
    if (traces == nullptr) continue;
    PixelTrace& trace =
        (*traces)[static_cast<std::size_t>(sample.row) * static_cast<std::size_t>(sum.cols) +
                  static_cast<std::size_t>(sample.col)];
    trace.part = met ? static_cast<std::uint8_t>(sample.ray.hit.geomID % kSkyPart) : kSkyPart;
    trace.inverse_depth = met ? 1.0F / ray.tfar : 0.0F;
    trace.shadow += sun[i] / static_cast<float>(options.samples);
  }
}

void Renderer::Impl::renderRows(const Frame& frame, std::size_t begin, std::size_t end,
                                cv::Mat& sum, cv::Mat& weight,
                                std::vector<PixelTrace>& traces) const {
  std::vector<Sample> samples;
  for (std::size_t row = begin; row < end; ++row) {
    samples.clear();
    for (int col = 0; col < sum.cols; ++col) {
      addSamples(frame, col, static_cast<int>(row), options.samples, 0, samples);
    }
    resolve(frame, samples, sum, weight, &traces);
  }
}

void Renderer::Impl::refineRows(const Frame& frame, std::size_t begin, std::size_t end,
                                const std::vector<PixelTrace>& traces, cv::Mat& sum,
                                cv::Mat& weight) const {
  std::vector<Sample> samples;
  for (std::size_t row = begin; row < end; ++row) {
    samples.clear();
    for (int col = 0; col < sum.cols; ++col) {
      const int r = static_cast<int>(row);
      if (isEdge(traces, col, r, sum.cols, sum.rows)) {
        addSamples(frame, col, r, kExtraSamples, 1, samples);
      }
    }
    resolve(frame, samples, sum, weight, nullptr);
  }
}

Renderer::Renderer(const Scene& scene, const RenderOptions& options, int threads)
    : impl_(std::make_unique<Impl>(scene, options, threads)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;

cv::Mat Renderer::radiance(const CameraModel& camera,
                           const std::vector<Eigen::Isometry3d>& T_map_camera, int seed) const {
  if (T_map_camera.empty()) throw ConfigurationError("radiance: no pose to render from");
  const RayTable rays(camera);
  std::vector<Eigen::Isometry3f> poses;
  for (const Eigen::Isometry3d& pose : T_map_camera) poses.push_back(pose.cast<float>());
  const Frame frame{rays, poses, 1.0F / static_cast<float>(camera.K(0, 0)),
                    static_cast<std::uint64_t>(seed)};
  cv::Mat sum = cv::Mat::zeros(camera.height, camera.width, CV_32FC3);
  cv::Mat weight = cv::Mat::zeros(camera.height, camera.width, CV_32FC1);
  std::vector<PixelTrace> traces(sum.total());
  const auto rows = static_cast<std::size_t>(camera.height);
  parallelFor(rows, kRowsPerTask, impl_->threads, [&](std::size_t begin, std::size_t end) {
    impl_->renderRows(frame, begin, end, sum, weight, traces);
  });
  if (impl_->options.adaptive) {
    parallelFor(rows, kRowsPerTask, impl_->threads, [&](std::size_t begin, std::size_t end) {
      impl_->refineRows(frame, begin, end, traces, sum, weight);
    });
  }
  for (int row = 0; row < sum.rows; ++row) {
    for (int col = 0; col < sum.cols; ++col) {
      sum.at<cv::Vec3f>(row, col) /= weight.at<float>(row, col);
    }
  }
  const double blur = impl_->options.lens_blur_px * camera.width / kReferenceWidth_px;
  if (blur > 0.0) cv::GaussianBlur(sum, sum, cv::Size(), blur, blur, cv::BORDER_REPLICATE);
  return sum;
}

cv::Mat Renderer::rectifiedDepth(const CameraModel& camera, const Eigen::Isometry3d& T_map_camera,
                                 bool object_only) const {
  const Eigen::Matrix3d R_map_rectified = T_map_camera.linear() * camera.R.transpose();
  const Vector3f origin = T_map_camera.translation().cast<float>();
  cv::Mat depth(camera.height, camera.width, CV_32FC1);
  parallelFor(static_cast<std::size_t>(camera.height), kRowsPerTask, impl_->threads,
              [&](std::size_t begin, std::size_t end) {
                for (std::size_t row = begin; row < end; ++row) {
                  std::vector<RTCRayHit> rays;
                  std::vector<float> forward;
                  for (int col = 0; col < camera.width; ++col) {
                    const Eigen::Vector3d ray(
                        (col - camera.P(0, 2)) / camera.P(0, 0),
                        (static_cast<double>(row) - camera.P(1, 2)) / camera.P(1, 1), 1.0);
                    forward.push_back(static_cast<float>(1.0 / ray.norm()));
                    const Eigen::Vector3d direction = R_map_rectified * ray.normalized();
                    rays.push_back(makeRayHit(origin, direction.cast<float>()));
                  }
                  impl_->embree.intersect(rays);
                  auto* out = depth.ptr<float>(static_cast<int>(row));
                  for (std::size_t col = 0; col < rays.size(); ++col) {
                    const bool met =
                        rays[col].hit.geomID != RTC_INVALID_GEOMETRY_ID &&
                        (!object_only || rays[col].hit.geomID < impl_->embree.objectParts());
                    out[col] = met ? rays[col].ray.tfar * forward[col]
                                   : std::numeric_limits<float>::quiet_NaN();
                  }
                }
              });
  return depth;
}

}  // namespace scanner::simulation
