#include "scanner/registration/scan_set.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "registration/synthetic.h"
#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"
#include "scanner/registration/normals.h"

namespace scanner::registration {
namespace {

namespace fs = std::filesystem;
using synthetic::kDegree;

fs::path temporaryFolder(const std::string& name) {
  const fs::path folder = fs::temp_directory_path() / ("scanner_registration_" + name);
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

void writeText(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }

// Eight scans round the body from all sides.
synthetic::Orbit fewScans() {
  synthetic::Orbit o = synthetic::makeOrbit(8, 96, 72, 0.0003);
  return o;
}

TEST(ScanSet, ReturnsDisturbedScansToTheTruth) {
  const synthetic::Orbit o = fewScans();
  const auto initial = disturbed(o.truth, 4.0 * kDegree, 0.005, 3);
  EXPECT_EQ(initial[0].matrix(), o.truth[0].matrix());
  // About the sensor 0.75 m away, 4 deg move the surface by 5 cm: more than a third of the scan.
  RegistrationOptions options = scanSetOptions();
  options.global.loop_drift_m = 0.08;
  const auto outcome = registerScans(o.views, initial, options, 2, 1);
  ASSERT_TRUE(outcome) << outcome.status().message();
  for (std::size_t i = 0; i < 8; ++i) {
    const ScanOutcome& scan = outcome->scans[i];
    ASSERT_TRUE(scan.registered) << i << ": " << scan.reason;
    const Eigen::Isometry3d E = o.truth[i].inverse() * scan.T_map_scan;
    EXPECT_LT(rotationAngle(E) / kDegree, 0.2) << i;
    EXPECT_LT((E.translation()).norm(), 0.002) << i;
  }
  const auto again = registerScans(o.views, initial, options, 1, 1);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(again->scans[i].T_map_scan.matrix(), outcome->scans[i].T_map_scan.matrix());
  }
}

TEST(ScanSet, LoneAndEmptyScansAreReported) {
  synthetic::Orbit o = fewScans();
  o.views.resize(3);
  o.truth.resize(3);
  o.views.push_back(std::make_shared<View>());
  o.truth.push_back(Eigen::Isometry3d::Identity());
  o.views.push_back(o.views[0]);
  o.truth.push_back(synthetic::lookAt({50, 50, 0}, {60, 60, 0}));
  const auto outcome = registerScans(o.views, o.truth, scanSetOptions(), 2, 1);
  ASSERT_TRUE(outcome);
  EXPECT_TRUE(outcome->scans[1].registered) << outcome->scans[1].reason;
  EXPECT_FALSE(outcome->scans[3].registered);
  EXPECT_EQ(outcome->scans[3].reason, "fewer than 50 points");
  EXPECT_FALSE(outcome->scans[4].registered);
  EXPECT_FALSE(outcome->scans[4].reason.empty());
  EXPECT_EQ(registerScans(o.views, {}, scanSetOptions(), 1, 1).status().code(),
            StatusCode::kInvalidInput);
  EXPECT_EQ(registerScans({}, {}, scanSetOptions(), 1, 1).status().code(),
            StatusCode::kNotEnoughData);
}

TEST(ScanSet, StanfordConfTurnsTheOtherWay) {
  const fs::path folder = temporaryFolder("conf");
  const std::string path = (folder / "a.conf").string();
  // 90 deg about z in the file: p_ref = R(q)^T p + t takes x to -y.
  writeText(path, "camera 0 0 0\nbmesh a.ply 1 2 3 0 0 0.70710678 0.70710678\n");
  const auto poses = readStanfordConf(path);
  ASSERT_TRUE(poses) << poses.status().message();
  const Eigen::Vector3d p = poses->at("a.ply") * Eigen::Vector3d::UnitX();
  EXPECT_TRUE(p.isApprox(Eigen::Vector3d(1, 1, 3), 1e-6));
  const auto missing = readPriors(path, {"x/a.ply", "x/b.ply"});
  EXPECT_NE(missing.status().message().find("b.ply"), std::string::npos);
  writeText(path, "bmesh a.ply 1 2 nan 0 0 0 1\n");
  EXPECT_NE(readStanfordConf(path).status().message().find(":1:"), std::string::npos);
  EXPECT_EQ(readStanfordConf("no/such.conf").status().code(), StatusCode::kIoError);
}

TEST(ScanSet, CommandWritesItsFilesAndNamesBadInput) {
  const fs::path folder = temporaryFolder("command");
  const synthetic::Orbit o = fewScans();
  RegisterScansArguments arguments;
  Trajectory priors;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string file = (folder / ("scan" + std::to_string(i) + ".ply")).string();
    ASSERT_TRUE(writePly(file, o.views[i]->cloud));
    arguments.files.push_back(file);
    priors.push_back({Time(fromSeconds(static_cast<double>(i))), o.truth[i]});
  }
  arguments.prior = (folder / "priors.tum").string();
  ASSERT_TRUE(writeTum(arguments.prior, priors));
  arguments.out = (folder / "out").string();
  const auto summary = runRegisterScans(arguments);
  ASSERT_TRUE(summary) << summary.status().message();
  EXPECT_NE(summary->find("3 of 3 scans registered"), std::string::npos);
  for (const char* name : {"cloud.ply", "poses.tum", "poses.json", "scans/scan2.ply"}) {
    EXPECT_TRUE(fs::exists(fs::path(arguments.out) / name)) << name;
  }
  arguments.files.push_back((folder / "missing.ply").string());
  EXPECT_EQ(runRegisterScans(arguments).status().code(), StatusCode::kInvalidInput);
  arguments.config = (folder / "no.yaml").string();
  EXPECT_THROW(runRegisterScans(arguments), ConfigurationError);
}

struct RealSet {
  std::vector<std::shared_ptr<const View>> scans;
  std::vector<Eigen::Isometry3d> truth;
};

RealSet loadStanford(const fs::path& folder, const std::string& conf) {
  RealSet set;
  const auto poses = readStanfordConf((folder / conf).string());
  if (!poses) return set;
  for (const auto& [name, pose] : *poses) {
    auto mesh = readPly((folder / name).string());
    if (!mesh) continue;
    auto view = std::make_shared<View>();
    view->cloud.points = mesh->vertices.points;
    estimateNormalsTowards(view->cloud, 16, Eigen::Vector3d::UnitZ(), 2);
    view->cloud = finitePoints(view->cloud, true);
    set.scans.push_back(view);
    set.truth.push_back(pose);
  }
  return set;
}

TEST(RealDataScanSet, TenBunnyScans) {
  const char* given = std::getenv("SCANNER_DATA");
  const fs::path data = given != nullptr ? given : SCANNER_SOURCE_DIR "/../shared/data";
  const fs::path folder = data / "stanford/bunny";
  if (!fs::exists(folder)) GTEST_SKIP() << "no recordings in " << folder;
  const RealSet set = loadStanford(folder, "bun.conf");
  ASSERT_EQ(set.scans.size(), 10U);
  for (std::uint64_t seed : {1U, 2U}) {
    const auto initial = disturbed(set.truth, 4.0 * kDegree, 0.005, seed);
    const auto outcome = registerScans(set.scans, initial, scanSetOptions(), 2, seed);
    ASSERT_TRUE(outcome) << outcome.status().message();
    int good = 0;
    for (std::size_t i = 0; i < set.truth.size(); ++i) {
      const Eigen::Isometry3d E = set.truth[i].inverse() * outcome->scans[i].T_map_scan;
      good += outcome->scans[i].registered && E.translation().norm() < 1e-3 &&
                      rotationAngle(E) < 0.5 * kDegree
                  ? 1
                  : 0;
    }
    EXPECT_GE(good, 9) << "seed " << seed;
  }
}

}  // namespace
}  // namespace scanner::registration
