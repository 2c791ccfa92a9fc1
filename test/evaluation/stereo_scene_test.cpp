#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "evaluation/pfm.h"
#include "scanner/evaluation/stereo_evaluation.h"

namespace scanner::evaluation {
namespace {

namespace fs = std::filesystem;

/// A folder of its own for each test, removed afterwards.
class StereoScenes : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "stereo_scene_XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    root_ = fs::canonical(pattern);
  }
  void TearDown() override { fs::remove_all(root_); }

  fs::path folder(const std::string& name) const {
    fs::create_directories(root_ / name);
    return root_ / name;
  }
  static void picture(const fs::path& file, int width, int height, int level = 100) {
    cv::imwrite(file.string(),
                cv::Mat(height, width, file.extension() == ".ppm" ? CV_8UC3 : CV_8UC1,
                        cv::Scalar::all(level)));
  }
  /// Truth of a constant disparity, row 0 unknown.
  static void truth(const fs::path& file, int width, int height, int level) {
    cv::Mat levels(height, width, CV_8UC1, cv::Scalar(level));
    levels.row(0).setTo(0);
    cv::imwrite(file.string(), levels);
  }
  static void text(const fs::path& file, const std::string& lines) {
    std::ofstream(file, std::ios::binary) << lines;
  }
  static void pfm(const fs::path& file, int width, int height, bool little,
                  const std::vector<float>& bottom_up) {
    std::ofstream out(file, std::ios::binary);
    out << "Pf\n" << width << " " << height << "\n" << (little ? "-1.0" : "1.0") << "\n";
    for (const float value : bottom_up) {
      std::array<char, 4> bytes{};
      std::memcpy(bytes.data(), &value, 4);  // of a little-endian machine
      if (!little) std::reverse(bytes.begin(), bytes.end());
      out.write(bytes.data(), 4);
    }
  }
  /// The message of a failure: one line that names `file`.
  static void expectRefused(const fs::path& scene, const std::string& file,
                            const std::string& why) {
    const auto read = readStereoScene(scene.string());
    ASSERT_FALSE(read) << why;
    const std::string& message = read.status().message();
    EXPECT_NE(message.find(file), std::string::npos) << message;
    EXPECT_NE(message.find(why), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }

  fs::path root_;
};

TEST_F(StereoScenes, FloatMapsOfEitherByteOrderFromTheBottomUp) {
  const std::vector<float> bottom_up{1.5F, 2.25F, -3.0F, std::numeric_limits<float>::infinity()};
  for (const bool little : {true, false}) {
    const fs::path file = root_ / "map.pfm";
    pfm(file, 2, 2, little, bottom_up);
    const auto map = readPfm(file.string());
    ASSERT_TRUE(map) << map.status().message();
    EXPECT_EQ(map->at<float>(1, 0), 1.5F);
    EXPECT_EQ(map->at<float>(1, 1), 2.25F);
    EXPECT_EQ(map->at<float>(0, 0), -3.0F);
    EXPECT_TRUE(std::isinf(map->at<float>(0, 1)));
  }
}

TEST_F(StereoScenes, BadFloatMapsAreRefused) {
  const fs::path file = root_ / "map.pfm";
  EXPECT_EQ(readPfm(file.string()).status().code(), StatusCode::kIoError);
  for (const char* content :
       {"", "PF\n2 2\n-1\n................", "Pf\n-2 2\n-1\n", "Pf\n2 2\n0\n................",
        "Pf\n99999999 99999999\n-1\n", "Pf\n2 2\n-1\nshort"}) {
    text(file, content);
    const auto map = readPfm(file.string());
    ASSERT_FALSE(map) << content;
    EXPECT_NE(map.status().message().find(file.string()), std::string::npos);
  }
}

TEST_F(StereoScenes, Version3) {
  const fs::path scene = folder("v3/Chair");
  picture(scene / "im0.png", 40, 3);
  picture(scene / "im1.png", 40, 3);
  std::vector<float> values(120, 7.5F);
  values[119] = std::numeric_limits<float>::infinity();  // top right
  pfm(scene / "disp0GT.pfm", 40, 3, true, values);
  cv::Mat mask(3, 40, CV_8UC1, cv::Scalar(255));
  mask.col(0).setTo(128);
  cv::imwrite((scene / "mask0nocc.png").string(), mask);
  text(scene / "calib.txt", "cam0=[1 0 1; 0 1 1; 0 0 1]\n doffs= 3.5 \nndisp= 21\n isint=0\n");
  const auto read = readStereoScene(scene.string() + "/");
  ASSERT_TRUE(read) << read.status().message();
  EXPECT_EQ(read->name, "Chair");
  EXPECT_EQ(read->group, "v3");
  EXPECT_EQ(read->left.type(), CV_8UC3);
  EXPECT_EQ(read->min_disparity_px, 0);
  EXPECT_EQ(read->max_disparity_px, 20);
  EXPECT_EQ(read->truth.at<float>(1, 1), 7.5F);
  EXPECT_TRUE(std::isnan(read->truth.at<float>(0, 39)));
  EXPECT_EQ(cv::countNonZero(read->all), 119);
  EXPECT_EQ(cv::countNonZero(read->nonocc), 119 - 3);
  EXPECT_FALSE(read->nonocc_derived);
  EXPECT_TRUE(read->disc_derived);
}

TEST_F(StereoScenes, ScalesByFileNamesAndHeight) {
  struct Case {
    const char *name, *left, *right, *truth, *right_truth;
    int width, height;
    double scale;
    int max_disparity;
  };
  const std::array<Case, 7> cases{{
      {"Aloe", "view1.png", "view5.png", "disp1.png", "disp5.png", 200, 370, 3.0, 85},
      {"Half", "view1.png", "view5.png", "disp1.png", "disp5.png", 200, 555, 2.0, 127},
      {"Full", "view1.png", "view5.png", "disp1.png", "disp5.png", 300, 1110, 1.0, 255},
      {"Other", "im2.png", "im6.png", "disp2.png", "disp6.png", 200, 375, 4.0, 63},
      {"Cones", "imL.png", "imR.png", "disp2.png", "disp6.png", 450, 375, 4.0, 59},
      {"Map", "im2.ppm", "im6.ppm", "disp2.pgm", "disp6.pgm", 284, 216, 8.0, 31},
      {"Tsukuba", "imL.png", "imR.png", "truedisp.pgm", "", 384, 288, 16.0, 15},
  }};
  for (const Case& c : cases) {
    const fs::path scene = folder(c.name);
    picture(scene / c.left, c.width, c.height);
    picture(scene / c.right, c.width, c.height);
    truth(scene / c.truth, c.width, c.height, 96);
    if (c.right_truth[0] != '\0') truth(scene / c.right_truth, c.width, c.height, 96);
    const auto read = readStereoScene(scene.string());
    ASSERT_TRUE(read) << read.status().message();
    EXPECT_FLOAT_EQ(read->truth.at<float>(5, 5), static_cast<float>(96.0 / c.scale)) << c.name;
    EXPECT_TRUE(std::isnan(read->truth.at<float>(0, 5))) << c.name;
    EXPECT_EQ(read->max_disparity_px, c.max_disparity) << c.name;
    EXPECT_TRUE(read->nonocc_derived);
    // What leaves the image is not seen, all else is.
    const int seen = c.width - static_cast<int>(std::ceil(96.0 / c.scale));
    EXPECT_EQ(cv::countNonZero(read->nonocc), seen * (c.height - 1)) << c.name;
    const bool in_table = std::string(c.name) == "Cones" || std::string(c.name) == "Tsukuba";
    EXPECT_EQ(read->in_version2_table, in_table) << c.name;
  }
}

TEST_F(StereoScenes, GivenMasksAreWhiteInTheRegion) {
  const fs::path scene = folder("s");
  picture(scene / "imL.png", 20, 10);
  picture(scene / "imR.png", 20, 10);
  picture(scene / "truedisp.pgm", 20, 10, 32);
  cv::Mat all = cv::Mat::zeros(10, 20, CV_8UC1), nonocc = all.clone(), disc = all.clone();
  all(cv::Rect(2, 2, 16, 6)).setTo(255);
  nonocc.colRange(5, 20).setTo(255);  // more than all: cut
  disc.setTo(128);
  disc.colRange(0, 7).setTo(255);
  cv::imwrite((scene / "all.png").string(), all);
  cv::imwrite((scene / "nonocc.png").string(), nonocc);
  cv::imwrite((scene / "disc.png").string(), disc);
  const auto read = readStereoScene(scene.string());
  ASSERT_TRUE(read) << read.status().message();
  EXPECT_EQ(cv::countNonZero(read->all), 16 * 6);
  EXPECT_EQ(cv::countNonZero(read->nonocc), 13 * 6);
  EXPECT_EQ(cv::countNonZero(read->disc), 2 * 6);
  EXPECT_FALSE(read->nonocc_derived || read->disc_derived);
}

TEST_F(StereoScenes, DescriptionOverridesAndDescribesOtherLayouts) {
  const fs::path scene = folder("own");
  picture(scene / "a.png", 60, 40);
  picture(scene / "b.png", 60, 40);
  truth(scene / "gt.png", 60, 40, 50);
  text(scene / "scene.txt",
       "# our own\nleft = a.png\nright=b.png\r\ntruth = gt.png\n\nscale = 2.5\nmin_disparity = 4\n"
       "max_disparity = 30  # as built\nborder = 3\n");
  const auto read = readStereoScene(scene.string());
  ASSERT_TRUE(read) << read.status().message();
  EXPECT_FLOAT_EQ(read->truth.at<float>(9, 9), 20.0F);
  EXPECT_EQ(read->min_disparity_px, 4);
  EXPECT_EQ(read->max_disparity_px, 30);
  EXPECT_EQ(cv::countNonZero(read->all), 54 * 34);
}

TEST_F(StereoScenes, BadScenesAreRefusedInOneLine) {
  const fs::path scene = folder("s");
  expectRefused(scene, scene.string(), "no stereo scene");
  truth(scene / "disp1.png", 40, 370, 30);
  expectRefused(scene, "view1.png", "no such file");
  text(scene / "view1.png", "not a picture");
  expectRefused(scene, "view1.png", "not a picture");
  picture(scene / "view1.png", 40, 370);
  picture(scene / "view5.png", 41, 370);
  expectRefused(scene, "view5.png", "is 41x370, the left picture is 40x370");
  picture(scene / "view5.png", 40, 370);
  picture(scene / "nonocc.png", 40, 30);
  expectRefused(scene, "nonocc.png", "is 40x30");
  fs::remove(scene / "nonocc.png");
  truth(scene / "disp1.png", 40, 36, 30);
  expectRefused(scene, "disp1.png", "is 40x36");
  truth(scene / "disp1.png", 40, 370, 0);
  expectRefused(scene, "disp1.png", "no disparity in it is known");
  for (const char* line : {"scale = eight", "scale = -1", "colour = 3", "max_disparity = 3.5"}) {
    text(scene / "scene.txt", std::string(line) + "\n");
    expectRefused(scene, "scene.txt", line);
  }
  text(scene / "scene.txt", "just words\n");
  expectRefused(scene, "scene.txt", "key = value");
}

TEST_F(StereoScenes, RangeAndScaleMustBeKnown) {
  const fs::path scene = folder("s");
  picture(scene / "im0.png", 40, 3);
  picture(scene / "im1.png", 40, 3);
  picture(scene / "disp0.png", 40, 3, 30);
  expectRefused(scene, "disp0.png", "scale unknown");
  fs::remove(scene / "disp0.png");
  pfm(scene / "disp0.pfm", 40, 3, true, std::vector<float>(120, 7.5F));
  expectRefused(scene, scene.string(), "calib.txt (ndisp) or scene.txt (max_disparity)");
}

TEST_F(StereoScenes, FoundAtAnyDepthByName) {
  EXPECT_EQ(findStereoScenes((root_ / "absent").string()).status().code(), StatusCode::kIoError);
  const auto none = findStereoScenes(root_.string());
  EXPECT_EQ(none.status().code(), StatusCode::kNotEnoughData);
  EXPECT_NE(none.status().message().find(root_.string()), std::string::npos);
  for (const char* name : {"b/two", "a/deep/one", "c"}) {
    truth(folder(name) / "disp1.png", 4, 4, 30);
  }
  folder("d");
  const auto found = findStereoScenes(root_.string());
  ASSERT_TRUE(found);
  const std::vector<std::string> expected{(root_ / "a/deep/one").string(),
                                          (root_ / "b/two").string(), (root_ / "c").string()};
  EXPECT_EQ(*found, expected);
  EXPECT_EQ(findStereoScenes((root_ / "c").string())->size(), 1U);
}

fs::path dataFolder() {
  const char* given = std::getenv("SCANNER_DATA");
  return given != nullptr ? fs::path(given) : fs::path(SCANNER_SOURCE_DIR) / "../shared/data";
}

TEST(RealDataStereoScenes, EveryMiddleburySceneLoadsWithPlausibleRegions) {
  std::size_t scenes = 0, in_table = 0;
  for (const char* set : {"middlebury_v2", "middlebury_v3"}) {
    if (!fs::exists(dataFolder() / set)) GTEST_SKIP() << "no recording at " << dataFolder() / set;
    const auto found = findStereoScenes((dataFolder() / set).string());
    ASSERT_TRUE(found) << found.status().message();
    for (const std::string& folder : *found) {
      const auto scene = readStereoScene(folder);
      ASSERT_TRUE(scene) << scene.status().message();
      const auto pixels = static_cast<double>(scene->truth.total());
      const double all = cv::countNonZero(scene->all), nonocc = cv::countNonZero(scene->nonocc);
      const double disc = cv::countNonZero(scene->disc);
      EXPECT_GT(all, 0.75 * pixels) << folder;
      EXPECT_GT(nonocc, 0.75 * all) << folder;
      EXPECT_LT(nonocc, all) << folder;
      EXPECT_GT(disc, 0.05 * nonocc) << folder;
      EXPECT_LT(disc, 0.6 * nonocc) << folder;
      double low = 0.0, high = 0.0;
      cv::minMaxLoc(scene->truth, &low, &high, nullptr, nullptr, scene->all);
      EXPECT_LE(high, scene->max_disparity_px + 1.0) << folder;
      EXPECT_GT(high, 0.5 * scene->max_disparity_px) << folder;
      ++scenes;
      if (scene->in_version2_table) ++in_table;
    }
  }
  EXPECT_EQ(scenes, 18U);
  EXPECT_EQ(in_table, 4U);
}

TEST(RealDataStereoScenes, DerivedRegionsAgreeWithThePublishedOnes) {
  const fs::path folder = dataFolder() / "middlebury_v2" / "Tsukuba";
  if (!fs::exists(folder)) GTEST_SKIP() << "no recording at " << folder;
  const auto scene = readStereoScene(folder.string());
  ASSERT_TRUE(scene) << scene.status().message();
  ASSERT_FALSE(scene->nonocc_derived || scene->disc_derived);
  const auto agreement = [](const cv::Mat& a, const cv::Mat& b) {
    return static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b);
  };
  const cv::Mat nonocc = nonOccluded(scene->truth, {}) & scene->all;
  EXPECT_GT(agreement(nonocc, scene->nonocc), 0.999);
  const cv::Mat occluded = scene->all & ~scene->nonocc;
  const cv::Mat disc = nearDepthSteps(scene->truth, occluded, kStepGap, kStepWidth) & scene->nonocc;
  EXPECT_GT(agreement(disc, scene->disc), 0.999);
}

}  // namespace
}  // namespace scanner::evaluation
