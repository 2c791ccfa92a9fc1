#include "scanner/ros/euroc_import.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "scanner/ros/bag_reader.h"
#include "support/temporary_folder.h"

namespace scanner::bridge {
namespace {

namespace fs = std::filesystem;

std::string contents(const std::string& path) {
  std::ostringstream out;
  out << std::ifstream(path, std::ios::binary).rdbuf();
  return out.str();
}

/// A tiny ASL folder: two pairs 0.1 s apart, 3 s of samples, truth; cameras 0.1 m apart, upright.
class EurocImportTest : public testing::Test {
 protected:
  EurocImportTest() {
    camera("cam0", 0.0);
    camera("cam1", 0.1);
    text("imu0/sensor.yaml", "%YAML:1.0\nsensor_type: imu\n" + extrinsics(0.0, false));
    std::string samples = "#timestamp,wx,wy,wz,ax,ay,az\n";
    for (int i = 0; i < 300; ++i) {
      samples += std::to_string(stamp(0.01 * i)) + ",0.1,0.2,0.3,0,0,9.81\r\n";
    }
    text("imu0/data.csv", samples);
    text("state_groundtruth_estimate0/sensor.yaml", "%YAML:1.0\n" + extrinsics(0.0, false));
    std::string truth = "#timestamp,p,q\n";
    for (int i = 0; i < 60; ++i) {
      truth += std::to_string(stamp(0.05 * i)) + ",1,2,3,0.5,0.5,-0.5,0.5,0,0,0\n";
    }
    text("state_groundtruth_estimate0/data.csv", truth);
  }

  static std::int64_t stamp(double seconds) {
    return 1403715273000000000LL + static_cast<std::int64_t>(seconds * 1e9 + 0.5);
  }
  /// Cameras look along body x: optical z = body x, optical x = -body y.
  static std::string extrinsics(double right_m, bool optical) {
    const std::string r = optical ? "0, 0, 1, 0, -1, 0, 0, " : "1, 0, 0, 0, 0, 1, 0, ";
    return "T_BS:\n  cols: 4\n  rows: 4\n  data: [" + r + std::to_string(-right_m) +
           (optical ? ", 0, -1, 0, 0" : ", 0, 0, 1, 0") + ", 0, 0, 0, 1]\n";
  }
  void camera(const std::string& name, double right_m) {
    text(name + "/sensor.yaml",
         "%YAML:1.0\n# comment\n" + extrinsics(right_m, true) +
             "resolution: [64, 48]\ncamera_model: pinhole\nintrinsics: [50, 50, 31.5, 23.5]\n"
             "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n");
    std::string list = "#timestamp,filename\n";
    for (const double seconds : {1.5, 1.6}) {
      const std::string file = std::to_string(stamp(seconds)) + ".png";
      list += std::to_string(stamp(seconds)) + "," + file + "\n";
      fs::create_directories(folder_ / ("mav0/" + name + "/data"));
      cv::imwrite(folder_ / ("mav0/" + name + "/data/" + file), cv::Mat(48, 64, CV_8UC1, 77));
    }
    text(name + "/data.csv", list);
  }
  void text(const std::string& name, const std::string& content) {
    const fs::path path = folder_ / ("mav0/" + name);
    fs::create_directories(path.parent_path());
    std::ofstream(path) << content;
  }
  Status import(const EurocOptions& options = {}) {
    const Result<EurocSummary> result = importEuroc(folder_.path(), bag_, options);
    if (result) summary_ = *result;
    return result.status();
  }

  test::TemporaryFolder folder_;
  std::string bag_ = folder_ / "out.bag";
  EurocSummary summary_;
};

TEST_F(EurocImportTest, WritesWhatTheReaderWants) {
  const Status status = import();
  ASSERT_TRUE(status) << status.message();
  EXPECT_EQ(summary_.pairs, 2U);
  EXPECT_NEAR(summary_.baseline_m, 0.1, 1e-9);
  Result<BagReader> bag = BagReader::open(bag_);
  ASSERT_TRUE(bag) << bag.status().message();
  ASSERT_TRUE(bag->checkScannable()) << bag->checkScannable().message();
  EXPECT_LT(bag->calibration()->right.P(0, 3), 0.0);
  ASSERT_TRUE(bag->rig());
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  EXPECT_TRUE(bag->rig()->T_base_camera.linear().isApprox(R, 1e-9));
  BagHandlers handlers;
  handlers.frame = [](const StereoFrame& frame) {
    EXPECT_EQ(frame.left.format, PixelFormat::kMono8);
    EXPECT_EQ(frame.left.data.at<std::uint8_t>(0, 0), 77);
    return true;
  };
  handlers.imu = [](const ImuSample& sample) {
    EXPECT_FALSE(sample.orientation.has_value());
    EXPECT_EQ(sample.linear_acceleration, Eigen::Vector3d(0, 0, 9.81));
    return true;
  };
  const BagStatistics s = bag->play(handlers);
  EXPECT_EQ(s.frames, 2U);
  EXPECT_EQ(s.imu.messages, summary_.imu_samples);
  EXPECT_EQ(s.left.first, fromNanoseconds(stamp(1.5)));
  // All samples before the images, and a second after them.
  EXPECT_EQ(s.imu.first, fromNanoseconds(stamp(0.0)));
  EXPECT_EQ(s.imu.last, fromNanoseconds(stamp(2.6)));
  EXPECT_EQ(s.ground_truth.first, fromNanoseconds(stamp(0.5)));
  ASSERT_FALSE(bag->groundTruth().empty());
  const Eigen::Isometry3d& T = bag->groundTruth().front().T_map_base;
  EXPECT_TRUE(T.translation().isApprox(Eigen::Vector3d(1, 2, 3)));
  EXPECT_TRUE(Eigen::Quaterniond(T.linear()).isApprox(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5)));
}

TEST_F(EurocImportTest, SameInputSameBytes) {
  ASSERT_TRUE(import());
  const std::string first = contents(bag_);
  ASSERT_TRUE(import());
  EXPECT_EQ(first, contents(bag_));
  EurocOptions whole;
  whole.limit_to_images = false;
  ASSERT_TRUE(import(whole));
  EXPECT_EQ(summary_.imu_samples, 300U);
}

TEST_F(EurocImportTest, BadInputGivesOneLineAndNoBag) {
  const auto refused = [this](const std::string& word) {
    const Status status = import();
    EXPECT_FALSE(status) << word;
    EXPECT_EQ(status.message().find('\n'), std::string::npos);
    EXPECT_NE(status.message().find(word), std::string::npos) << status.message();
    EXPECT_FALSE(fs::exists(bag_));
    EXPECT_FALSE(fs::exists(bag_ + ".active"));
  };
  const std::string samples = contents(folder_ / "mav0/imu0/data.csv");
  text("imu0/data.csv", samples + "12,0,0,0,0,0,9.81\n");
  refused("data.csv:302: time 12 is not after");
  text("imu0/data.csv", "#\n1403715273000000000,0,nan,0,0,0,9.81\n");
  refused("'nan' is not a finite number");
  text("imu0/data.csv", "1403715273000000000,0\n");
  refused("needs 7 fields, has 2");
  text("imu0/data.csv", samples);
  const std::string file = "mav0/cam1/data/" + std::to_string(stamp(1.6)) + ".png";
  cv::imwrite(folder_ / file, cv::Mat(10, 10, CV_8UC1, 1));
  refused("size differs");
  std::ofstream(folder_ / file) << "no picture";
  refused("no readable picture");
  text("cam1/sensor.yaml", "%YAML:1.0\ncamera_model: omni\n");
  refused("'omni'");
  fs::remove_all(folder_ / "mav0/cam1");
  refused("not an ASL folder");
}

TEST_F(EurocImportTest, InterruptionAndAPlaceThatCannotBeWrittenLeaveNothing) {
  const auto stopped =
      importEuroc(folder_.path(), bag_, {}, [](std::size_t, std::size_t) { return false; });
  ASSERT_FALSE(stopped);
  EXPECT_NE(stopped.status().message().find("interrupted"), std::string::npos);
  EXPECT_FALSE(fs::exists(bag_));
  bag_ = folder_ / "no/such/folder/out.bag";
  const Status status = import();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.code(), StatusCode::kIoError);
}

TEST(RealDataEuroc, IsImportedAndScannable) {
  const char* data = std::getenv("SCANNER_DATA");
  const std::string root = data ? data : SCANNER_SOURCE_DIR "/../shared/data";
  if (!fs::exists(root + "/euroc_v1_01/mav0")) GTEST_SKIP() << "SKIPPED: no " << root;
  const test::TemporaryFolder folder;
  const Result<EurocSummary> summary =
      importEuroc(root + "/euroc_v1_01/mav0", folder / "euroc.bag");
  ASSERT_TRUE(summary) << summary.status().message();
  EXPECT_EQ(summary->pairs, 48U);
  EXPECT_EQ(summary->unpaired, 0U);
  EXPECT_NEAR(summary->baseline_m, 0.110, 0.001);
  Result<BagReader> bag = BagReader::open(folder / "euroc.bag");
  ASSERT_TRUE(bag);
  EXPECT_TRUE(bag->checkScannable());
  const BagStatistics s = bag->play({});
  EXPECT_EQ(s.frames, 48U);
  EXPECT_TRUE(s.notes.empty());
  EXPECT_NEAR(s.imu.rate_hz, 200.0, 1.0);
}

}  // namespace
}  // namespace scanner::bridge
