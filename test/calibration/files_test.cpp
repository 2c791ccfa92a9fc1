#include "scanner/calibration/calibration_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <ostream>

#include "calibration/boards.h"
#include "support/temporary_folder.h"

namespace scanner::calibration {
namespace {

namespace fs = std::filesystem;

class Files : public ::testing::Test {
 protected:
  void touch(const std::string& name, const std::string& text = "") {
    const fs::path path(folder_ / name);
    fs::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  test::TemporaryFolder folder_;
};

/// Calibrated once for all tests; one view moved between the eyes.
const StereoCalibrationReport& sample() {
  static const StereoCalibrationReport report = [] {
    const boards::TrueRig rig = boards::usualRig();
    auto views = boards::chanceViews(rig, boards::usualBoard(), 9, 0.1, 21);
    for (cv::Point2f& p : views[3].right) p.y += 4.0f;
    StereoCalibrationOptions options;
    options.distortion = Distortion::kK1K2;
    return *calibrateStereo(views, boards::usualBoard(), rig.size, options, 2);
  }();
  return report;
}

struct Naming {
  const char *left, *right, *name;
};

std::ostream& operator<<(std::ostream& out, const Naming& naming) { return out << naming.left; }

class PairNames : public Files, public ::testing::WithParamInterface<Naming> {};

TEST_P(PairNames, AreFound) {
  const Naming& naming = GetParam();
  touch(naming.left);
  touch(naming.right);
  const PictureFolder found = findPicturePairs(folder_.path());
  ASSERT_EQ(found.pairs.size(), 1U);
  EXPECT_EQ(found.pairs[0].name, naming.name);
  EXPECT_EQ(found.pairs[0].left, folder_ / naming.left);
  EXPECT_EQ(found.pairs[0].right, folder_ / naming.right);
  EXPECT_TRUE(found.unpaired.empty());
}

INSTANTIATE_TEST_SUITE_P(
    All, PairNames,
    ::testing::Values(Naming{"left01.jpg", "right01.jpg", "*01.jpg"},
                      Naming{"board-l-7.PNG", "board-r-7.PNG", "board-*-7.PNG"},
                      Naming{"left/a.png", "right/a.png", "*/a.png"},
                      Naming{"cam0/data/5.pgm", "cam1/data/5.pgm", "*/data/5.pgm"},
                      Naming{"imageLeft3.tif", "imageRight3.tif", "image*3.tif"},
                      Naming{"L0001.bmp", "R0001.bmp", "*0001.bmp"}),
    [](const auto& naming) { return "n" + std::to_string(naming.index); });

TEST_F(Files, PairsComeInTheOrderOfTheirNumbersAndTheRestIsNamed) {
  for (const char* name : {"left10.png", "right10.png", "left9.png", "right9.png", "left11.png",
                           "readme.txt", "other.png", "right_of_left.png"}) {
    touch(name);
  }
  const PictureFolder found = findPicturePairs(folder_.path());
  ASSERT_EQ(found.pairs.size(), 2U);
  EXPECT_EQ(found.pairs[0].name, "*9.png");
  EXPECT_EQ(found.pairs[1].name, "*10.png");
  EXPECT_EQ(found.unpaired,
            (std::vector<std::string>{"left11.png", "other.png", "right_of_left.png"}));
}

TEST_F(Files, FolderThatCannotBeReadOrIsAmbiguousIsRefused) {
  EXPECT_THROW(findPicturePairs(folder_ / "absent"), ConfigurationError);
  touch("left1.png");
  touch("l1.png");
  EXPECT_THROW(findPicturePairs(folder_.path()), ConfigurationError);
}

TEST_F(Files, RigIsReadBackAsItWasCalibrated) {
  const std::string path = folder_ / "rig.yaml";
  writeRig(path, sample(), "");
  const Rig rig = loadRig(path);
  ASSERT_TRUE(rig.cameras);
  const StereoCalibration& c = sample().calibration;
  EXPECT_TRUE(validate(*rig.cameras));
  EXPECT_LT(rig.cameras->right.P(0, 3), 0.0);
  for (const auto& [read, written] :
       {std::pair(rig.cameras->left, c.left), std::pair(rig.cameras->right, c.right)}) {
    EXPECT_EQ(read.width, 640);
    EXPECT_EQ(read.height, 480);
    EXPECT_EQ(read.distortion_model, written.distortion_model);
    EXPECT_EQ(read.D, written.D);
    EXPECT_EQ(read.K, written.K);
    EXPECT_EQ(read.R, written.R);
    EXPECT_EQ(read.P, written.P);
  }
  // Level: the camera's z is forward (x), its y is down.
  EXPECT_TRUE((rig.T_base_camera * Eigen::Vector3d::UnitZ()).isApprox(Eigen::Vector3d::UnitX()));
  EXPECT_TRUE((rig.T_base_camera * Eigen::Vector3d::UnitY()).isApprox(-Eigen::Vector3d::UnitZ()));
  EXPECT_FALSE(fs::exists(path + ".part"));
}

TEST_F(Files, OtherEntriesOfARigAreKept) {
  touch("old.yaml",
        "T_base_link_bumblebee_left_optical:\n  translation: [0.05, 0.06, 0.01]\n"
        "  rotation_xyzw: [-0.5, 0.5, -0.5, 0.5]\n");
  const std::string path = folder_ / "new.yaml";
  writeRig(path, sample(), folder_ / "old.yaml");
  const Rig rig = loadRig(path);
  ASSERT_TRUE(rig.cameras);
  EXPECT_TRUE(rig.T_base_camera.translation().isApprox(Eigen::Vector3d(0.05, 0.06, 0.01)));
  EXPECT_THROW(writeRig(path, sample(), folder_ / "absent.yaml"), ConfigurationError);
  EXPECT_THROW(writeRig(folder_ / "absent/rig.yaml", sample(), ""), ConfigurationError);
}

TEST_F(Files, OptionsComeFromTheirBlock) {
  touch("a.yaml", "stereo: {}\ncalibration:\n  distortion: k1\n  min_views: 7\n");
  const auto options = loadCalibrationOptions(folder_ / "a.yaml");
  EXPECT_EQ(options.distortion, Distortion::kK1);
  EXPECT_EQ(options.min_views, 7);
  touch("b.yaml", "calibration:\n  min_vews: 7\n");
  try {
    loadCalibrationOptions(folder_ / "b.yaml");
    FAIL() << "not refused";
  } catch (const ConfigurationError& error) {
    EXPECT_NE(std::string(error.what()).find("min_vews"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("b.yaml"), std::string::npos) << error.what();
  }
}

TEST(Report, TextNamesWhatCounts) {
  const std::string text = reportText(sample());
  for (const char* word : {"8 of 9 used", "held-out", "epipolar", "baseline", "k1_k2", "keeps",
                           "warning", "view4", "left out", "chosen", "right cy", "rotation y"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in\n" << text;
  }
}

TEST(Report, JsonHoldsEveryResidual) {
  const auto json = nlohmann::json::parse(reportJson(sample()));
  EXPECT_EQ(json["rms_px"].get<double>(), sample().rms_px);
  EXPECT_EQ(json["baseline_m"].get<double>(), sample().calibration.baseline());
  ASSERT_EQ(json["views"].size(), 9U);
  EXPECT_FALSE(json["views"][3]["used"].get<bool>());
  EXPECT_TRUE(json["views"][4]["used"].get<bool>());
  const auto& view = sample().views[4];
  ASSERT_EQ(json["views"][4]["left_residual"].size(), view.left_residual.size());
  EXPECT_EQ(json["views"][4]["left_residual"][5][1].get<float>(), view.left_residual[5].y);
  EXPECT_GT(json["parameters"]["left fx"]["sigma"].get<double>(), 0.0);
  EXPECT_EQ(json["board"]["columns"].get<int>(), 9);
}

TEST(ReportPictures, RectifiedPairHasTheBoardInTheSameRows) {
  // Rows of the two halves' dark pixels: the board reaches from and to the same ones.
  const boards::TrueRig rig = boards::usualRig();
  const Board board = boards::usualBoard();
  const auto pose = boards::poseAt(board, {0.2, 0.1, 0.05}, {0.06, 0.02, 0.6});
  std::array<cv::Mat, 2> raw;
  for (int eye = 0; eye < 2; ++eye) {
    cv::Mat& picture = raw[static_cast<std::size_t>(eye)];
    picture = cv::Mat(rig.size, CV_8UC1, cv::Scalar(255));
    for (const cv::Point2f& p : boards::project(rig, eye, board, pose)) {
      cv::circle(picture, p, 3, cv::Scalar(0), cv::FILLED);
    }
  }
  const cv::Mat both = rectifiedPicture(raw[0], raw[1], sample().calibration);
  ASSERT_EQ(both.size(), cv::Size(1280, 480));
  ASSERT_EQ(both.type(), CV_8UC3);
  std::array<cv::Rect, 2> box;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    const cv::Mat half = both.colRange(eye == 0 ? 0 : 640, eye == 0 ? 640 : 1280);
    cv::Mat dark, labels;
    // The raw pictures' frame is black too: the middle only.
    cv::inRange(half(cv::Rect(60, 60, 520, 360)), cv::Scalar::all(0), cv::Scalar::all(40), dark);
    box[eye] = cv::boundingRect(dark);
  }
  EXPECT_GT(box[0].height, 80);
  EXPECT_NEAR(box[0].y, box[1].y, 1);
  EXPECT_NEAR(box[0].br().y, box[1].br().y, 1);
  EXPECT_GT(box[0].x, box[1].x + 50);
}

TEST(ReportPictures, ResidualsOfLeftOutViewsAreRed) {
  const cv::Mat picture = residualPicture(sample());
  ASSERT_EQ(picture.size(), cv::Size(2 * 2 * 640, 2 * 480));
  const auto colorAt = [&](cv::Point2f p) {
    return picture.at<cv::Vec3b>(cvRound(2.0f * (p.y + 0.5f)), cvRound(2.0f * (p.x + 0.5f)));
  };
  const cv::Vec3b out = colorAt(sample().views[3].left[0]);
  EXPECT_GT(out[2], out[1] + 50);
  const cv::Vec3b used = colorAt(sample().views[4].left[0]);
  EXPECT_GT(used[1], used[2] + 50);
}

}  // namespace
}  // namespace scanner::calibration
