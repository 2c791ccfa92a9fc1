#include "evaluation/deviation_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "scanner/surface/render.h"

namespace scanner::evaluation {
namespace {

constexpr int kPanel = 640, kLegendWidth = 200, kTitle = 64;
const cv::Scalar kInk(40, 40, 40), kPaper(255, 255, 255), kGrid(225, 225, 225);

enum class Anchor { kLeft, kCenter, kRight };

__attribute__((format(printf, 1, 2))) std::string textOf(const char* format, ...) {
  std::array<char, 160> text{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text.data(), text.size(), format, arguments);
  va_end(arguments);
  return text.data();
}

/// `y` is the middle of the letters' height.
void write(cv::Mat& image, const std::string& text, cv::Point at, Anchor anchor,
           double size = 0.55) {
  int baseline = 0;
  const cv::Size extent = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &baseline);
  if (anchor == Anchor::kCenter) at.x -= extent.width / 2;
  if (anchor == Anchor::kRight) at.x -= extent.width;
  cv::putText(image, text, {at.x, at.y + extent.height / 2}, cv::FONT_HERSHEY_SIMPLEX, size, kInk,
              1, cv::LINE_AA);
}

cv::Scalar scalar(Rgb8 color) {
  return {static_cast<double>(color.b), static_cast<double>(color.g), static_cast<double>(color.r)};
}

/// Without more decimals than the number has.
std::string millimetres(double m, bool sign) {
  return textOf(sign && m != 0.0 ? "%+.4g" : "%.4g", 1e3 * m);
}

int rounded(double x) { return static_cast<int>(std::lround(x)); }

cv::Mat panel(const Mesh& model, const Mesh& reference, double azimuth_deg) {
  constexpr double kElevation = 15.0 * CV_PI / 180.0;
  const double a = azimuth_deg * CV_PI / 180.0;
  const Eigen::Vector3d stand(std::cos(kElevation) * std::cos(a),
                              std::cos(kElevation) * std::sin(a), std::sin(kElevation));
  const auto view = surface::autoView(reference, -stand, kPanel, kPanel);
  cv::Mat image = surface::renderMesh(model, view.T_map_camera, view.K, kPanel, kPanel);
  write(image, textOf("azimuth %.0f deg", azimuth_deg), {14, kPanel - 18}, Anchor::kLeft, 0.45);
  return image;
}

struct Bins {
  std::vector<std::size_t> counts;
  std::size_t total = 0;
};

Bins binned(const DeviationReport& report, int bins) {
  Bins out{std::vector<std::size_t>(static_cast<std::size_t>(bins), 0), 0};
  for (const float value : report.deviation.signed_m) {
    const double v = static_cast<double>(value);
    if (!(std::abs(v) <= report.options.outlier_m)) continue;
    const double at = std::floor((v / report.range_m + 1.0) / 2.0 * bins);
    ++out.counts[static_cast<std::size_t>(std::clamp(at, 0.0, bins - 1.0))];
    ++out.total;
  }
  return out;
}

}  // namespace

double readableRange(const DeviationStatistics& statistics) {
  const double need = std::max(statistics.p95_absolute_m, 1e-6);
  const double decade = std::pow(10.0, std::floor(std::log10(need)));
  for (const double step : {1.0, 2.0, 3.0, 5.0}) {
    if (step * decade >= need) return step * decade;
  }
  return 10.0 * decade;
}

cv::Mat drawLegend(double range_m, int width, int height) {
  cv::Mat image(height, width, CV_8UC3, kPaper);
  const int top = 60, bottom = height - 110, left = 24, right = 64;
  write(image, "mm", {left, 30}, Anchor::kLeft);
  for (int y = top; y <= bottom; ++y) {
    const double share = 1.0 - 2.0 * (y - top) / static_cast<double>(bottom - top);
    cv::line(image, {left, y}, {right, y}, scalar(deviationColor(share * range_m, range_m)));
  }
  cv::rectangle(image, {left, top}, {right, bottom}, kInk);
  constexpr int kTicks = 8;
  for (int i = 0; i <= kTicks; ++i) {
    const double share = 1.0 - 2.0 * i / kTicks;
    const int y = top + rounded((bottom - top) * i / static_cast<double>(kTicks));
    cv::line(image, {right, y}, {right + 6, y}, kInk);
    write(image, millimetres(share * range_m, true), {right + 14, y}, Anchor::kLeft);
  }
  write(image, "above", {right + 14, top + 24}, Anchor::kLeft, 0.42);
  write(image, "below", {right + 14, bottom - 24}, Anchor::kLeft, 0.42);
  cv::rectangle(image, {left, bottom + 34}, {right, bottom + 56}, scalar(kOutlierColor),
                cv::FILLED);
  cv::rectangle(image, {left, bottom + 34}, {right, bottom + 56}, kInk);
  write(image, "outlier", {right + 14, bottom + 45}, Anchor::kLeft);
  return image;
}

cv::Mat drawDeviation(const Mesh& colored_in_reference, const Mesh& reference,
                      const DeviationReport& report) {
  cv::Mat image(kTitle + 2 * kPanel, 2 * kPanel + kLegendWidth, CV_8UC3, kPaper);
  for (int i = 0; i < 4; ++i) {
    panel(colored_in_reference, reference, 90.0 * i)
        .copyTo(image({i % 2 * kPanel, kTitle + i / 2 * kPanel, kPanel, kPanel}));
  }
  drawLegend(report.range_m, kLegendWidth, 2 * kPanel)
      .copyTo(image({2 * kPanel, kTitle, kLegendWidth, 2 * kPanel}));
  const Deviation& d = report.deviation;
  write(image,
        textOf("%s against %s (%s)", report.model.c_str(), report.reference.c_str(),
               toString(report.placement)),
        {14, 20}, Anchor::kLeft);
  write(image,
        textOf("min %+.2f  max %+.2f  mean- %+.3f  mean+ %+.3f  sigma %.3f mm;  %zu points, %zu "
               "outliers, coverage %.1f %%",
               1e3 * d.min_m, 1e3 * d.max_m, 1e3 * d.mean_negative_m, 1e3 * d.mean_positive_m,
               1e3 * d.sigma_m, d.points, d.outliers, 100.0 * d.coverage),
        {14, 46}, Anchor::kLeft);
  return image;
}

cv::Mat drawHistogram(const DeviationReport& report) {
  constexpr int kBins = 81, kBar = 11, kLeft = 90, kTop = 60, kHeight = 400;
  constexpr int kWidth = kBins * kBar, kBottom = kTop + kHeight;
  cv::Mat image(kBottom + 80, kLeft + kWidth + 40, CV_8UC3, kPaper);
  const Bins bins = binned(report, kBins);
  const auto total = static_cast<double>(std::max<std::size_t>(bins.total, 1));
  const double highest = std::max(
      static_cast<double>(*std::max_element(bins.counts.begin(), bins.counts.end())) / total, 1e-3);
  const double decade = std::pow(10.0, std::floor(std::log10(highest)));
  const double step = decade * (highest / decade > 5.0 ? 2.0 : highest / decade > 2.0 ? 1.0 : 0.5);
  const double scale = kHeight / (1.05 * highest);
  for (int i = 0; i * step <= 1.05 * highest; ++i) {
    const int y = kBottom - rounded(i * step * scale);
    cv::line(image, {kLeft, y}, {kLeft + kWidth, y}, kGrid);
    write(image, textOf("%.4g %%", 100.0 * i * step), {kLeft - 10, y}, Anchor::kRight, 0.5);
  }
  for (int i = 0; i < kBins; ++i) {
    const double share = static_cast<double>(bins.counts[static_cast<std::size_t>(i)]) / total;
    if (share <= 0.0) continue;
    const double middle = (2.0 * (i + 0.5) / kBins - 1.0) * report.range_m;
    const cv::Point corner(kLeft + i * kBar, kBottom - rounded(share * scale));
    const cv::Point opposite(kLeft + (i + 1) * kBar - 1, kBottom);
    cv::rectangle(image, corner, opposite, scalar(deviationColor(middle, report.range_m)),
                  cv::FILLED);
    cv::rectangle(image, corner, opposite, cv::Scalar(120, 120, 120));
  }
  cv::line(image, {kLeft, kBottom}, {kLeft + kWidth, kBottom}, kInk);
  for (int i = -4; i <= 4; ++i) {
    const int x = kLeft + rounded(kWidth * (0.5 + i / 8.0));
    cv::line(image, {x, kBottom}, {x, kBottom + 6}, kInk);
    write(image, millimetres(report.range_m * i / 4.0, true), {x, kBottom + 20}, Anchor::kCenter);
  }
  write(image, "deviation, mm (the outer bars hold what is beyond)",
        {kLeft + kWidth / 2, kBottom + 52}, Anchor::kCenter, 0.5);
  const Deviation& d = report.deviation;
  write(image,
        textOf("mean %+.3f  sigma %.3f  RMSE %.3f  median |d| %.3f  95%% |d| %.3f mm,  %zu points",
               1e3 * d.mean_m, 1e3 * d.sigma_m, 1e3 * d.rmse_m, 1e3 * d.median_absolute_m,
               1e3 * d.p95_absolute_m, d.points),
        {kLeft, 28}, Anchor::kLeft);
  return image;
}

}  // namespace scanner::evaluation
