#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "scanner/core/image.h"
#include "scanner/core/options.h"

namespace scanner::simulation {

/// Block `simulation.sensor`: the image sensor (Sony ICX204 and its like).
struct SensorOptions {
  PixelFormat format = PixelFormat::kBayerRggb8;
  bool noise = true;             ///< shot noise, read noise
  double full_well_e = 13000.0;  ///< electrons at saturation
  double read_noise_e = 12.0;
  double vignetting = 0.12;         ///< loss of light in the corners; 0: none
  double radiance_e_per_s = 3.0e7;  ///< electrons per second for radiance 1
  double exposure_s = 0.001;
  double gain_db = 0.0;
  bool auto_exposure = true;  ///< exposure chosen from the first picture so that it is well filled
};
void describe(OptionVisitor& v, SensorOptions& o);

struct Exposure {
  double exposure_s = 0.004;
  double gain_db = 0.0;
};

/// One 8-bit picture of a linear radiance image (CV_32FC3 RGB): photons, mosaic, shot and read
/// noise, gain, rounding, saturation. The noise depends on `noise_seed` and the pixel only.
Image expose(const cv::Mat& radiance, const SensorOptions& options, const Exposure& exposure,
             std::uint64_t noise_seed, int threads);

/// Exposure (gain of the options kept) that puts the 95th percentile of the pictures' brightest
/// channel at 85 % of saturation, within 20 us .. 30 ms.
Exposure meter(const cv::Mat& radiance, const SensorOptions& options);

}  // namespace scanner::simulation
