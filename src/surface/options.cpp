#include "scanner/surface/options.h"

namespace scanner::surface {

void describe(OptionVisitor& v, FusionOptions& o) {
  v.option("voxel_m", o.voxel_m, {0.0, 1.0}, "m",
           "edge of a voxel; 0 finds it from the spacing and noise of the points");
  v.option("normal_angle_deg", o.normal_angle_deg, {5.0, 90.0}, "deg",
           "points of one voxel whose normals agree within this angle average together");
  v.option(
      "min_views", o.min_views, {1.0, 100.0}, "",
      "voxels seen by fewer views are dropped where the place is covered by more; 1 keeps all");
  v.option("coverage_factor", o.coverage_factor, {1.0, 100.0}, "",
           "a place is covered when its surroundings are seen by this factor times min_views");
  v.option("min_neighbors", o.min_neighbors, {0.0, 100.0}, "",
           "points with fewer neighbours are outliers; 0 keeps all");
  v.option("min_agreement", o.min_agreement, {0.0, 0.5}, "",
           "smallest share of the support around a point whose normals agree with its own");
  v.option("neighbor_radius_voxels", o.neighbor_radius_voxels, {1.0, 10.0}, "voxel",
           "how far neighbours are looked for by the filters");
  v.option("projection_rounds", o.projection_rounds, {0.0, 5.0}, "",
           "rounds of projection onto the local least-squares surface; 0 switches it off");
  v.option("projection_degree", o.projection_degree, {1.0, 2.0}, "",
           "local surface: 1 plane, 2 quadric");
  v.option("projection_radius_voxels", o.projection_radius_voxels, {1.5, 10.0}, "voxel",
           "radius of the local surface fit");
  v.option("thinning_voxels", o.thinning_voxels, {0.0, 2.0}, "voxel",
           "smallest distance between two fused points; 0 keeps all");
}

void describe(OptionVisitor& v, BallPivotOptions& o) {
  v.option("radius_m", o.radius_m, {0.0, 10.0}, "m",
           "radius of the smallest ball; 0 finds it from the mean spacing");
  v.option("radius_factor", o.radius_factor, {0.5, 10.0}, "", "automatic radius over mean spacing");
  v.option("radius_growth", o.radius_growth, {1.1, 5.0}, "",
           "each further ball over the one before");
  v.option("radius_count", o.radius_count, {1.0, 5.0}, "", "number of balls");
  v.option("normal_cutoff_deg", o.normal_cutoff_deg, {10.0, 90.0}, "deg",
           "largest angle between a face and the normals of its corners");
}

void describe(OptionVisitor& v, CleaningOptions& o) {
  v.option("duplicate_vertices", o.duplicate_vertices, "merge vertices at the same place");
  v.option("degenerate_faces", o.degenerate_faces, "remove faces without area");
  v.option("duplicate_faces", o.duplicate_faces, "remove faces that are there twice");
  v.option("non_manifold_faces", o.non_manifold_faces,
           "remove faces until no edge has more than two");
  v.option("non_manifold_vertices", o.non_manifold_vertices,
           "split vertices at which separate fans of faces meet");
  v.option("unreferenced_vertices", o.unreferenced_vertices, "remove vertices without a face");
  v.option("remove_color", o.remove_color, "remove vertices of the colour below");
  v.option("color_r", o.color_r, {0.0, 255.0}, "", "red of the colour to remove");
  v.option("color_g", o.color_g, {0.0, 255.0}, "", "green of the colour to remove");
  v.option("color_b", o.color_b, {0.0, 255.0}, "", "blue of the colour to remove");
  v.option("color_tolerance", o.color_tolerance, {0.0, 255.0}, "",
           "largest difference in any channel that still counts as that colour");
  v.option("min_piece_faces", o.min_piece_faces, {0.0, 1e9}, "",
           "isolated pieces with fewer faces are removed");
  v.option("min_piece_diameter", o.min_piece_diameter, {0.0, 1.0}, "",
           "isolated pieces smaller than this share of the largest one's diameter are removed");
  v.option("max_piece_distance_m", o.max_piece_distance_m, Bounds::atLeast(0.0), "m",
           "pieces centred further than this from the largest one's centre are removed; 0 keeps");
  v.option("keep_largest_piece", o.keep_largest_piece, "remove every piece but the largest");
}

void describe(OptionVisitor& v, HoleOptions& o) {
  v.option("enabled", o.enabled, "fill holes");
  v.option("max_edges", o.max_edges, {3.0, 400.0}, "", "longest rim that is filled");
  v.option("max_diameter_m", o.max_diameter_m, Bounds::atLeast(0.0), "m",
           "widest hole that is filled; 0: 20 x the mean edge length");
}

void describe(OptionVisitor& v, SmoothingOptions& o) {
  v.choice("method", o.method,
           {{"none", SmoothingMethod::kNone},
            {"laplacian", SmoothingMethod::kLaplacian},
            {"hc_laplacian", SmoothingMethod::kHcLaplacian},
            {"two_step", SmoothingMethod::kTwoStep}},
           "smoothing of the mesh");
  v.option("iterations", o.iterations, {0.0, 100.0}, "", "rounds of smoothing");
  v.option("lambda", o.lambda, {0.0, 1.0}, "", "laplacian: share of the way to the neighbours");
  v.option("hc_alpha", o.hc_alpha, {0.0, 1.0}, "",
           "hc_laplacian: weight of the original against the previous position");
  v.option("hc_beta", o.hc_beta, {0.0, 1.0}, "",
           "hc_laplacian: weight of the own correction against the neighbours'");
  v.option("feature_angle_deg", o.feature_angle_deg, {1.0, 180.0}, "deg",
           "two_step: faces meeting at a larger angle do not share normals");
  v.option("normal_iterations", o.normal_iterations, {1.0, 100.0}, "",
           "two_step: rounds of normal smoothing");
  v.option("fit_iterations", o.fit_iterations, {1.0, 100.0}, "",
           "two_step: rounds of vertex fitting");
}

void describe(OptionVisitor& v, SurfaceOptions& o) {
  v.group("fusion", o.fusion, "registered views into one cloud");
  v.group("ball_pivot", o.ball_pivot, "cloud into triangles");
  v.group("cleaning", o.cleaning, "what is removed from the mesh");
  v.group("holes", o.holes, "filling of holes");
  v.group("smoothing", o.smoothing, "smoothing of the mesh");
}

}  // namespace scanner::surface
