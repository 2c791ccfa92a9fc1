#include "scanner/pipeline/scan_folder.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "scanner/core/ply.h"
#include "support/temporary_folder.h"

namespace scanner::pipeline {
namespace {

namespace fs = std::filesystem;

View oneView(int index) {
  View view;
  view.index = index;
  view.cloud.points = {{1, 2, 3}};
  view.cloud.normals = {{0, 0, 1}};
  return view;
}

TEST(ScanFolder, NamesFilesAsDocumented) {
  const test::TemporaryFolder place;
  ScanFolder folder(place / "scan");
  ASSERT_TRUE(folder.writeView(oneView(7)));
  ASSERT_TRUE(folder.writeGroup(12, oneView(0).cloud));
  ASSERT_TRUE(folder.writeText("report.json", "{}"));
  EXPECT_TRUE(fs::exists(place / "scan/views/view_007.ply"));
  EXPECT_TRUE(fs::exists(place / "scan/groups/group_012.ply"));
  EXPECT_TRUE(fs::exists(place / "scan/report.json"));
}

TEST(ScanFolder, ASecondScanLeavesNothingOfALongerFirstOne) {
  const test::TemporaryFolder place;
  {
    ScanFolder first(place / "scan");
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(first.writeView(oneView(i)));
  }
  ScanFolder second(place / "scan");
  ASSERT_TRUE(second.writeView(oneView(0)));
  EXPECT_TRUE(fs::exists(place / "scan/views/view_002.ply"));  // until the scan is complete
  second.removeLeftovers();
  EXPECT_TRUE(fs::exists(place / "scan/views/view_000.ply"));
  EXPECT_FALSE(fs::exists(place / "scan/views/view_002.ply"));
}

TEST(ScanFolder, ASecondScanLeavesNoPicturesAndNoEvaluationOfTheFirst) {
  const test::TemporaryFolder place;
  ASSERT_TRUE(ScanFolder(place / "scan").writePicture(3, "left", "jpeg"));
  std::ofstream(place / "scan/deviation.json") << "{}";
  ScanFolder second(place / "scan");
  ASSERT_TRUE(second.writePicture(4, "left", "jpeg"));
  second.removeLeftovers();
  EXPECT_FALSE(fs::exists(place / "scan/pictures/view_003_left.jpg"));
  EXPECT_TRUE(fs::exists(place / "scan/pictures/view_004_left.jpg"));
  EXPECT_FALSE(fs::exists(place / "scan/deviation.json"));
}

TEST(ScanFolder, AnUnwritablePlaceIsRefusedAndNamed) {
  const test::TemporaryFolder place;
  std::ofstream(place / "file") << "in the way";
  try {
    const ScanFolder folder(place / "file");
    FAIL() << "a file was accepted as folder";
  } catch (const ConfigurationError& error) {
    EXPECT_NE(std::string(error.what()).find(place / "file"), std::string::npos) << error.what();
  }
  std::string kept;
  std::getline(std::ifstream(place / "file") >> std::ws, kept);
  EXPECT_EQ(kept, "in the way");
}

}  // namespace
}  // namespace scanner::pipeline
