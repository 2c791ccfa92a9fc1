#include "scanner/ros/bag_reader.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "ros/bag_writer.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/static_transforms.h"
#include "support/temporary_folder.h"

namespace scanner::bridge {
namespace {

class BagReaderTest : public testing::Test {
 protected:
  std::string write(const test::BagWriter& writer) {
    const std::string path = folder_ / "recording.bag";
    writer.write(path, rig_);
    return path;
  }
  /// Opens, and expects that to work.
  BagReader open(const test::BagWriter& writer) {
    Result<BagReader> bag = BagReader::open(write(writer), writer.topics);
    if (!bag) throw std::runtime_error(bag.status().message());
    return std::move(*bag);
  }
  static bool mentions(const std::vector<std::string>& lines, const std::string& text) {
    for (const std::string& line : lines) {
      if (line.find(text) != std::string::npos) return true;
    }
    return false;
  }
  static bool oneLine(const Status& status) {
    return !status.message().empty() && status.message().find('\n') == std::string::npos;
  }

  test::SyntheticRig rig_;
  test::TemporaryFolder folder_;
};

TEST_F(BagReaderTest, GivesEverythingInOrderOfTime) {
  BagReader bag = open({});
  ASSERT_TRUE(bag.checkScannable()) << bag.checkScannable().message();
  ASSERT_TRUE(bag.calibration());
  EXPECT_EQ(bag.calibration()->focalLength(), rig_.calibration().focalLength());
  EXPECT_NEAR(bag.calibration()->baseline(), rig_.calibration().baseline(), 1e-12);
  ASSERT_TRUE(bag.rig()) << bag.rig().status().message();
  EXPECT_TRUE(bag.rig()->T_base_camera.isApprox(rig_.rig().T_base_camera, 1e-9));
  EXPECT_EQ(bag.expectedFrames(), 3U);
  EXPECT_EQ(bag.transforms().added().size(), 2U);

  Time newest_sample;
  std::size_t frames = 0, samples = 0;
  BagHandlers handlers;
  handlers.imu = [&](const ImuSample& sample) {
    EXPECT_GT(sample.stamp, newest_sample);
    newest_sample = sample.stamp;
    ++samples;
    return true;
  };
  handlers.frame = [&](const StereoFrame& frame) {
    EXPECT_EQ(frame.stamp, test::SyntheticRig::stamp(0.5 * static_cast<double>(frames)));
    EXPECT_GE(newest_sample, frame.stamp);
    EXPECT_LT(newest_sample - frame.stamp, fromSeconds(0.011));
    const StereoFrame truth = rig_.frame(0.5 * static_cast<double>(frames));
    EXPECT_EQ(cv::norm(frame.left.data, truth.left.data, cv::NORM_INF), 0.0);
    EXPECT_EQ(cv::norm(frame.right.data, truth.right.data, cv::NORM_INF), 0.0);
    ++frames;
    return true;
  };
  const BagStatistics s = bag.play(handlers);
  EXPECT_EQ(frames, 3U);
  EXPECT_EQ(s.frames, 3U);
  EXPECT_EQ(s.imu.messages, samples);
  EXPECT_EQ(s.imu_oriented, samples);
  EXPECT_NEAR(s.imu.rate_hz, 100.0, 0.1);
  EXPECT_EQ(s.imu.gaps + s.unpaired_left + s.unpaired_right + s.unreadable, 0U);
  EXPECT_TRUE(s.notes.empty()) << s.notes.front();
  EXPECT_EQ(bag.groundTruth().size(), samples);
  EXPECT_TRUE(bag.groundTruth()[10].T_map_base.isApprox(rig_.pose(-0.2), 1e-9));
}

TEST_F(BagReaderTest, OtherTopicsAndFramesAreAMatterOfOptions) {
  test::BagWriter writer;
  writer.topics.left_image = "/cam0/image_raw";
  writer.topics.imu = "/imu0";
  writer.camera_frame = "cam0";
  BagReader bag = open(writer);
  EXPECT_TRUE(bag.checkScannable()) << bag.checkScannable().message();
  EXPECT_TRUE(bag.rig()->T_base_camera.isApprox(rig_.rig().T_base_camera, 1e-9));
}

TEST_F(BagReaderTest, AMissingTopicIsNamedWithWhatThereIs) {
  test::BagWriter writer;
  const std::string path = write(writer);
  Topics topics;
  topics.right_image = "/nowhere";
  Result<BagReader> bag = BagReader::open(path, topics);
  ASSERT_TRUE(bag);
  const Status status = bag->checkScannable();
  ASSERT_FALSE(status);
  EXPECT_TRUE(oneLine(status));
  EXPECT_NE(status.message().find("/nowhere"), std::string::npos);
  EXPECT_NE(status.message().find("/bumblebee/right/image_raw"), std::string::npos);
  topics = {};
  topics.imu = "/no_imu";
  EXPECT_NE(BagReader::open(path, topics)->checkScannable().message().find("/no_imu"),
            std::string::npos);
  topics = {};
  topics.left_info = "/no_info";
  EXPECT_NE(BagReader::open(path, topics)->checkScannable().message().find("/no_info"),
            std::string::npos);
}

TEST_F(BagReaderTest, WithoutTransformsTheRigIsUnknownAndSaidSo) {
  test::BagWriter writer;
  writer.transforms = false;
  BagReader bag = open(writer);
  EXPECT_TRUE(bag.checkScannable());
  ASSERT_FALSE(bag.rig());
  EXPECT_NE(bag.rig().status().message().find("/tf_static"), std::string::npos);
}

TEST_F(BagReaderTest, AWrongBaselineInCameraInfoIsRefused) {
  for (const double p3 : {0.0, 57.6}) {
    test::BagWriter writer;
    writer.info = [p3](int, bool left, sensor_msgs::CameraInfo& info) {
      if (!left) info.P[3] = p3;
      return true;
    };
    BagReader bag = open(writer);
    const Status status = bag.checkScannable();
    ASSERT_FALSE(status);
    EXPECT_TRUE(oneLine(status));
    EXPECT_NE(status.message().find("P[3]"), std::string::npos) << status.message();
    EXPECT_FALSE(bag.calibration());
  }
}

TEST_F(BagReaderTest, ASizeOtherThanCameraInfosIsRefused) {
  test::BagWriter writer;
  writer.info = [](int, bool, sensor_msgs::CameraInfo& info) { return info.width = 400, true; };
  BagReader bag = open(writer);
  const Status status = bag.checkScannable();
  ASSERT_FALSE(status);
  EXPECT_NE(status.message().find("400x240"), std::string::npos) << status.message();
  EXPECT_EQ(bag.play({}).left.unusable, 3U);
}

TEST_F(BagReaderTest, UnequalStampsAreCountedAndNamed) {
  test::BagWriter writer;
  writer.image = [](int frame, bool left, sensor_msgs::Image& image) {
    if (frame == 1 && !left) image.header.stamp += ros::Duration(0.001);
    return true;
  };
  BagReader bag = open(writer);
  const BagStatistics s = bag.play({});
  EXPECT_EQ(s.frames, 2U);
  EXPECT_EQ(s.unpaired_left, 1U);
  EXPECT_EQ(s.unpaired_right, 1U);
  EXPECT_TRUE(mentions(s.notes, "without a partner"));
}

TEST_F(BagReaderTest, TimeGoingBackwardsIsSkippedAndCounted) {
  test::BagWriter writer;
  writer.imu = [](int i, sensor_msgs::Imu& imu) {
    if (i == 50 || i == 60) imu.header.stamp -= ros::Duration(0.2);
    return true;
  };
  writer.image = [](int frame, bool, sensor_msgs::Image& image) {
    if (frame == 2) image.header.stamp -= ros::Duration(0.7);
    return true;
  };
  BagReader bag = open(writer);
  Time newest;
  BagHandlers handlers;
  handlers.imu = [&](const ImuSample& sample) {
    EXPECT_GT(sample.stamp, newest);
    newest = sample.stamp;
    return true;
  };
  const BagStatistics s = bag.play(handlers);
  EXPECT_EQ(s.imu.backward, 2U);
  EXPECT_EQ(s.left.backward, 1U);
  EXPECT_EQ(s.frames, 2U);
  EXPECT_TRUE(mentions(s.notes, "is not after"));
}

TEST_F(BagReaderTest, AnImuGapIsCounted) {
  test::BagWriter writer;
  writer.imu = [](int i, sensor_msgs::Imu&) { return i < 40 || i > 80; };
  BagReader bag = open(writer);
  const BagStatistics s = bag.play({});
  EXPECT_EQ(s.imu.gaps, 1U);
  EXPECT_NEAR(s.imu.longest_gap_s, 0.42, 1e-3);
  EXPECT_EQ(s.frames, 3U);
  EXPECT_TRUE(mentions(s.notes, "gaps"));
}

TEST_F(BagReaderTest, UnusableMessagesAreSkippedAndCounted) {
  test::BagWriter writer;
  writer.imu = [](int i, sensor_msgs::Imu& imu) {
    if (i == 5) imu.linear_acceleration.z = std::numeric_limits<double>::quiet_NaN();
    return true;
  };
  writer.image = [](int frame, bool left, sensor_msgs::Image& image) {
    if (frame == 1 && left) image.encoding = "mono16";
    return true;
  };
  writer.info = [](int frame, bool, sensor_msgs::CameraInfo&) { return frame != 2; };
  BagReader bag = open(writer);
  const BagStatistics s = bag.play({});
  EXPECT_EQ(s.imu.unusable, 1U);
  EXPECT_EQ(s.left.unusable, 1U);
  EXPECT_EQ(s.frames, 2U);
  EXPECT_EQ(s.unpaired_right, 1U);
  EXPECT_EQ(s.images_without_info, 1U);
  EXPECT_TRUE(mentions(s.notes, "mono16"));
}

TEST_F(BagReaderTest, AHandlerCanEndTheReading) {
  BagReader bag = open({});
  BagHandlers handlers;
  handlers.frame = [](const StereoFrame&) { return false; };
  EXPECT_EQ(bag.play(handlers).frames, 1U);
  EXPECT_EQ(bag.play({}).frames, 3U);  // and it can be played again
}

TEST_F(BagReaderTest, FilesThatAreNoBagsGiveOneLine) {
  const std::string text = folder_ / "text.bag";
  std::ofstream(text) << "this is no bag";
  const std::string empty = folder_ / "empty.bag";
  std::ofstream{empty};
  for (const std::string& path : {folder_ / "absent.bag", text, empty, folder_.path()}) {
    const Result<BagReader> bag = BagReader::open(path);
    ASSERT_FALSE(bag) << path;
    EXPECT_EQ(bag.status().code(), StatusCode::kIoError);
    EXPECT_TRUE(oneLine(bag.status())) << bag.status().message();
    EXPECT_NE(bag.status().message().find(path), std::string::npos);
  }
}

TEST_F(BagReaderTest, ATruncatedBagPointsToReindex) {
  const std::string path = write({});
  const auto size = std::filesystem::file_size(path);
  for (const double share : {0.2, 0.5, 0.9, 0.999}) {
    const std::string cut = folder_ / "cut.bag";
    std::filesystem::copy_file(path, cut, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(cut,
                                 static_cast<std::uintmax_t>(share * static_cast<double>(size)));
    const Result<BagReader> bag = BagReader::open(cut);
    ASSERT_FALSE(bag) << share;
    EXPECT_TRUE(oneLine(bag.status())) << bag.status().message();
    EXPECT_NE(bag.status().message().find("rosbag reindex"), std::string::npos)
        << bag.status().message();
  }
}

TEST_F(BagReaderTest, ABagWithoutIndexPointsToReindex) {
  const std::string path = write({});
  // What a recorder that was killed leaves: an index position of 0 in the file header.
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  std::string start(256, '\0');
  file.read(start.data(), 256);
  const auto at = start.find("index_pos=");
  ASSERT_NE(at, std::string::npos);
  file.seekp(static_cast<std::streamoff>(at + 10));
  file.write("\0\0\0\0\0\0\0\0", 8);
  file.close();
  const Result<BagReader> bag = BagReader::open(path);
  ASSERT_FALSE(bag);
  EXPECT_NE(bag.status().message().find("no index"), std::string::npos) << bag.status().message();
}

TEST_F(BagReaderTest, ACorruptStretchCostsOnlyWhatIsInIt) {
  const std::string path = folder_ / "packed.bag";
  {
    rosbag::Bag bag(path, rosbag::bagmode::Write);
    bag.setCompression(rosbag::compression::BZ2);
    bag.setChunkThreshold(4096);
    for (int i = 0; i < 400; ++i) {
      const sensor_msgs::Imu imu = toRos(rig_.imu(0.01 * i), "base_link");
      bag.write("/mti/imu/data", imu.header.stamp, imu);
    }
    bag.close();
  }
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(path) / 3));
  file << std::string(64, 'x');
  file.close();
  Result<BagReader> bag = BagReader::open(path);
  ASSERT_TRUE(bag) << bag.status().message();
  const BagStatistics s = bag->play({});
  EXPECT_GT(s.unreadable, 0U);
  EXPECT_GT(s.imu.messages, 200U);
  EXPECT_EQ(s.unreadable + s.imu.messages, 400U);
  EXPECT_TRUE(mentions(s.notes, "cannot be read"));
}

}  // namespace
}  // namespace scanner::bridge
