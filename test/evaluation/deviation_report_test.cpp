#include "scanner/evaluation/deviation_report.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "evaluation/deviation_pictures.h"
#include "evaluation/shapes.h"

namespace scanner::evaluation {
namespace {

using Json = nlohmann::json;

DeviationReport sampleReport() {
  DeviationReport report;
  report.model = "model.ply";
  report.reference = "reference.ply";
  report.placement = Placement::kBestFit;
  report.deviation.signed_m = {0.001F, -0.001F, 0.0005F, 0.5F};
  static_cast<DeviationStatistics&>(report.deviation) =
      deviationStatistics(report.deviation.signed_m, 0.025);
  report.deviation.coverage = 0.75;
  report.deviation.alignment.translation() << 1.0, 2.0, 3.0;
  report.range_m = 0.001;
  report.views.rows = {{0, deviationStatistics({0.001F, -0.001F}, 0.025)},
                       {2, deviationStatistics({0.003F, -0.002F}, 0.025)}};
  report.views.together = deviationStatistics({0.001F, -0.001F, 0.003F, -0.002F}, 0.025);
  return report;
}

TEST(DeviationReport, HasTheKeysOfTheDesign) {
  const Json json = Json::parse(toJson(sampleReport()));
  for (const char* key : {"max_m", "min_m", "mean_positive_m", "mean_negative_m", "mean_m",
                          "sigma_m", "rmse_m", "median_absolute_m", "p95_absolute_m", "coverage"}) {
    EXPECT_TRUE(json.at(key).is_number()) << key;
  }
  EXPECT_EQ(json["points"], 3);
  EXPECT_EQ(json["outliers"], 1);
  EXPECT_EQ(json["placement"], "best_fit");
  EXPECT_EQ(json["alignment"].size(), 4u);
  EXPECT_EQ(json["alignment"][1][3], 2.0);
  EXPECT_EQ(json["alignment"][3], Json({0.0, 0.0, 0.0, 1.0}));
  EXPECT_TRUE(json["first_pose"].is_null());
}

TEST(DeviationReport, TablesEndInMedianMeanSigmaAndModel) {
  const Json json = Json::parse(toJson(sampleReport()));
  ASSERT_EQ(json["tables"]["views"].size(), 2u);
  EXPECT_EQ(json["tables"]["views"][1]["index"], 2);
  EXPECT_NEAR(json["tables"]["views"][1]["max_m"], 0.003, 1e-9);
  const Json& summary = json["summaries"]["views"];
  EXPECT_NEAR(summary["mean"]["max_m"], 0.002, 1e-9);
  EXPECT_NEAR(summary["median"]["min_m"], -0.0015, 1e-9);
  EXPECT_NEAR(summary["sigma"]["max_m"], 0.002 / std::sqrt(2.0), 1e-9);
  EXPECT_EQ(summary["model"]["points"], 4);  // all views at once
  EXPECT_TRUE(json["tables"]["groups"].empty());
  EXPECT_TRUE(json["summaries"]["groups"].is_null());
}

TEST(DeviationReport, WhatIsNotKnownIsNull) {
  DeviationReport report;
  static_cast<DeviationStatistics&>(report.deviation) = deviationStatistics({0.001F}, 0.025);
  const Json json = Json::parse(toJson(report));
  EXPECT_TRUE(json["mean_negative_m"].is_null());
  EXPECT_TRUE(json["mean_positive_m"].is_number());
}

TEST(ReadableRange, IsTheNextPlainNumber) {
  DeviationStatistics s;
  for (const auto& [p95, range] : {std::pair{0.00053, 0.001},
                                   {0.0011, 0.002},
                                   {0.0021, 0.003},
                                   {0.0031, 0.005},
                                   {0.0051, 0.01},
                                   {0.02, 0.02}}) {
    s.p95_absolute_m = p95;
    EXPECT_NEAR(readableRange(s), range, 1e-12) << p95;
  }
  s.p95_absolute_m = 0.0;  // a perfect model still has a scale
  EXPECT_GT(readableRange(s), 0.0);
}

TEST(DrawLegend, RunsFromRedAtTheTopToBlueAtTheBottom) {
  const cv::Mat legend = drawLegend(0.001, 200, 800);
  std::vector<cv::Vec3b> column;
  for (int y = 0; y < legend.rows; ++y) column.push_back(legend.at<cv::Vec3b>(y, 40));
  const auto first = [&](const cv::Vec3b& bgr) {
    return std::find(column.begin(), column.end(), bgr) - column.begin();
  };
  const auto near_red = std::find_if(column.begin(), column.end(), [](const cv::Vec3b& c) {
    return c[2] == 255 && c[1] < 5 && c[0] == 0;
  });
  ASSERT_NE(near_red, column.end());
  const auto green = first({0, 255, 0});
  const auto blue = std::find_if(column.begin(), column.end(), [](const cv::Vec3b& c) {
    return c[0] == 255 && c[1] < 5 && c[2] == 0;
  });
  ASSERT_NE(blue, column.end());
  EXPECT_LT(near_red - column.begin(), green);
  EXPECT_LT(green, blue - column.begin());
  EXPECT_LT(first({kOutlierColor.b, kOutlierColor.g, kOutlierColor.r}), 800);
}

TEST(DrawDeviation, ShowsTheColoursOfTheModel) {
  const Mesh reference = shapes::sphere(0.3, 3);
  DeviationReport report = sampleReport();
  report.deviation.signed_m.assign(reference.vertices.size(), 0.001F);
  const Mesh colored = colorCoded(reference, report.deviation, 0.001, 0.025);
  const cv::Mat image = drawDeviation(colored, reference, report);
  for (const cv::Point middle : {cv::Point(320, 384), {960, 384}, {320, 1024}, {960, 1024}}) {
    const auto bgr = image.at<cv::Vec3b>(middle);  // shaded, but red
    EXPECT_GT(bgr[2], 100);
    EXPECT_LT(bgr[1], 10);
  }
}

TEST(DrawHistogram, PutsWhatIsBeyondIntoTheOuterBars) {
  DeviationReport report = sampleReport();
  report.deviation.signed_m = {0.01F, 0.01F, 0.01F, -0.01F, 0.0F, 0.5F};
  const cv::Mat image = drawHistogram(report);
  const auto count = [&](const cv::Vec3b& bgr) {
    int n = 0;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) n += image.at<cv::Vec3b>(y, x) == bgr ? 1 : 0;
    }
    return n;
  };
  const auto bar = [](double share) {
    const Rgb8 c = deviationColor(share * 0.001, 0.001);
    return cv::Vec3b(c.b, c.g, c.r);
  };
  const int red = count(bar(80.0 / 81.0)), blue = count(bar(-80.0 / 81.0)), green = count(bar(0.0));
  EXPECT_GT(green, 100);
  EXPECT_NEAR(red, 3.0 * green, 0.1 * green);
  EXPECT_NEAR(blue, green, 0.1 * green);
}

}  // namespace
}  // namespace scanner::evaluation
