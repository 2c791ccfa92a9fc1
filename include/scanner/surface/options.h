#pragma once

#include <vector>

#include "scanner/core/options.h"

namespace scanner::surface {

/// How registered views become one clean cloud. Lengths given in voxels scale with the data.
struct FusionOptions {
  double voxel_m = 0.0;            ///< 0: max(2 x median point spacing, 2 x median noise)
  double normal_angle_deg = 60.0;  ///< points of one voxel within this angle average together
  int min_views = 2;               ///< support asked for where other views cover the place
  double coverage_factor = 3.0;    ///< covered: neighbours seen by this factor times min_views
  int min_neighbors = 6;           ///< radius outlier filter; 0: off
  double min_agreement = 0.15;     ///< share of the support around a point with its normal
  double neighbor_radius_voxels = 3.0;
  int projection_rounds = 2;  ///< moving least squares rounds; 0: off
  int projection_degree = 2;  ///< 1: plane, 2: quadric (does not shrink curved places)
  double projection_radius_voxels = 3.5;
  double thinning_voxels = 0.8;  ///< smallest distance of two output points; 0: off
};

/// Ball pivoting (Bernardini et al. 1999).
struct BallPivotOptions {
  double radius_m = 0.0;            ///< smallest ball; 0: radius_factor x mean spacing
  double radius_factor = 1.2;       ///< of the automatic radius
  double radius_growth = 1.8;       ///< each further ball is this much larger
  int radius_count = 3;             ///< balls tried, 1 to 5
  double normal_cutoff_deg = 85.0;  ///< a face and the normals of its corners agree within this
};

/// What clean() removes. Every step can be switched off.
struct CleaningOptions {
  bool duplicate_vertices = true;
  bool degenerate_faces = true;
  bool duplicate_faces = true;
  bool non_manifold_faces = true;
  bool non_manifold_vertices = true;  ///< split vertices that join separate fans
  bool unreferenced_vertices = true;
  bool remove_color = false;
  int color_r = 0;
  int color_g = 0;
  int color_b = 0;
  int color_tolerance = 10;           ///< per channel
  int min_piece_faces = 50;           ///< 0: off
  double min_piece_diameter = 0.05;   ///< of the largest piece's diameter; 0: off
  double max_piece_distance_m = 0.0;  ///< from the largest piece's centre; 0: off
  bool keep_largest_piece = false;
};

struct HoleOptions {
  bool enabled = true;
  int max_edges = 100;          ///< longest boundary loop that is filled
  double max_diameter_m = 0.0;  ///< widest hole; 0: 20 x mean edge length
};

enum class SmoothingMethod { kNone, kLaplacian, kHcLaplacian, kTwoStep };

struct SmoothingOptions {
  SmoothingMethod method = SmoothingMethod::kNone;
  int iterations = 3;
  double lambda = 0.5;              ///< laplacian: share of the way to the neighbours' mean
  double hc_alpha = 0.0;            ///< hc_laplacian: pull towards the original positions
  double hc_beta = 0.5;             ///< hc_laplacian: own correction against the neighbours'
  double feature_angle_deg = 60.0;  ///< two_step: faces further apart do not share normals
  int normal_iterations = 5;        ///< two_step: rounds of normal smoothing per iteration
  int fit_iterations = 5;           ///< two_step: rounds of vertex fitting per iteration
};

struct SurfaceOptions {
  FusionOptions fusion;
  BallPivotOptions ball_pivot;
  CleaningOptions cleaning;
  HoleOptions holes;
  SmoothingOptions smoothing;
};

void describe(OptionVisitor& v, FusionOptions& o);
void describe(OptionVisitor& v, BallPivotOptions& o);
void describe(OptionVisitor& v, CleaningOptions& o);
void describe(OptionVisitor& v, HoleOptions& o);
void describe(OptionVisitor& v, SmoothingOptions& o);
/// YAML block `surface:` with the groups fusion, ball_pivot, cleaning, holes, smoothing.
void describe(OptionVisitor& v, SurfaceOptions& o);

}  // namespace scanner::surface
