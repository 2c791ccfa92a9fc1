#include "scanner/surface/surface.h"

#include <chrono>
#include <string>
#include <utility>

namespace scanner::surface {
namespace {

class Stopwatch {
 public:
  /// Seconds since the last call.
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace

Result<Mesh> meshCloud(const PointCloud& fused, const SurfaceOptions& options, int threads,
                       SurfaceStatistics* statistics) {
  SurfaceStatistics local;
  SurfaceStatistics& s = statistics != nullptr ? *statistics : local;
  Stopwatch watch;
  Result<Mesh> pivoted = ballPivot(fused, options.ball_pivot, threads, &s.ball_pivot);
  s.ball_pivot_s = watch.lap();
  if (!pivoted) return pivoted;
  Mesh mesh = clean(std::move(pivoted).value(), options.cleaning, &s.cleaning);
  s.cleaning_s = watch.lap();
  if (mesh.faces.empty()) {
    return Status(StatusCode::kNotEnoughData, "surface: cleaning removed every face");
  }
  if (options.holes.enabled) mesh = fillHoles(std::move(mesh), options.holes, &s.holes);
  s.holes_s = watch.lap();
  mesh = smooth(std::move(mesh), options.smoothing);
  s.smoothing_s = watch.lap();
  s.model = meshStatistics(mesh);
  s.total_s = s.fusion_s + s.ball_pivot_s + s.cleaning_s + s.holes_s + s.smoothing_s + watch.lap();
  return mesh;
}

Result<Mesh> buildSurface(const std::vector<PosedCloud>& views, const SurfaceOptions& options,
                          int threads, SurfaceStatistics* statistics, PointCloud* fused) {
  SurfaceStatistics local;
  SurfaceStatistics& s = statistics != nullptr ? *statistics : local;
  s = SurfaceStatistics{};
  if (views.empty()) return Status(StatusCode::kNotEnoughData, "surface: no views to fuse");
  Stopwatch watch;
  const PointCloud cloud = fuse(views, options.fusion, threads, &s.fusion);
  s.fusion_s = watch.lap();
  if (fused != nullptr) *fused = cloud;
  if (cloud.size() < 3) {
    return Status(StatusCode::kNotEnoughData,
                  "surface: " + std::to_string(cloud.size()) + " points left of " +
                      std::to_string(s.fusion.input_points) + " in " +
                      std::to_string(views.size()) + " views (" +
                      std::to_string(s.fusion.unusable_points) + " unusable, " +
                      std::to_string(s.fusion.unsupported) + " unsupported, " +
                      std::to_string(s.fusion.isolated) + " isolated)");
  }
  return meshCloud(cloud, options, threads, &s);
}

}  // namespace scanner::surface
