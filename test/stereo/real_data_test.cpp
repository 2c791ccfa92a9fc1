#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "scanner/stereo/match.h"
#include "scanner/stereo/suitability.h"

namespace scanner::stereo {
namespace {

namespace fs = std::filesystem;

fs::path dataFolder() {
  const char* given = std::getenv("SCANNER_DATA");
  return given != nullptr ? fs::path(given) : fs::path(SCANNER_SOURCE_DIR) / "../shared/data";
}

struct Scene {
  std::string name, left, right, truth;
  double truth_scale;
  /// Least share of pixels with a disparity, and most of those off by more than 2 px. Measured with
  /// a third in hand.
  double min_density, max_bad;
};

std::ostream& operator<<(std::ostream& out, const Scene& scene) { return out << scene.name; }

class Middlebury : public ::testing::TestWithParam<std::tuple<Scene, MatchMethod>> {};

TEST_P(Middlebury, FewValidPixelsAreWrong) {
  const auto& [scene, method] = GetParam();
  const fs::path folder = dataFolder() / "middlebury_v2" / scene.name;
  if (!fs::exists(folder / scene.left)) GTEST_SKIP() << "no recording at " << folder;
  RectifiedPair pair;
  pair.left_gray = cv::imread((folder / scene.left).string(), cv::IMREAD_GRAYSCALE);
  pair.right_gray = cv::imread((folder / scene.right).string(), cv::IMREAD_GRAYSCALE);
  const cv::Mat truth = cv::imread((folder / scene.truth).string(), cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(pair.left_gray.empty() || pair.right_gray.empty() || truth.empty());
  MatcherOptions options;
  options.method = method;
  options.min_disparity_px = 0;
  options.max_disparity_px = 95;
  const DisparityImage image = match(pair, options, 2);
  double known = 0.0, valid = 0.0, bad = 0.0;
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      if (truth.at<std::uint8_t>(y, x) == 0) continue;
      ++known;
      const double d = static_cast<double>(image.disparity_px.at<float>(y, x));
      if (std::isnan(d)) continue;
      ++valid;
      if (std::abs(d - truth.at<std::uint8_t>(y, x) / scene.truth_scale) > 2.0) ++bad;
    }
  }
  std::cout << scene.name << ": density " << valid / known << ", bad-2 " << bad / valid << "\n";
  EXPECT_GT(valid / known, scene.min_density);
  EXPECT_LT(bad / valid, scene.max_bad);
  EXPECT_EQ(describeTrouble(pair, 2), "");
}

INSTANTIATE_TEST_SUITE_P(
    RealData, Middlebury,
    ::testing::Combine(
        ::testing::Values(Scene{"Teddy", "imL.png", "imR.png", "disp2.png", 4.0, 0.60, 0.08},
                          Scene{"Cones", "imL.png", "imR.png", "disp2.png", 4.0, 0.60, 0.05},
                          Scene{"Venus", "imL.png", "imR.png", "disp2.pgm", 8.0, 0.70, 0.05},
                          Scene{"Cloth3", "view1.png", "view5.png", "disp1.png", 3.0, 0.65, 0.03},
                          Scene{"Baby1", "view1.png", "view5.png", "disp1.png", 3.0, 0.60, 0.04}),
        ::testing::Values(MatchMethod::kBlock, MatchMethod::kSemiGlobal)));

}  // namespace
}  // namespace scanner::stereo
