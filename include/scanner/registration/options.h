#pragma once

#include "scanner/core/options.h"

/// Options of the registration stage. Every default is the published value where the thesis gives
/// one (table 4.1, sections 4.5 and 4.6); options past the thesis default to off, or to what
/// changes nothing in the published method, so that an empty block is the published method.
namespace scanner::registration {

enum class SamplingMethod { kNormalSpace, kUniform, kVoxel };

/// How a view is thinned for registration (thesis 4.5, tables 4.1 and 4.2).
struct SamplingOptions {
  SamplingMethod moving_method = SamplingMethod::kNormalSpace;
  SamplingMethod reference_method = SamplingMethod::kNormalSpace;
  double moving_factor = 100.0;     ///< points per sample of the side that is moved
  double reference_factor = 100.0;  ///< points per sample of the side that is matched against
  int min_samples = 500;            ///< never fewer than this, as far as the view has points
  double bucket_deg = 5.0;          ///< side of a bucket in spherical angles
  double voxel_m = 0.01;            ///< side of a voxel, for the voxel method only
};

enum class Compatibility { kPlainAngle, kPrintedFormula };

/// Closest compatible point and rejection (thesis 4.5, eq. 4.10, table 4.3).
struct CorrespondenceOptions {
  double compatible_angle_deg = 30.0;
  Compatibility compatibility = Compatibility::kPlainAngle;
  double max_distance_m = 0.0;    ///< 0: no bound
  double rejection_factor = 2.0;  ///< pairs beyond this many median distances go; 0: keep all
};

enum class Metric { kPointToPoint, kPointToPlane };
enum class StopRule { kAtThreshold, kAtConvergence };
enum class RobustKernel { kNone, kHuber, kTukey };

struct IcpOptions {
  Metric metric = Metric::kPointToPoint;
  StopRule stop = StopRule::kAtThreshold;
  int max_iterations = 10;
  double accept_mean_m = 0.003;     ///< 0: from the spacing of the reference and its noise
  double accept_plane_m = 0.0;      ///< mean distance to the tangent planes; 0: not checked
  double min_overlap = 0.0;         ///< share of moving samples that must lie on the reference
  double overlap_distance_m = 0.0;  ///< "on": nearer than this; 0: twice the acceptance threshold
  double max_rotation_deg = 0.0;    ///< deviation from the prior; 0: not checked
  double max_translation_m =
      0.0;  ///< deviation from the prior, at the data's centre; 0: not checked
  double converged_translation_m = 1e-5;
  double converged_rotation_deg = 1e-3;
  double distance_start_m = 0.0;  ///< bound on pair distances at the first iteration; 0: none
  double distance_floor_m = 0.0;  ///< the bound shrinks to this; 0: three reference spacings
  double distance_decay = 0.7;    ///< factor per iteration
  bool sigma_weights = false;     ///< weight pairs by the variance of their depths
  RobustKernel kernel = RobustKernel::kNone;
  double kernel_scale = 3.0;        ///< in robust standard deviations of the residuals
  double degenerate_below = 0.005;  ///< eigenvalue per pair (0..1) under which a direction is free
};

struct TrialOptions {
  bool translational = true;  ///< steps 1, 3 and 5
  bool median_starts = true;  ///< steps 3 to 6
  bool resample = true;       ///< step 7
  /// Thesis 4.6 discards the changes of earlier steps in step 7 only, so that within a pair of
  /// steps full ICP goes on from the translational result; the digest's table starts both alike.
  bool carry_over = false;
  bool refine_translational = false;  ///< follow a translational success by full ICP
};

struct GroupOptions {
  double cutoff_deg = 20.0;
  int stride = 1;                  ///< 1: conservative, every view but the last starts a group
  int max_members = 8;             ///< bounds the cost while the sensor stands still
  bool warm_start = false;         ///< start in the younger groups from what the oldest one found
  bool match_shared_views = true;  ///< between groups, let a view match its own samples
  int inter_samples = 0;           ///< between groups, samples on the moving side; 0: all
};

struct GlobalOptions {
  bool enabled = true;
  bool loop_closure = true;
  bool joint_refinement = true;
  int loop_separation = 0;  ///< views between the two ends of a loop; 0: twice the group size
  int loops_per_view = 2;
  double loop_min_overlap = 0.3;
  double loop_drift_m = 0.1;  ///< drift allowed for when predicting overlap and accepting a loop
  double loop_drift_deg = 15.0;
  double loop_residual_sigmas = 5.0;  ///< scale of the robust loss on loop edges
  int refinement_rounds = 8;
  int refinement_pairs = 10;      ///< partners per view, the best overlapping ones
  int refinement_samples = 1000;  ///< samples per view
  double refinement_min_overlap = 0.2;
  double refinement_distance_m = 0.0;  ///< bound on pair distances; 0: four reference spacings
};

/// The block `registration:` of a configuration.
struct RegistrationOptions {
  SamplingOptions sampling;
  CorrespondenceOptions correspondence;
  IcpOptions icp;
  TrialOptions trials;
  GroupOptions groups;
  GlobalOptions global;
};

void describe(OptionVisitor& v, SamplingOptions& o);
void describe(OptionVisitor& v, CorrespondenceOptions& o);
void describe(OptionVisitor& v, IcpOptions& o);
void describe(OptionVisitor& v, TrialOptions& o);
void describe(OptionVisitor& v, GroupOptions& o);
void describe(OptionVisitor& v, GlobalOptions& o);
void describe(OptionVisitor& v, RegistrationOptions& o);

/// Throws ConfigurationError when a field is out of its bounds or two fields contradict each other.
void validate(const RegistrationOptions& options);

}  // namespace scanner::registration
