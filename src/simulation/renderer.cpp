#include "scanner/simulation/renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "scanner/core/parallel.h"
#include "simulation/embree_scene.h"
#include "simulation/lighting.h"
#include "simulation/ray_table.h"
#include "simulation/sampling.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

constexpr std::size_t kRowsPerTask = 8;
constexpr int kPixelsPerBatch = 64;  ///< so that what belongs to their samples stays in the cache
constexpr int kMostExtraSamples = 8;
constexpr double kReferenceWidth_px = 1024.0;  ///< that the blur is given for

}  // namespace

struct Renderer::Impl {
  Impl(const Scene& scene, const RenderOptions& render_options, int thread_count)
      : light(scene.light), options(render_options), threads(thread_count), embree(scene) {
    if (options.sky_occlusion) sky.emplace(embree, scene.bounds, threads);
  }

  void renderRows(const Frame& frame, const Pattern& pattern, std::size_t begin, std::size_t end,
                  cv::Mat& mean, std::vector<PixelTrace>& traces) const;
  void refineRows(const Frame& frame, const Pattern& pattern, std::size_t begin, std::size_t end,
                  const std::vector<PixelTrace>& traces, cv::Mat& mean) const;
  /// Adds the light of the samples, times `weight`, to their pixels; with `traces`, what they met
  /// as well.
  void resolve(const Frame& frame, const Pattern& pattern, float weight,
               std::vector<Sample>& samples, cv::Mat& mean, std::vector<PixelTrace>* traces) const;
  std::vector<float> sunlight(const Pattern& pattern, const std::vector<Sample>& samples,
                              const std::vector<SurfacePoint>& points) const;
  Vector3f radianceOf(const Frame& frame, const Sample& sample, SurfacePoint& point,
                      float sun) const;

  Daylight light;
  RenderOptions options;
  int threads;
  EmbreeScene embree;
  std::optional<SkyVisibility> sky;
};

std::vector<float> Renderer::Impl::sunlight(const Pattern& pattern,
                                            const std::vector<Sample>& samples,
                                            const std::vector<SurfacePoint>& points) const {
  constexpr float kOffset_m = 2e-4F;
  std::vector<float> sun(samples.size(), 1.0F);
  if (!options.shadows) return sun;
  std::vector<RTCRay> rays;
  std::vector<std::size_t> owners;
  rays.reserve(samples.size());
  owners.reserve(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const RTCHit& hit = samples[i].ray.hit;
    if (hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
    if (points[i].normal.dot(light.to_sun) <= 0.0F) {
      sun[i] = 0.0F;
      continue;
    }
    const Vector3f facet = Vector3f(hit.Ng_x, hit.Ng_y, hit.Ng_z).normalized();
    const Vector3f side = facet.dot(points[i].normal) >= 0.0F ? facet : Vector3f(-facet);
    rays.push_back(makeRay(points[i].position + kOffset_m * side,
                           pattern.to_sun[static_cast<std::size_t>(samples[i].index)]));
    owners.push_back(i);
  }
  if (rays.empty()) return sun;
  embree.occluded(rays);
  for (std::size_t k = 0; k < rays.size(); ++k) sun[owners[k]] = rays[k].tfar < 0.0F ? 0.0F : 1.0F;
  return sun;
}

Vector3f Renderer::Impl::radianceOf(const Frame& frame, const Sample& sample, SurfacePoint& point,
                                    float sun) const {
  const RTCRay& ray = sample.ray.ray;
  const Vector3f direction(ray.dir_x, ray.dir_y, ray.dir_z);
  if (sample.ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return skyRadiance(light, direction);
  constexpr float kGrazing = 0.25F;
  const SurfaceHit hit = embree.hitOf(sample.ray);
  point.footprint_m =
      ray.tfar * frame.pixel_angle / std::sqrt(std::max(kGrazing, -point.normal.dot(direction)));
  const Appearance look = embree.parts()[hit.part].shader(point);
  const float open = sky ? sky->at(hit, point) : 0.5F * (1.0F + point.normal.z());
  return shade(light, look, -direction, sun, open, options.specular);
}

void Renderer::Impl::resolve(const Frame& frame, const Pattern& pattern, float weight,
                             std::vector<Sample>& samples, cv::Mat& mean,
                             std::vector<PixelTrace>* traces) const {
  if (samples.empty()) return;
  embree.intersect(&samples.front().ray, samples.size(), sizeof(Sample));
  std::vector<SurfacePoint> points(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const RTCRay& ray = samples[i].ray.ray;
    if (samples[i].ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
    points[i] = embree.pointAt(embree.hitOf(samples[i].ray));
    const Vector3f direction(ray.dir_x, ray.dir_y, ray.dir_z);
    if (points[i].normal.dot(direction) > 0.0F)
      points[i].normal = -points[i].normal;  // from behind
  }
  const std::vector<float> sun = sunlight(pattern, samples, points);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& sample = samples[i];
    const Vector3f light_in = weight * radianceOf(frame, sample, points[i], sun[i]);
    mean.at<cv::Vec3f>(sample.row, sample.col) +=
        cv::Vec3f(light_in.x(), light_in.y(), light_in.z());
    if (traces == nullptr) continue;
    record(sample, sun[i],
           (*traces)[static_cast<std::size_t>(sample.row) * static_cast<std::size_t>(mean.cols) +
                     static_cast<std::size_t>(sample.col)]);
  }
}

void Renderer::Impl::renderRows(const Frame& frame, const Pattern& pattern, std::size_t begin,
                                std::size_t end, cv::Mat& mean,
                                std::vector<PixelTrace>& traces) const {
  std::vector<Sample> samples;
  for (int row = static_cast<int>(begin); row < static_cast<int>(end); ++row) {
    for (int first = 0; first < mean.cols; first += kPixelsPerBatch) {
      samples.clear();
      const int last = std::min(mean.cols, first + kPixelsPerBatch);
      for (int col = first; col < last; ++col) addSamples(frame, pattern, col, row, samples);
      resolve(frame, pattern, 1.0F / static_cast<float>(pattern.count), samples, mean, &traces);
    }
  }
}

void Renderer::Impl::refineRows(const Frame& frame, const Pattern& pattern, std::size_t begin,
                                std::size_t end, const std::vector<PixelTrace>& traces,
                                cv::Mat& mean) const {
  // The mean of the first samples becomes part of the mean of all.
  const float all = static_cast<float>(options.samples + pattern.count);
  const float kept = static_cast<float>(options.samples) / all;
  std::vector<Sample> samples;
  for (int row = static_cast<int>(begin); row < static_cast<int>(end); ++row) {
    samples.clear();
    for (int col = 0; col < mean.cols; ++col) {
      if (!isEdge(traces, col, row, mean.cols, mean.rows)) continue;
      mean.at<cv::Vec3f>(row, col) *= kept;
      addSamples(frame, pattern, col, row, samples);
    }
    resolve(frame, pattern, 1.0F / all, samples, mean, nullptr);
  }
}

Renderer::Renderer(const Scene& scene, const RenderOptions& options, int threads)
    : impl_(std::make_unique<Impl>(scene, options, threads)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;

cv::Mat Renderer::radiance(const CameraModel& camera,
                           const std::vector<Eigen::Isometry3d>& T_map_camera, int seed) const {
  if (T_map_camera.empty()) throw ConfigurationError("radiance: no pose to render from");
  const Impl& impl = *impl_;
  const RayTable rays(camera, impl.threads);
  const Frame frame{rays, 1.0F / static_cast<float>(camera.K(0, 0)),
                    static_cast<std::uint64_t>(seed)};
  const Vector3f to_sun = impl.light.to_sun.normalized();
  const Pattern first = makePattern(impl.options.samples, 0, T_map_camera, to_sun);
  const Pattern extra = makePattern(std::min(kMostExtraSamples, 2 * impl.options.samples + 2), 1,
                                    T_map_camera, to_sun);
  cv::Mat mean = cv::Mat::zeros(camera.height, camera.width, CV_32FC3);
  std::vector<PixelTrace> traces(mean.total());
  const auto rows = static_cast<std::size_t>(camera.height);
  parallelFor(rows, kRowsPerTask, impl.threads, [&](std::size_t begin, std::size_t end) {
    impl.renderRows(frame, first, begin, end, mean, traces);
  });
  if (impl.options.adaptive) {
    parallelFor(rows, kRowsPerTask, impl.threads, [&](std::size_t begin, std::size_t end) {
      impl.refineRows(frame, extra, begin, end, traces, mean);
    });
  }
  const double blur = impl.options.lens_blur_px * camera.width / kReferenceWidth_px;
  if (blur > 0.0) cv::GaussianBlur(mean, mean, cv::Size(), blur, blur, cv::BORDER_REPLICATE);
  return mean;
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
                  impl_->embree.intersect(rays.data(), rays.size());
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
