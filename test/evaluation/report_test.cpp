#include "scanner/evaluation/report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace scanner::evaluation {
namespace {

using Json = nlohmann::ordered_json;

ReportView registeredView(int index) {
  ReportView view;
  view.index = index;
  view.stamp = fromNanoseconds(1'731'500'003'250'000'001 + index);
  view.registered = true;
  view.trial = 2;
  view.points = 1000;
  view.mean_distance_m = 0.001;
  return view;
}

ScanReport example() {
  ScanReport report;
  report.views = {registeredView(0), registeredView(1), registeredView(2)};
  report.views[1].registered = false;
  report.views[1].reason = "no trial converged";
  report.groups = 2;
  report.trials = {5, 122, 12, 10, 17, 6, 18, 0};
  report.prior_relative = {{0, 1, {8, 0, 0, 8, 0.05, 0.03, 0.04, 0}},
                           {1, 2, {10, 0, 0, 10, 0.15, 0.09, 0.12, 0}}};
  report.loop = {true, 0.001, 0.1};
  report.model = ReportModel{100, 200, 1, 0, 0, 0.002};
  report.time_s.total = 12.5;
  report.skipped = {{"imu_gap", 2}, {"frame_pair_incomplete", 1}};
  report.warnings = {"1 gap of 0.5 s in the inertial samples"};
  return report;
}

std::vector<std::string> keys(const Json& object) {
  std::vector<std::string> names;
  for (const auto& item : object.items()) names.push_back(item.key());
  return names;
}

TEST(Report, HasTheKeysThatStayStableInOrder) {
  const Json json = Json::parse(toJson(example()));
  EXPECT_EQ(keys(json), (std::vector<std::string>{"views", "groups", "trials", "prior", "truth",
                                                  "loop", "model", "time_s", "peak_memory_mb",
                                                  "warnings", "skipped", "tables"}));
  EXPECT_EQ(keys(json["trials"]),
            (std::vector<std::string>{"1", "2", "3", "4", "5", "6", "7", "8"}));
  EXPECT_EQ(keys(json["time_s"]), (std::vector<std::string>{"stereo", "inertial", "registration",
                                                            "global", "surface", "total"}));
  EXPECT_EQ(keys(json["model"]),
            (std::vector<std::string>{"vertices", "faces", "components", "boundary_edges",
                                      "non_manifold_edges", "mean_spacing_m"}));
  EXPECT_EQ(keys(json["loop"]), (std::vector<std::string>{"closed", "residual_m", "residual_deg"}));
}

TEST(Report, HoldsTheNumbers) {
  const Json json = Json::parse(toJson(example()));
  EXPECT_EQ(json["views"]["total"], 3);
  EXPECT_EQ(json["views"]["registered"], 2);
  EXPECT_EQ(json["views"]["discarded"], 1);
  EXPECT_EQ(json["views"]["discarded_views"][0]["index"], 1);
  EXPECT_EQ(json["views"]["discarded_views"][0]["stamp_ns"], 1'731'500'003'250'000'002);
  EXPECT_EQ(json["views"]["discarded_views"][0]["reason"], "no trial converged");
  EXPECT_EQ(json["trials"]["2"], 122);
  EXPECT_EQ(json["prior"]["relative"]["arc_deg"]["median"], 9.0);
  EXPECT_NEAR(json["prior"]["relative"]["rho_m"]["mean"].get<double>(), 0.1, 1e-12);
  EXPECT_EQ(json["skipped"]["imu_gap"], 2);
  EXPECT_EQ(json["tables"]["prior_relative"][1]["to"], 2);
  EXPECT_EQ(json["tables"]["views"].size(), 3u);
}

TEST(Report, WritesNullForWhatIsUnknownOrAbsent) {
  const Json json = Json::parse(toJson(ScanReport()));
  EXPECT_TRUE(json["truth"].is_null());
  EXPECT_TRUE(json["model"].is_null());
  EXPECT_TRUE(json["peak_memory_mb"].is_null());
  EXPECT_TRUE(json["loop"]["residual_m"].is_null());
  EXPECT_TRUE(json["prior"]["absolute"]["rho_m"]["median"].is_null());
  EXPECT_EQ(json["prior"]["absolute"]["rho_m"]["count"], 0);
  EXPECT_EQ(json["views"]["total"], 0);
  EXPECT_TRUE(json["skipped"].is_object());
  EXPECT_TRUE(json["warnings"].is_array());
}

TEST(Report, WritesTheTruthWhenThereIsOne) {
  ScanReport report = example();
  PoseErrors truth;
  truth.position_rmse_m = 0.002;
  truth.poses.resize(2);
  report.truth = truth;
  const Json json = Json::parse(toJson(report));
  EXPECT_EQ(json["truth"]["position_rmse_m"], 0.002);
  EXPECT_EQ(json["truth"]["compared"], 2);
}

TEST(Report, SurvivesTextThatIsNoUtf8AndIsReproducible) {
  ScanReport report = example();
  report.warnings.push_back("cannot read \xff\xfe.bag");
  const std::string text = toJson(report);
  EXPECT_NO_THROW(Json::parse(text));
  EXPECT_EQ(text, toJson(report));
  EXPECT_EQ(text.back(), '\n');
}

}  // namespace
}  // namespace scanner::evaluation
