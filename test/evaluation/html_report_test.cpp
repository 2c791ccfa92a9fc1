#include "scanner/evaluation/html_report.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "evaluation/html_text.h"
#include "evaluation/svg_plot.h"
#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"
#include "scanner/evaluation/report.h"
#include "support/temporary_folder.h"

namespace scanner::evaluation {
namespace {

constexpr int kViews = 6;
constexpr int kLost = 3;

Time stampOf(int view) { return fromNanoseconds(1'731'500'000'000'000'000 + view * 500'000'000LL); }

ScanReport fullReport() {
  ScanReport report;
  for (int i = 0; i < kViews; ++i) {
    ReportView view;
    view.index = i;
    view.stamp = stampOf(i);
    view.registered = i != kLost;
    view.reason = i == kLost ? "no trial <converged>" : "";
    view.trial = 1;
    view.points = 1000;
    view.mean_distance_m = 0.001;
    view.prior_arc_deg = 0.5;
    view.prior_rho_m = 0.004;
    view.truth_position_m = 0.002;
    view.truth_rotation_deg = 0.1;
    report.views.push_back(view);
  }
  report.groups = 2;
  report.trials = {5, 1, 0, 0, 0, 0, 0, 1};
  report.prior_relative = {{0, 1, {8, 0, 0, 8, 0.05, 0.03, 0.04, 0}}};
  report.prior_absolute = report.group_prior_relative = report.group_prior_absolute =
      report.prior_relative;
  report.sampling = {{5.0, 1296, 30.5, 151.0, 177.9}};
  report.compatible = {{30.0, 262.5, 0.0809}};
  PoseErrors truth{0.002, 0.0035, 0.1, 0.2, {}, 0};
  truth.poses.resize(kViews);
  report.truth = truth;
  report.loop = {true, 0.0123, 0.4};
  report.model = ReportModel{4, 4, 1, 0, 0, 0.002};
  report.time_s = {4.0, 0.1, 2.0, 1.0, 3.0, 10.1};
  report.peak_memory_mb = 321;
  report.warnings = {"a <script>alert(1)</script> & \"quotes\" \xff"};
  report.skipped = {{"gaps in the inertial samples", 2}};
  return report;
}

Mesh tetrahedron() {
  Mesh mesh;
  mesh.vertices.points = {{0, 0, 0}, {0.1F, 0, 0}, {0, 0.1F, 0}, {0, 0, 0.1F}};
  mesh.vertices.colors.assign(4, {200, 90, 30});
  mesh.vertices.sigmas.assign(4, 0.0007F);
  mesh.faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

std::string contents(const std::string& path) {
  std::ostringstream out;
  out << std::ifstream(path, std::ios::binary).rdbuf();
  return out.str();
}

void write(const std::string& path, const std::string& text) {
  ASSERT_TRUE(writeFileAtomically(path, text));
}

void fill(const test::TemporaryFolder& folder) {
  write(folder / "report.json", toJson(fullReport()));
  Trajectory trajectory;
  for (int i = 0; i < kViews; ++i) {
    if (i == kLost) continue;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() = Eigen::Vector3d(std::cos(i), std::sin(i), 0.1 * i);
    trajectory.push_back({stampOf(i), T});
  }
  ASSERT_TRUE(writeTum(folder / "trajectory.tum", trajectory));
  write(folder / "config.yaml", "scan:\n  note: a < b & c\n");
  ASSERT_TRUE(writePly(folder / "model.ply", tetrahedron()));
  write(folder / "deviation.json",
        R"({"max_m":0.004,"min_m":-0.003,"mean_positive_m":0.001,"mean_negative_m":-0.001,
            "mean_m":0.0001,"sigma_m":0.00123,"rmse_m":0.0013,"points":400,"outliers":7,
            "coverage":0.912,"placement":"best_fit",
            "tables":{"views":[{"index":0,"max_m":0.01,"min_m":-0.01,"mean_positive_m":0.002,
                                "mean_negative_m":-0.002,"sigma_m":0.0025}],
                      "groups":[{"index":4,"max_m":0.01,"sigma_m":null}]}})");
  const cv::Mat picture(8, 8, CV_8UC3, cv::Scalar(10, 20, 30));
  cv::imwrite(folder / "deviation.png", picture);
  cv::imwrite(folder / "histogram.png", picture);
  std::filesystem::create_directory(folder / "pictures");
  cv::imwrite(folder / "pictures/view_000_left.jpg", picture);
}

std::string pageOf(const test::TemporaryFolder& folder) {
  const Status status = writeHtmlReport(folder.path());
  EXPECT_TRUE(status) << status.message();
  return contents(folder / "report.html");
}

bool has(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

TEST(HtmlReport, ShowsEverythingThatAFullFolderHolds) {
  const test::TemporaryFolder folder;
  fill(folder);
  const std::string page = pageOf(folder);
  for (const char* id : {"model", "accuracy", "notes", "pictures", "plots", "views", "motion",
                         "sampling", "deviation", "run", "configuration"}) {
    EXPECT_TRUE(has(page, std::string("<section id=\"") + id + "\">")) << id;
  }
  for (const char* table : {"4.2", "4.3", "5.1", "5.2", "5.3", "5.4", "5.5", "5.6", "5.7", "5.8"}) {
    EXPECT_TRUE(has(page, std::string("(table ") + table + ")")) << table;
  }
  for (const char* text : {"5 of 6 views were registered", "no trial &lt;converged&gt;",
                           "12.3&nbsp;mm", "2.00&nbsp;mm", "3.50&nbsp;mm", "1.23&nbsp;mm", "91.2",
                           "321", "<em>122</em>", "view 000 left", "0.70&nbsp;mm"}) {
    EXPECT_TRUE(has(page, text)) << text;
  }
}

TEST(HtmlReport, NeedsNothingFromOutside) {
  const test::TemporaryFolder folder;
  fill(folder);
  const std::string page = pageOf(folder);
  EXPECT_FALSE(has(page, "http:"));
  EXPECT_FALSE(has(page, "https:"));
  EXPECT_FALSE(has(page, "<link"));
  EXPECT_FALSE(has(page, "<script"));
  EXPECT_FALSE(has(page, "@import"));
  EXPECT_FALSE(has(page, "url("));
  std::size_t pictures = 0;
  for (std::size_t at = page.find("src="); at != std::string::npos;
       at = page.find("src=", at + 1)) {
    EXPECT_EQ(page.compare(at, 16, "src=\"data:image/"), 0) << page.substr(at, 40);
    ++pictures;
  }
  EXPECT_EQ(pictures, 5U + 2U + 1U);  // model, deviation, sample
}

TEST(HtmlReport, EscapesWhatComesFromFiles) {
  const test::TemporaryFolder folder;
  fill(folder);
  const std::string page = pageOf(folder);
  EXPECT_TRUE(has(page, "&lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;quotes&quot;"));
  EXPECT_TRUE(has(page, "note: a &lt; b &amp; c"));
  EXPECT_EQ(html::escape("<&>\"'\xff\x01ü"), "&lt;&amp;&gt;&quot;&#39;\xEF\xBF\xBD\xEF\xBF\xBDü");
}

TEST(HtmlReport, LeavesOutWhatIsNotThere) {
  const test::TemporaryFolder folder;
  write(folder / "report.json", toJson(ScanReport()));
  const std::string page = pageOf(folder);
  for (const char* id : {"model", "deviation", "pictures", "plots", "views", "motion", "sampling",
                         "configuration", "notes"}) {
    EXPECT_FALSE(has(page, std::string("<section id=\"") + id + "\">")) << id;
  }
  EXPECT_TRUE(has(page, "No stereo pictures were processed."));
  EXPECT_FALSE(has(page, "nan"));
}

TEST(HtmlReport, SaysPredictedErrorsWithoutTruth) {
  const test::TemporaryFolder folder;
  fill(folder);
  ScanReport report = fullReport();
  report.truth.reset();
  write(folder / "report.json", toJson(report));
  const std::string page = pageOf(folder);
  EXPECT_TRUE(has(page, "Predicted errors"));
  EXPECT_TRUE(has(page, "No true positions are known"));
  EXPECT_FALSE(has(page, "known truth"));
}

TEST(HtmlReport, NamesTheReportThatCannotBeRead) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(writeHtmlReport(folder.path()).code(), StatusCode::kIoError);
  const std::string whole = toJson(fullReport());
  for (const std::string& text : {whole.substr(0, whole.size() / 2), std::string("[1]"),
                                  std::string(), std::string("null")}) {
    write(folder / "report.json", text);
    const Status status = writeHtmlReport(folder.path());
    EXPECT_EQ(status.code(), StatusCode::kInvalidInput);
    EXPECT_TRUE(has(status.message(), folder / "report.json")) << status.message();
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "report.html"));
}

TEST(HtmlReport, OtherBrokenFilesAreNamedInThePage) {
  const test::TemporaryFolder folder;
  fill(folder);
  for (const char* name : {"model.ply", "trajectory.tum", "deviation.json", "histogram.png"}) {
    write(folder / name, "broken");
  }
  const std::string page = pageOf(folder);
  for (const char* name : {"model.ply", "trajectory.tum", "deviation.json", "histogram.png"}) {
    EXPECT_TRUE(has(page, folder / name)) << name;
  }
}

TEST(HtmlReport, IgnoresKeysOfAnotherType) {
  const test::TemporaryFolder folder;
  write(folder / "report.json",
        R"({"views":3,"trials":[],"truth":5,"loop":"x","model":{"vertices":-4},"time_s":null,
            "warnings":[1,null],"skipped":{"a":-1},"tables":{"views":[1,{"points":-3}]}})");
  EXPECT_TRUE(has(pageOf(folder), "<section id=\"run\">"));
}

TEST(HtmlReport, SameFolderSameBytes) {
  const test::TemporaryFolder folder;
  fill(folder);
  const std::string first = pageOf(folder);
  EXPECT_EQ(first, pageOf(folder));
}

TEST(ReportParser, GivesBackWhatWasWritten) {
  const ScanReport report = fullReport();
  const Result<ScanReport> read = parseReport(toJson(report));
  ASSERT_TRUE(read);
  EXPECT_EQ(toJson(*read), toJson(report));
  const Result<ScanReport> empty = parseReport(toJson(ScanReport()));
  ASSERT_TRUE(empty);
  EXPECT_EQ(toJson(*empty), toJson(ScanReport()));
}

TEST(Html, NumbersHaveSensibleDigits) {
  EXPECT_EQ(html::millimetres(0.00123456), "1.23&nbsp;mm");
  EXPECT_EQ(html::millimetres(0.0123456), "12.3&nbsp;mm");
  EXPECT_EQ(html::millimetres(0.123456), "123&nbsp;mm");
  EXPECT_EQ(html::fixed(-0.0001, 2), "0.00");
  EXPECT_EQ(html::fixed(kUnknown, 2), "\xE2\x80\x93");
  EXPECT_EQ(html::grouped(1234567),
            "1\xE2\x80\xAF"
            "234\xE2\x80\xAF"
            "567");
  EXPECT_EQ(html::seconds(125.0), "2&nbsp;min 5&nbsp;s");
  EXPECT_EQ(html::dataUri("a/b", "Man"), "data:a/b;base64,TWFu");
  EXPECT_EQ(html::dataUri("a/b", "Ma"), "data:a/b;base64,TWE=");
  EXPECT_EQ(html::dataUri("a/b", "M"), "data:a/b;base64,TQ==");
}

TEST(SvgPlot, TicksAreRoundAndInside) {
  EXPECT_EQ(svg::ticks(0.0, 10.0, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  const std::vector<double> ticks = svg::ticks(-0.013, 0.021, 6);
  ASSERT_GE(ticks.size(), 3U);
  EXPECT_GE(ticks.front(), -0.013);
  EXPECT_LE(ticks.back(), 0.021);
  EXPECT_TRUE(svg::ticks(1.0, 1.0, 5).empty());
}

TEST(SvgPlot, DrawsWhatIsFiniteAndNothingElse) {
  svg::Plot plot;
  plot.title = "a < b";
  svg::Series dots;
  dots.mark = svg::Mark::kDot;
  dots.x = {0, 1, 2};
  dots.y = {1.0, kUnknown, 3.0};
  plot.series = {dots};
  const std::string drawn = svg::toSvg(plot);
  std::size_t circles = 0;
  for (std::size_t at = drawn.find("<circle"); at != std::string::npos;
       at = drawn.find("<circle", at + 1)) {
    ++circles;
  }
  EXPECT_EQ(circles, 2U);
  EXPECT_TRUE(has(drawn, "a &lt; b"));
  EXPECT_FALSE(has(drawn, "nan"));
  plot.series[0].y.assign(3, kUnknown);
  EXPECT_EQ(svg::toSvg(plot), "");
  plot.series[0].y = {2.0, 2.0, 2.0};  // a flat line still has an axis
  plot.from_zero = false;
  EXPECT_FALSE(has(svg::toSvg(plot), "nan"));
  EXPECT_FALSE(has(svg::toSvg(plot), "\xE2\x80\x93"));
}

TEST(SvgPlot, EqualScalesKeepACircleRound) {
  svg::Plot plot;
  svg::Series dots;
  dots.mark = svg::Mark::kDot;
  dots.x = {0.0, 1.0, 0.0};
  dots.y = {0.0, 0.0, 1.0};
  plot.series = {dots};
  plot.equal_scales = true;
  const std::string drawn = svg::toSvg(plot);
  std::vector<std::pair<double, double>> places;
  for (std::size_t at = drawn.find("<circle"); at != std::string::npos;
       at = drawn.find("<circle", at + 1)) {
    double x = 0.0, y = 0.0;
    ASSERT_EQ(std::sscanf(drawn.c_str() + at, "<circle cx=\"%lf\" cy=\"%lf\"", &x, &y), 2);
    places.emplace_back(x, y);
  }
  ASSERT_EQ(places.size(), 3U);
  EXPECT_NEAR(places[1].first - places[0].first, places[0].second - places[2].second, 0.21);
}

}  // namespace
}  // namespace scanner::evaluation
