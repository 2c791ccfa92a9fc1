#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "scanner/evaluation/stereo_evaluation.h"
#include "tools/stereo_methods.h"

/// What evaluate_stereo found, as text and JSON.
namespace scanner::tools {

constexpr std::array<const char*, 3> kRegions{"nonocc", "all", "disc"};
using Regions = std::array<evaluation::RegionMeasures, kRegions.size()>;

struct MethodResult {
  std::string method;
  Regions regions;
  double seconds = 0.0;
  double million_per_second = 0.0;
};

/// One of ours beside one of OpenCV's on one scene, bad pixels at 1 px: among the valid ones.
struct EqualDensity {
  std::string ours, other;
  std::size_t region = 0;  ///< of kRegions
  double ours_density = 0.0;
  double other_density = 0.0;
  double ours_bad = 0.0;   ///< of all that ours keeps
  double equal_bad = 0.0;  ///< of as many as the other keeps, those of smallest sigma; NaN: fewer
  double other_bad = 0.0;

  bool comparable() const { return equal_bad == equal_bad; }
  bool better() const { return equal_bad < other_bad; }
};

struct SceneResult {
  std::string name, group;
  bool in_version2_table = false;
  bool nonocc_derived = false, disc_derived = false;
  int width = 0, height = 0, min_disparity_px = 0, max_disparity_px = 0;
  std::vector<MethodResult> methods;
  std::vector<EqualDensity> comparisons;
};

/// Measures the runs of one scene (in the order of `methods`) and compares them.
SceneResult measureScene(const evaluation::StereoScene& scene,
                         const std::vector<StereoMethod>& methods,
                         const std::vector<StereoRun>& runs);

/// One row per method; `full`: one per method and region, with every threshold.
std::string sceneTable(const SceneResult& scene, bool full);
/// Averages over the folders and over all, the four scenes of version 2 of the table on their own.
std::string averageTables(const std::vector<SceneResult>& scenes);
/// The comparison at equal density, scene by scene, and on how many of them ours is better.
std::string comparisonTables(const std::vector<SceneResult>& scenes);

nlohmann::json toJson(const std::vector<SceneResult>& scenes);

}  // namespace scanner::tools
