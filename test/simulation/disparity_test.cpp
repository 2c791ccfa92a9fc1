// The simulated pictures against the exact depth, through the stereo stage.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "scanner/simulation/simulation.h"
#include "scanner/stereo/stereo_processor.h"

namespace scanner::simulation {
namespace {

struct Sample {
  double error, sigma;  ///< px
};

/// Every pixel of the object whose disparity is found and known.
std::vector<Sample> compare(const Simulation& simulation, int view,
                            const stereo::StereoOptions& options) {
  const StereoCalibration& cameras = simulation.rig().calibration;
  const stereo::StereoProcessor stereo(cameras, options, 2);
  const Result<stereo::StereoProcessor::Output> output = stereo.process(simulation.frame(view));
  if (!output) return {};
  RenderOptions unlit;
  unlit.sky_occlusion = false;
  const Renderer renderer(simulation.scene(), unlit, 2);
  const Eigen::Isometry3d T_map_camera =
      simulation.motion().at(simulation.viewTime(view)).T_map_base * simulation.rig().T_base_camera;
  const cv::Mat depth = renderer.rectifiedDepth(cameras.left, T_map_camera, true);
  std::vector<Sample> samples;
  for (int row = 0; row < depth.rows; ++row) {
    for (int col = 0; col < depth.cols; ++col) {
      const float z = depth.at<float>(row, col);
      const float found = output->disparity.disparity_px.at<float>(row, col);
      if (!std::isfinite(z) || !std::isfinite(found)) continue;
      const double exact = cameras.focalLength() * cameras.baseline() / static_cast<double>(z);
      const float sigma = output->disparity.sigma_px.at<float>(row, col);
      samples.push_back({static_cast<double>(found) - exact, static_cast<double>(sigma)});
    }
  }
  return samples;
}

stereo::StereoOptions optionsFor(stereo::MatchMethod method) {
  stereo::StereoOptions options;
  options.matcher.method = method;
  options.matcher.min_disparity_px = 80;
  options.matcher.max_disparity_px = 335;
  return options;
}

TEST(ArtworkDisparity, BlockMatchingWithoutNoiseAgreesWithTheExactDisparity) {
  SimulationOptions options = noiseFree(SimulationOptions());
  options.motion.views = 2;
  // What is left is the matcher and the renderer: no mosaic, and enough samples for the texture.
  options.sensor.format = PixelFormat::kMono8;
  options.render.samples = 8;
  const Simulation simulation("artwork", options, 1, Time(), 2);
  std::vector<double> errors;
  for (const Sample& s : compare(simulation, 0, optionsFor(stereo::MatchMethod::kBlock))) {
    errors.push_back(std::abs(s.error));
  }
  ASSERT_GT(errors.size(), 50000U);
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  RecordProperty("median_error_px", std::to_string(*middle));
  EXPECT_LT(*middle, 0.05);
}

TEST(ArtworkDisparity, SigmaIsTheErrorOfARealSensorInEveryDecile) {
  SimulationOptions scene;
  scene.motion.views = 2;
  const Simulation simulation("artwork", scene, 1, Time(), 2);
  for (const auto method : {stereo::MatchMethod::kBlock, stereo::MatchMethod::kSemiGlobal}) {
    std::vector<Sample> samples = compare(simulation, 0, optionsFor(method));
    ASSERT_GT(samples.size(), 50000U);
    // A wrong match is no matter of sigma; there are few (stereo_accuracy counts them).
    const auto wrong = [](const Sample& s) { return std::abs(s.error) >= 1.0; };
    const auto end = std::remove_if(samples.begin(), samples.end(), wrong);
    EXPECT_LT(static_cast<double>(samples.end() - end), 0.03 * static_cast<double>(samples.size()));
    samples.erase(end, samples.end());
    std::sort(samples.begin(), samples.end(),
              [](const Sample& a, const Sample& b) { return a.sigma < b.sigma; });
    constexpr std::size_t kParts = 10;
    for (std::size_t part = 0; part < kParts; ++part) {
      double measured = 0.0, predicted = 0.0;
      for (std::size_t i = samples.size() * part / kParts; i < samples.size() * (part + 1) / kParts;
           ++i) {
        measured += samples[i].error * samples[i].error;
        predicted += samples[i].sigma * samples[i].sigma;
      }
      const double ratio = std::sqrt(measured / predicted);
      EXPECT_GT(ratio, 0.8) << part;
      EXPECT_LT(ratio, 1.3) << part;
    }
  }
}

}  // namespace
}  // namespace scanner::simulation
