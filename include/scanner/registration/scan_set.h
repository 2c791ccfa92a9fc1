#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "scanner/core/cloud.h"
#include "scanner/core/status.h"
#include "scanner/registration/global.h"
#include "scanner/registration/options.h"

/// Registration of scans that come in no order, each with an initial pose.
namespace scanner::registration {

struct ScanOutcome {
  bool registered = false;
  std::string reason;                                            ///< empty when registered
  Eigen::Isometry3d T_map_scan = Eigen::Isometry3d::Identity();  ///< the initial pose if not
  std::size_t edges = 0;         ///< verified pairs that it is part of
  double mean_distance_m = 0.0;  ///< mean over these
};

struct ScanSetOutcome {
  std::vector<ScanOutcome> scans;
  std::size_t candidates = 0;
  std::size_t edges = 0;
  PoseGraphSummary graph;
  RefinementOutcome refinement;
  double spacing_m = 0.0;  ///< of the samples matched against
};

/// Options for scans with an initial pose good to some degrees and some per cent of their size;
/// every length derives from the data's own spacing.
RegistrationOptions scanSetOptions();

/// Candidate pairs by overlap at the initial poses, ICP of each pair from its initial relative
/// pose, pose graph, joint refinement. The first usable scan stays at its pose; scans that no
/// verified pair connects to it are reported as not registered, with the reason. Clouds need finite
/// points and normals. kInvalidInput for a size mismatch or a pose that is not finite,
/// kNotEnoughData when no scan has points. Result independent of `threads`.
Result<ScanSetOutcome> registerScans(const std::vector<std::shared_ptr<const View>>& scans,
                                     const std::vector<Eigen::Isometry3d>& T_map_scan,
                                     const RegistrationOptions& options, int threads,
                                     std::uint64_t seed);

/// Poses by file name (without folder).
using NamedPoses = std::map<std::string, Eigen::Isometry3d>;

/// Stanford `.conf`: lines `bmesh FILE tx ty tz qx qy qz qw`, p_ref = R(q)^T p + t. Other lines are
/// skipped. Names file and line of the first thing that is wrong.
Result<NamedPoses> readStanfordConf(const std::string& path);

/// Initial poses for `files`: a `.conf` by file name, else a TUM trajectory whose lines are in the
/// order of the files. kInvalidInput naming the file without a pose, or the two counts.
Result<std::vector<Eigen::Isometry3d>> readPriors(const std::string& path,
                                                  const std::vector<std::string>& files);

/// Every pose but the first turned by `angle_rad` about a random axis through the scan's origin and
/// moved by `distance_m` in a random direction; seeded.
std::vector<Eigen::Isometry3d> disturbed(const std::vector<Eigen::Isometry3d>& poses,
                                         double angle_rad, double distance_m, std::uint64_t seed);

/// Arguments of the command `register_scans`.
struct RegisterScansArguments {
  std::vector<std::string> files;
  std::string prior;
  std::string out;
  std::string config;  ///< YAML with a block `registration`; empty: scanSetOptions()
  int threads = 2;
  std::uint64_t seed = 1;
  double disturb_deg = 0.0;
  double disturb_mm = 0.0;
};

/// Reads, registers and writes OUT/cloud.ply (all registered scans), OUT/scans/NAME.ply (each in
/// the common frame), OUT/poses.tum (registered scans; the stamp is the number of the scan in
/// seconds) and OUT/poses.json (every scan with its status). Scans without normals get them from
/// their neighbours, turned towards +z of the scan, where Stanford's scanner was. Returns the
/// one-line summary. Throws ConfigurationError for a bad configuration.
Result<std::string> runRegisterScans(const RegisterScansArguments& arguments);

}  // namespace scanner::registration
