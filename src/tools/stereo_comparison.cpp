#include <cmath>
#include <limits>

#include "tools/stereo_tables.h"

namespace scanner::tools {
namespace {

using evaluation::StereoScene;

/// bad 1.0, what the comparison is about.
constexpr std::size_t kOnePixel = 1;
static_assert(evaluation::kBadThresholds[kOnePixel] == 1.0);

const cv::Mat& regionOf(const StereoScene& scene, std::size_t region) {
  return region == 0 ? scene.nonocc : region == 1 ? scene.all : scene.disc;
}

EqualDensity compare(const StereoScene& scene, std::size_t region, const StereoRun& run,
                     const MethodResult& ours, const MethodResult& other) {
  const evaluation::RegionMeasures& own = ours.regions[region];
  const evaluation::RegionMeasures& rival = other.regions[region];
  EqualDensity out;
  out.ours = ours.method;
  out.other = other.method;
  out.region = region;
  out.ours_density = own.density;
  out.other_density = rival.density;
  out.ours_bad = own.bad_valid[kOnePixel];
  out.other_bad = rival.bad_valid[kOnePixel];
  out.equal_bad =
      evaluation::badShareOfBest(scene.truth, regionOf(scene, region), run.disparity, run.sigma,
                                 rival.valid, evaluation::kBadThresholds[kOnePixel]);
  return out;
}

}  // namespace

SceneResult measureScene(const StereoScene& scene, const std::vector<StereoMethod>& methods,
                         const std::vector<StereoRun>& runs) {
  SceneResult out;
  out.name = scene.name;
  out.group = scene.group;
  out.in_version2_table = scene.in_version2_table;
  out.nonocc_derived = scene.nonocc_derived;
  out.disc_derived = scene.disc_derived;
  out.width = scene.left.cols;
  out.height = scene.left.rows;
  out.min_disparity_px = scene.min_disparity_px;
  out.max_disparity_px = scene.max_disparity_px;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    MethodResult result;
    result.method = methods[m].name;
    result.seconds = runs[m].seconds;
    result.million_per_second = runs[m].million_per_second;
    for (std::size_t r = 0; r < kRegions.size(); ++r) {
      result.regions[r] = evaluation::measureDisparity(scene.truth, regionOf(scene, r),
                                                       runs[m].disparity, runs[m].filled);
    }
    out.methods.push_back(std::move(result));
  }
  for (std::size_t i = 0; i < methods.size(); ++i) {
    for (std::size_t k = 0; k < methods.size(); ++k) {
      if (!methods[i].ours || methods[k].ours || methods[i].block != methods[k].block) continue;
      for (const std::size_t region : {std::size_t{0}, std::size_t{1}}) {
        out.comparisons.push_back(compare(scene, region, runs[i], out.methods[i], out.methods[k]));
      }
    }
  }
  return out;
}

}  // namespace scanner::tools
