#include "scanner/core/trajectory_io.h"

#include <gtest/gtest.h>

#include <fstream>

#include "support/temporary_folder.h"

namespace scanner {
namespace {

Trajectory shortTrajectory() {
  return {{fromNanoseconds(1731500000000000001), makePose({1, 2, 3}, expSo3({0.1, 0, 0}))},
          {fromNanoseconds(1731500001000000002), makePose({2, 2, 3}, expSo3({0.3, 0, 0}))}};
}

TEST(Tum, RoundTripKeepsNanosecondsAndPoses) {
  const test::TemporaryFolder folder;
  const Trajectory written = shortTrajectory();
  ASSERT_TRUE(writeTum(folder / "t.tum", written));
  const Result<Trajectory> read = readTum(folder / "t.tum");
  ASSERT_TRUE(read) << read.status().message();
  ASSERT_EQ(read->size(), 2U);
  EXPECT_EQ((*read)[0].stamp, written[0].stamp);
  EXPECT_TRUE((*read)[1].T_map_base.isApprox(written[1].T_map_base, 1e-8));
}

TEST(Tum, ErrorsNameFileAndLine) {
  const test::TemporaryFolder folder;
  const std::string good = "1.0 0 0 0 0 0 0 1\n";
  for (const std::string& bad :
       {std::string("1.0 0 0 0 0 0 0 2\n"), std::string("2.0 0 0 nan 0 0 0 1\n"),
        std::string("2.0 0 0 0 0 0 1\n"), std::string("x 0 0 0 0 0 0 1\n"),
        std::string("0.5 0 0 0 0 0 0 1\n"), std::string("2.0 0 0 0 0 0 0 1 9\n")}) {
    std::ofstream(folder / "t.tum") << "# comment\n" << good << bad;
    const Result<Trajectory> read = readTum(folder / "t.tum");
    ASSERT_FALSE(read) << bad;
    EXPECT_NE(read.status().message().find("t.tum:3:"), std::string::npos)
        << read.status().message();
  }
  EXPECT_EQ(readTum(folder / "absent").status().code(), StatusCode::kIoError);
}

TEST(PoseAt, InterpolatesInsideAndRefusesOutside) {
  const Trajectory t = shortTrajectory();
  const Duration second = fromSeconds(1.5);
  const auto middle = poseAt(t, t[0].stamp + fromSeconds(0.5), second);
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->translation().x(), 1.5, 1e-6);
  EXPECT_TRUE(poseAt(t, t[1].stamp, second));
  EXPECT_EQ(poseAt(t, t[0].stamp - fromSeconds(0.1), second).status().code(),
            StatusCode::kOutOfRange);
  EXPECT_EQ(poseAt(t, t[1].stamp + fromSeconds(0.1), second).status().code(),
            StatusCode::kOutOfRange);
  EXPECT_EQ(poseAt(t, t[0].stamp + fromSeconds(0.5), fromSeconds(0.2)).status().code(),
            StatusCode::kOutOfRange);
  EXPECT_FALSE(poseAt({}, t[0].stamp, second));
}

TEST(TimeConversion, RoundsToTheNearestNanosecond) {
  EXPECT_EQ(fromSeconds(1e-9 * 2.6).count(), 3);
  EXPECT_EQ(fromSeconds(-1e-9 * 2.6).count(), -3);
  EXPECT_DOUBLE_EQ(toSeconds(Duration(1500000000)), 1.5);
}

}  // namespace
}  // namespace scanner
