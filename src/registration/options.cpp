#include "scanner/registration/options.h"

namespace scanner::registration {

void describe(OptionVisitor& v, SamplingOptions& o) {
  const std::vector<std::pair<std::string, SamplingMethod>> methods = {
      {"normal_space", SamplingMethod::kNormalSpace},
      {"uniform", SamplingMethod::kUniform},
      {"voxel", SamplingMethod::kVoxel}};
  v.choice("moving_method", o.moving_method, methods, "How the moved side is sampled");
  v.choice("reference_method", o.reference_method, methods, "How the matched side is sampled");
  v.option("moving_factor", o.moving_factor, Bounds{1.0, 1e6}, "",
           "Points of a view per sample that is moved (table 4.1)");
  v.option("reference_factor", o.reference_factor, Bounds{1.0, 1e6}, "",
           "Points of a view per sample that is matched against");
  v.option("min_samples", o.min_samples, Bounds{10.0, 1e6}, "",
           "Never fewer samples than this, as far as the view has points");
  v.option("bucket_deg", o.bucket_deg, Bounds{0.5, 90.0}, "deg",
           "Side of a bucket of normal-space sampling (table 4.2)");
  v.option("voxel_m", o.voxel_m, Bounds{1e-6, 1e3}, "m", "Side of a voxel (voxel method only)");
}

void describe(OptionVisitor& v, CorrespondenceOptions& o) {
  v.option("compatible_angle_deg", o.compatible_angle_deg, Bounds{0.1, 180.0}, "deg",
           "Largest angle between the normals of a pair (theta_c)");
  v.choice("compatibility", o.compatibility,
           {{"plain_angle", Compatibility::kPlainAngle},
            {"printed_formula", Compatibility::kPrintedFormula}},
           "Angle between the normals, or eq. 4.10 as printed: 2 acos|n1.n2|, half as wide");
  v.option("max_distance_m", o.max_distance_m, Bounds{0.0, 1e3}, "m",
           "Pairs further apart are never formed; 0: no bound");
  v.option("rejection_factor", o.rejection_factor, Bounds{0.0, 1e3}, "",
           "Pairs further apart than this many median distances are rejected; 0: none");
}

namespace {

void describeRefusal(OptionVisitor& v, IcpOptions& o) {
  v.option("accept_mean_m", o.accept_mean_m, Bounds{0.0, 10.0}, "m",
           "Largest mean point-to-point distance of an accepted result (table 4.1); 0: from the "
           "spacing of the reference and the noise of the points");
  v.option("accept_plane_m", o.accept_plane_m, Bounds{0.0, 10.0}, "m",
           "Largest mean distance to the tangent planes; 0: not checked");
  v.option("min_overlap", o.min_overlap, Bounds{0.0, 1.0}, "",
           "Smallest share of moving samples that lie on the reference; 0: not checked");
  v.option("overlap_distance_m", o.overlap_distance_m, Bounds{0.0, 10.0}, "m",
           "Nearer than this counts as lying on the reference; 0: twice the acceptance threshold");
  v.option("max_rotation_deg", o.max_rotation_deg, Bounds{0.0, 180.0}, "deg",
           "Largest rotation away from the prior; 0: not checked");
  v.option("max_translation_m", o.max_translation_m, Bounds{0.0, 1e3}, "m",
           "Largest move of the data's centre away from the prior; 0: not checked");
}

}  // namespace

void describe(OptionVisitor& v, IcpOptions& o) {
  v.choice("metric", o.metric,
           {{"point_to_point", Metric::kPointToPoint}, {"point_to_plane", Metric::kPointToPlane}},
           "What is minimised");
  v.choice(
      "stop", o.stop,
      {{"at_threshold", StopRule::kAtThreshold}, {"at_convergence", StopRule::kAtConvergence}},
      "Stop at the first iteration within accept_mean_m (thesis), or when the motion vanishes");
  v.option("max_iterations", o.max_iterations, Bounds{1.0, 1000.0}, "",
           "Iterations of one trial (escape condition, table 4.1)");
  describeRefusal(v, o);
  v.option("converged_translation_m", o.converged_translation_m, Bounds{0.0, 1.0}, "m",
           "Motion per iteration under which it has converged");
  v.option("converged_rotation_deg", o.converged_rotation_deg, Bounds{0.0, 10.0}, "deg",
           "Rotation per iteration under which it has converged");
  v.option("distance_start_m", o.distance_start_m, Bounds{0.0, 1e3}, "m",
           "Bound on pair distances at the first iteration, shrinking from there; 0: none");
  v.option("distance_floor_m", o.distance_floor_m, Bounds{0.0, 1e3}, "m",
           "The bound never shrinks below this; 0: three spacings of the reference");
  v.option("distance_decay", o.distance_decay, Bounds{0.01, 1.0}, "",
           "Factor on the bound per iteration");
  v.option("sigma_weights", o.sigma_weights, "Weight pairs by the variance of their depths");
  v.choice("kernel", o.kernel,
           {{"none", RobustKernel::kNone},
            {"huber", RobustKernel::kHuber},
            {"tukey", RobustKernel::kTukey}},
           "Robust kernel on point-to-plane residuals");
  v.option("kernel_scale", o.kernel_scale, Bounds{0.1, 100.0}, "",
           "Width of the kernel in robust standard deviations");
  v.option("degenerate_below", o.degenerate_below, Bounds{0.0, 1.0}, "",
           "Directions with a smaller eigenvalue per pair keep the prior (point_to_plane)");
}

void describe(OptionVisitor& v, TrialOptions& o) {
  v.option("translational", o.translational, "Steps 1, 3 and 5: translational ICP");
  v.option("median_starts", o.median_starts, "Steps 3 to 6: start with the medians on each other");
  v.option("resample", o.resample, "Step 7: repeat without the crowded normal buckets");
  v.option("carry_over", o.carry_over,
           "Steps 2, 4 and 6 go on from where the step before them ended, not from its start");
  v.option("refine_translational", o.refine_translational,
           "Follow a success of translational ICP by full ICP");
}

void describe(OptionVisitor& v, GroupOptions& o) {
  v.option("cutoff_deg", o.cutoff_deg, Bounds{0.0, 180.0}, "deg",
           "Largest angle to the orientation of a group's first view (table 4.1)");
  v.option("stride", o.stride, Bounds{1.0, 1000.0}, "",
           "Views from one group's start to the next's; 1: conservative");
  v.option("max_members", o.max_members, Bounds{2.0, 1000.0}, "", "Largest size of a group");
  v.option("warm_start", o.warm_start,
           "Start a view in the younger groups from what the oldest group found");
  v.option("match_shared_views", o.match_shared_views,
           "Between groups, match the samples of a view that both hold to themselves");
  v.option("inter_samples", o.inter_samples, Bounds{0.0, 1e7}, "",
           "Samples that are moved between groups; 0: all");
}

void describe(OptionVisitor& v, GlobalOptions& o) {
  v.option("enabled", o.enabled, "Third stage: pose graph over all views");
  v.option("loop_closure", o.loop_closure, "Look for loops");
  v.option("joint_refinement", o.joint_refinement, "Refine all views together");
  v.option("loop_separation", o.loop_separation, Bounds{0.0, 1e6}, "",
           "Fewest views between the ends of a loop; 0: twice the size of a group");
  v.option("loops_per_view", o.loops_per_view, Bounds{1.0, 1000.0}, "", "Loops tried per view");
  v.option("loop_min_overlap", o.loop_min_overlap, Bounds{0.01, 1.0}, "",
           "Smallest overlap of the ends of a loop, predicted and verified");
  v.option("loop_drift_m", o.loop_drift_m, Bounds{0.0, 100.0}, "m",
           "Drift to allow for when loops are looked for and accepted");
  v.option("loop_drift_deg", o.loop_drift_deg, Bounds{0.0, 180.0}, "deg", "The same, rotation");
  v.option("loop_residual_sigmas", o.loop_residual_sigmas, Bounds{0.1, 1e6}, "",
           "Scale of the robust loss on loops, in standard deviations");
  v.option("refinement_rounds", o.refinement_rounds, Bounds{1.0, 1000.0}, "",
           "Rounds of the joint refinement");
  v.option("refinement_pairs", o.refinement_pairs, Bounds{1.0, 1000.0}, "",
           "Partners of a view in the joint refinement");
  v.option("refinement_samples", o.refinement_samples, Bounds{10.0, 1e7}, "",
           "Samples of a view in the joint refinement");
  v.option("refinement_min_overlap", o.refinement_min_overlap, Bounds{0.01, 1.0}, "",
           "Smallest overlap of a pair in the joint refinement");
  v.option("refinement_distance_m", o.refinement_distance_m, Bounds{0.0, 100.0}, "m",
           "Bound on pair distances there; 0: four spacings of the reference");
}

void describe(OptionVisitor& v, RegistrationOptions& o) {
  v.group("sampling", o.sampling, "Which points take part");
  v.group("correspondence", o.correspondence, "Which points are matched");
  v.group("icp", o.icp, "Alignment of two clouds");
  v.group("trials", o.trials, "The eight steps that try one pair");
  v.group("groups", o.groups, "Similarity groups");
  v.group("global", o.global, "Third stage");
}

namespace {

// Visits every number once more and refuses what is out of its bounds: options that were set in
// code never went through the loader.
class BoundsCheck : public OptionVisitor {
 public:
  void option(const char*, bool&, const char*) override {}
  void option(const char* name, int& value, Bounds b, const char*, const char*) override {
    check(name, value, b);
  }
  void option(const char* name, double& value, Bounds b, const char*, const char*) override {
    check(name, value, b);
  }
  void option(const char*, std::string&, const char*) override {}

 protected:
  std::size_t chooseIndex(const char* name, std::size_t selected,
                          const std::vector<std::string>& names, const char*) override {
    if (selected >= names.size()) {
      throw ConfigurationError(prefix_ + name + ": not one of its choices");
    }
    return selected;
  }
  void beginGroup(const char* name, const char*) override {
    prefix_ = std::string("registration.") + name + ".";
  }
  void endGroup() override { prefix_ = "registration."; }

 private:
  void check(const char* name, double value, Bounds b) const {
    if (value >= b.min && value <= b.max) return;
    throw ConfigurationError(prefix_ + name + ": " + std::to_string(value) + " is not within " +
                             std::to_string(b.min) + " .. " + std::to_string(b.max));
  }
  std::string prefix_ = "registration.";
};

}  // namespace

void validate(const RegistrationOptions& options) {
  RegistrationOptions copy = options;
  BoundsCheck check;
  describe(check, copy);
  const IcpOptions& icp = options.icp;
  if (icp.distance_start_m > 0.0 && icp.distance_floor_m > icp.distance_start_m) {
    throw ConfigurationError(
        "registration.icp.distance_floor_m: " + std::to_string(icp.distance_floor_m) +
        " is above distance_start_m = " + std::to_string(icp.distance_start_m));
  }
}

}  // namespace scanner::registration
