#include "scanner/stereo/trouble.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "stereo/synthetic.h"

namespace scanner::stereo {
namespace {

namespace fs = std::filesystem;
using testing::makePair;

constexpr int kWidth = 640, kHeight = 480;

RectifiedPair copyOf(const RectifiedPair& pair) {
  RectifiedPair out;
  out.left_gray = pair.left_gray.clone();
  out.right_gray = pair.right_gray.clone();
  return out;
}

cv::Mat withNoise(const cv::Mat& gray, double sigma, std::uint64_t seed) {
  cv::Mat noise(gray.size(), CV_16SC1), sum;
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0.0, sigma);
  cv::add(gray, noise, sum, cv::noArray(), CV_8U);
  return sum;
}

cv::Mat flat(const cv::Mat& like, double level) {
  return withNoise(cv::Mat(like.size(), CV_8UC1, cv::Scalar(level)), 1.5, 3);
}

cv::Mat movedDown(const cv::Mat& gray, double pixels) {
  const cv::Mat M = (cv::Mat_<double>(2, 3) << 1, 0, 0, 0, 1, pixels);
  cv::Mat out;
  cv::warpAffine(gray, out, M, gray.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return out;
}

cv::Mat blurred(const cv::Mat& gray, double sigma) {
  cv::Mat out;
  cv::GaussianBlur(gray, out, cv::Size(), sigma);
  return withNoise(out, 1.5, 4);
}

/// A way to spoil a good pair, and what it must be called.
struct Fault {
  const char* name;
  TroubleKind kind;
  bool hopeless;
  std::function<void(RectifiedPair&)> spoil;
};

std::vector<Fault> faults() {
  using K = TroubleKind;
  return {
      {"left black", K::kBlack, true, [](RectifiedPair& p) { p.left_gray = flat(p.left_gray, 3); }},
      {"right black", K::kBlack, true,
       [](RectifiedPair& p) { p.right_gray = flat(p.right_gray, 3); }},
      {"left saturated", K::kSaturated, true,
       [](RectifiedPair& p) { p.left_gray = p.left_gray * 6 + 150; }},
      {"right covered", K::kBlank, true,
       [](RectifiedPair& p) { p.right_gray = flat(p.right_gray, 70); }},
      {"left dark", K::kUneven, false, [](RectifiedPair& p) { p.left_gray = p.left_gray * 0.2; }},
      {"left blurred", K::kBlurred, true,
       [](RectifiedPair& p) { p.left_gray = blurred(p.left_gray, 8.0); }},
      {"same picture", K::kSamePicture, true,
       [](RectifiedPair& p) { p.right_gray = p.left_gray.clone(); }},
      {"swapped", K::kSwapped, true,
       [](RectifiedPair& p) { std::swap(p.left_gray, p.right_gray); }},
      {"rows 2 lower", K::kRowsDiffer, false,
       [](RectifiedPair& p) { p.right_gray = movedDown(p.right_gray, 2.0); }},
      {"rows 10 lower", K::kRowsDiffer, true,
       [](RectifiedPair& p) { p.right_gray = movedDown(p.right_gray, 10.0); }},
      {"rows 20 higher", K::kRowsDiffer, true,
       [](RectifiedPair& p) { p.right_gray = movedDown(p.right_gray, -20.0); }},
      {"turned over", K::kUnrelated, true,
       [](RectifiedPair& p) { cv::flip(p.right_gray.clone(), p.right_gray, 0); }},
  };
}

RectifiedPair goodPair() { return makePair(kWidth, kHeight, {40.0, 0.02, 0.01}, {1.5}); }

TEST(Trouble, AGoodPairHasNone) {
  const RectifiedPair pair = goodPair();
  const Trouble trouble = inspectPair(pair, 1);
  EXPECT_FALSE(trouble) << trouble.line;
  EXPECT_FALSE(trouble.hopeless);
  EXPECT_EQ(describeTrouble(pair, 1), "");
  EXPECT_FALSE(inspectBrightness(pair));
}

TEST(Trouble, EveryFaultIsNamed) {
  const RectifiedPair good = goodPair();
  for (const Fault& fault : faults()) {
    RectifiedPair pair = copyOf(good);
    fault.spoil(pair);
    const Trouble trouble = inspectPair(pair, 2);
    EXPECT_EQ(trouble.kind, fault.kind) << fault.name << ": " << trouble.line;
    EXPECT_FALSE(trouble.line.empty()) << fault.name;
    // Whether little matches of a blurred pair depends on what it shows.
    if (fault.kind != TroubleKind::kBlurred) {
      EXPECT_EQ(trouble.hopeless, fault.hopeless) << fault.name;
    }
  }
}

TEST(Trouble, TheLineSaysWhichEye) {
  RectifiedPair pair = goodPair();
  pair.right_gray = flat(pair.right_gray, 3);
  EXPECT_NE(inspectPair(pair, 1).line.find("right image is black"), std::string::npos);
  EXPECT_EQ(inspectBrightness(pair).kind, TroubleKind::kBlack);
  pair.left_gray = flat(pair.left_gray, 3);
  EXPECT_NE(inspectPair(pair, 1).line.find("both images"), std::string::npos);
  pair = goodPair();
  pair.left_gray = blurred(pair.left_gray, 8.0);
  EXPECT_NE(inspectPair(pair, 1).line.find("left image is blurred"), std::string::npos);
}

TEST(Trouble, RowsAreMeasuredInPixels) {
  RectifiedPair pair = goodPair();
  pair.right_gray = movedDown(pair.right_gray, 10.0);
  const std::string line = inspectPair(pair, 1).line;
  EXPECT_NE(line.find("lower in the right"), std::string::npos) << line;
  const double pixels = std::atof(line.substr(line.find("up to") + 6).c_str());
  EXPECT_NEAR(pixels, 10.0, 1.0) << line;
}

TEST(Trouble, DifferentExposureIsNone) {
  RectifiedPair pair = goodPair();
  pair.right_gray = withNoise(pair.right_gray * 0.5 + 10, 1.0, 5);
  EXPECT_FALSE(inspectPair(pair, 1)) << inspectPair(pair, 1).line;
}

TEST(Trouble, EmptyOrUnequalImages) {
  RectifiedPair pair;
  EXPECT_EQ(inspectPair(pair, 1).kind, TroubleKind::kEmpty);
  pair = goodPair();
  pair.right_gray = pair.right_gray.colRange(0, 100);
  EXPECT_EQ(inspectBrightness(pair).kind, TroubleKind::kEmpty);
  EXPECT_TRUE(inspectPair(pair, 1).hopeless);
  // Too small to look at, but no crash.
  pair.left_gray = pair.right_gray = cv::Mat(5, 5, CV_8UC1, cv::Scalar(90));
  EXPECT_TRUE(inspectPair(pair, 1));
}

TEST(Trouble, ARawPairOfOnePictureIsCaughtWhateverRectificationDoes) {
  const RectifiedPair pair = goodPair();
  StereoFrame frame;
  frame.left.data = pair.left_gray;
  frame.right.data = pair.left_gray.clone();
  EXPECT_EQ(inspectRaw(frame).kind, TroubleKind::kSamePicture);
  frame.right.data = pair.right_gray;
  EXPECT_FALSE(inspectRaw(frame));
  frame.left.data = frame.right.data = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(0));
  EXPECT_FALSE(inspectRaw(frame));  // black, which inspectBrightness() says better
}

fs::path dataFolder() {
  const char* given = std::getenv("SCANNER_DATA");
  return given != nullptr ? fs::path(given) : fs::path(SCANNER_SOURCE_DIR) / "../shared/data";
}

/// Real pictures: no false alarm, and every fault named.
class RealDataTrouble : public ::testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(RealDataTrouble, NoFalseAlarmAndEveryFaultNamed) {
  const fs::path left = dataFolder() / GetParam().first, right = dataFolder() / GetParam().second;
  if (!fs::exists(left)) GTEST_SKIP() << "no recording at " << left;
  RectifiedPair good;
  good.left_gray = cv::imread(left.string(), cv::IMREAD_GRAYSCALE);
  good.right_gray = cv::imread(right.string(), cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(good.left_gray.empty() || good.right_gray.empty());
  EXPECT_EQ(describeTrouble(good, 2), "");
  for (const Fault& fault : faults()) {
    if (std::string(fault.name) == "rows 2 lower") continue;  // of a third-size picture, much
    RectifiedPair pair = copyOf(good);
    fault.spoil(pair);
    const Trouble trouble = inspectPair(pair, 2);
    EXPECT_EQ(trouble.kind, fault.kind) << fault.name << ": " << trouble.line;
    if (fault.kind != TroubleKind::kBlurred) {
      EXPECT_EQ(trouble.hopeless, fault.hopeless) << fault.name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    RealData, RealDataTrouble,
    ::testing::Values(
        std::make_pair("middlebury_v2/Teddy/imL.png", "middlebury_v2/Teddy/imR.png"),
        std::make_pair("middlebury_v2/Cones/imL.png", "middlebury_v2/Cones/imR.png"),
        std::make_pair("middlebury_v3/Motorcycle/im0.png", "middlebury_v3/Motorcycle/im1.png"),
        std::make_pair("middlebury_v3/Adirondack/im0.png", "middlebury_v3/Adirondack/im1.png")));

/// Raw pictures of the Bumblebee2 and of the EuRoC rig are not rectified, which is a trouble too.
TEST(RealDataRows, PicturesThatAreNotRectified) {
  const fs::path folder = dataFolder() / "bumblebee2/pairs";
  if (!fs::exists(folder)) GTEST_SKIP() << "no recording at " << folder;
  for (const char* name : {"chair01", "garden01", "lantern01", "stones01", "wall01"}) {
    RectifiedPair pair;
    pair.left_gray =
        cv::imread((folder / (std::string(name) + "_left.jpg")).string(), cv::IMREAD_GRAYSCALE);
    pair.right_gray =
        cv::imread((folder / (std::string(name) + "_right.jpg")).string(), cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(pair.left_gray.empty());
    const Trouble trouble = inspectPair(pair, 2);
    EXPECT_EQ(trouble.kind, TroubleKind::kRowsDiffer) << name << ": " << trouble.line;
    std::cout << name << ": " << trouble.line << "\n";
  }
}

}  // namespace
}  // namespace scanner::stereo
