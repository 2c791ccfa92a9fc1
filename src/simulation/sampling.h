#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "simulation/embree_scene.h"
#include "simulation/ray_table.h"

/// Where in a pixel, in the exposure and on the sun's disc the renderer takes its samples, and
/// which pixels need more of them.
namespace scanner::simulation {

constexpr int kSkyPart = -1, kMixedParts = -2;

/// What is remembered of the first samples of a pixel, to find edges.
struct PixelTrace {
  int part = kSkyPart;
  int samples = 0;
  float inverse_depth = 0.0F;  ///< mean
  float sun = 0.0F;            ///< visible share, mean
};

struct Sample {
  int col = 0;
  int row = 0;
  int index = 0;  ///< among those of the pixel
  RTCRayHit ray;
};

/// One set of samples that every pixel, or every edge pixel, gets.
struct Pattern {
  int count = 1;
  unsigned salt = 0;
  std::vector<Eigen::Isometry3f> T_map_camera;  ///< per sample: they share out the exposure
  std::vector<Eigen::Vector3f> to_sun;          ///< per sample: they share out the sun's disc
};

/// What the samples of one picture share.
struct Frame {
  const RayTable& rays;
  float pixel_angle;  ///< rad
  std::uint64_t seed;
};

/// `poses`: T_map_camera at the middles of equal parts of the exposure.
Pattern makePattern(int count, unsigned salt, const std::vector<Eigen::Isometry3d>& poses,
                    const Eigen::Vector3f& to_sun);

/// Appends the samples of a pixel. The mean of their places is the centre of the pixel.
void addSamples(const Frame& frame, const Pattern& pattern, int col, int row,
                std::vector<Sample>& samples);

/// Adds what a traced sample met, and the share of the sun that is seen there.
void record(const Sample& sample, float sun, PixelTrace& trace);

/// Where the first samples do not suffice: part, depth or shadow change in the pixel or next to it.
bool isEdge(const std::vector<PixelTrace>& traces, int col, int row, int width, int height);

}  // namespace scanner::simulation
