// How accurate is the fraction of a pixel, and is sigma true? Pairs of known disparity, simulated
// or recorded, ours beside OpenCV. Prints one line for each matcher, over all views of a scene.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "accuracy_views.h"
#include "scanner/stereo/match.h"
#include "tools/run.h"

namespace scanner {
namespace {

constexpr int kMinDisparity = 80, kMaxDisparity = 335;
constexpr double kInlierPx = 1.0;
constexpr int kBins = 8;

struct Arguments {
  std::vector<std::string> scenes{"artwork", "totem"};
  bench::Recording recording;
  std::vector<int> views{0, 12, 25, 38};
  int threads = 2;
  double max_sigma = stereo::ValidationOptions().max_sigma_px;
  double max_residual_share = stereo::ValidationOptions().max_residual_share;
};

struct Sample {
  float truth, found, sigma;
};

/// Everything that is known of one matcher on one scene.
struct Record {
  std::vector<Sample> inliers;
  std::size_t possible = 0, found = 0, near_step = 0, wrong_near_step = 0;

  void add(const bench::AccuracyView& view, const cv::Mat& disparity, const cv::Mat& sigma) {
    for (int y = 0; y < disparity.rows; ++y) {
      for (int x = 0; x < disparity.cols; ++x) {
        const float truth = view.truth.at<float>(y, x), d = disparity.at<float>(y, x);
        if (!(truth >= kMinDisparity && truth <= kMaxDisparity)) continue;
        ++possible;
        if (std::isnan(d)) continue;
        ++found;
        const bool inlier = std::abs(static_cast<double>(d - truth)) < kInlierPx;
        if (view.near_step.at<std::uint8_t>(y, x) != 0) {
          ++near_step;
          if (!inlier) ++wrong_near_step;
        }
        if (inlier) inliers.push_back({truth, d, sigma.empty() ? 0.0f : sigma.at<float>(y, x)});
      }
    }
  }
};

double square(double v) { return v * v; }
double percent(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

double inlierRms(const std::vector<Sample>& samples) {
  double sum = 0.0;
  for (const Sample& s : samples) sum += square(static_cast<double>(s.found - s.truth));
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(samples.size(), 1)));
}

std::size_t fractionBin(float disparity) {
  const double d = static_cast<double>(disparity) + 0.5 / kBins;  // a bin is centred on 0
  return static_cast<std::size_t>(kBins * (d - std::floor(d))) % kBins;
}

/// Locking: the fullest bin of the found fractions beside the same bin of the true ones, and the
/// largest mean error of the pixels of one true fraction.
std::pair<double, double> locking(const std::vector<Sample>& samples) {
  std::array<double, kBins> truth{}, found{}, error{};
  for (const Sample& s : samples) {
    ++truth[fractionBin(s.truth)];
    ++found[fractionBin(s.found)];
    error[fractionBin(s.truth)] += static_cast<double>(s.found - s.truth);
  }
  double peak = 0.0, bias = 0.0;
  for (std::size_t i = 0; i < kBins; ++i) {
    peak = std::max(peak, found[i] / std::max(1.0, truth[i]));
    bias = std::max(bias, std::abs(error[i] / std::max(1.0, truth[i])));
  }
  return {peak, bias};
}

void print(const char* name, Record& record) {
  std::vector<Sample>& samples = record.inliers;
  const auto by_error = [](const Sample& a, const Sample& b) {
    return std::abs(a.found - a.truth) < std::abs(b.found - b.truth);
  };
  if (samples.empty()) return;
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2);
  std::nth_element(samples.begin(), middle, samples.end(), by_error);
  const double median = std::abs(static_cast<double>(middle->found - middle->truth));
  const auto [peak, bias] = locking(samples);
  std::printf("  %-18s %7.4f %7.4f %7.1f %8.2f %9.2f %7.2f %8.4f\n", name, inlierRms(samples),
              median, percent(record.found, record.possible),
              percent(record.found - samples.size(), record.found),
              percent(record.wrong_near_step, record.near_step), peak, bias);
}

/// Measured over predicted in every decile of the predicted sigma, and the rms error of the surest
/// pixels when only part of those that could be found is kept.
void printSigma(const char* name, const Record& record) {
  std::vector<Sample> samples = record.inliers;
  std::sort(samples.begin(), samples.end(),
            [](const Sample& a, const Sample& b) { return a.sigma < b.sigma; });
  std::string ratios, sigmas;
  for (std::size_t k = 0; k < 10; ++k) {
    const std::size_t begin = samples.size() * k / 10, end = samples.size() * (k + 1) / 10;
    double predicted = 0.0, measured = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      predicted += square(static_cast<double>(samples[i].sigma));
      measured += square(static_cast<double>(samples[i].found - samples[i].truth));
    }
    char text[32];
    std::snprintf(text, sizeof text, " %.3f",
                  std::sqrt(predicted / static_cast<double>(end - begin)));
    sigmas += text;
    std::snprintf(text, sizeof text, " %5.2f", std::sqrt(measured / predicted));
    ratios += text;
  }
  std::printf("  %-18s sigma%s\n  %-18s ratio%s\n", name, sigmas.c_str(), "", ratios.c_str());
  std::printf("  %-18s surest", "");
  for (const std::size_t kept : {40, 50, 60, 70, 80}) {
    const std::size_t count = record.possible * kept / 100;
    if (count > samples.size()) break;
    const auto end = samples.begin() + static_cast<std::ptrdiff_t>(count);
    std::printf("  %zu %%: %.4f", kept, inlierRms({samples.begin(), end}));
  }
  std::printf("\n");
}

/// Columns whose range leaves the image are searched too, thanks to a border.
cv::Mat openCv(cv::StereoMatcher& matcher, int border, const stereo::RectifiedPair& pair) {
  cv::Mat left, right, fixed, out;
  cv::copyMakeBorder(pair.left_gray, left, 0, 0, border, 0, cv::BORDER_REPLICATE);
  cv::copyMakeBorder(pair.right_gray, right, 0, 0, border, 0, cv::BORDER_REPLICATE);
  matcher.compute(left, right, fixed);
  fixed.colRange(border, fixed.cols).convertTo(out, CV_32F, 1.0 / cv::StereoMatcher::DISP_SCALE);
  out.setTo(std::numeric_limits<float>::quiet_NaN(), out < kMinDisparity);
  return out;
}

using bench::AccuracyView;
using bench::Sensor;

constexpr std::pair<Sensor, const char*> kSensors[] = {
    {Sensor::kIdeal, "without noise and mosaic"},
    {Sensor::kNoiseFree, "without noise"},
    {Sensor::kReal, "with noise"},
};

void measure(const std::string& title, const std::vector<AccuracyView>& views, const Arguments& a) {
  stereo::MatcherOptions block, semi_global;
  for (stereo::MatcherOptions* o : {&block, &semi_global}) {
    o->min_disparity_px = kMinDisparity;
    o->max_disparity_px = kMaxDisparity;
    o->validation.max_sigma_px = a.max_sigma;
    o->validation.max_residual_share = a.max_residual_share;
  }
  block.method = stereo::MatchMethod::kBlock;
  semi_global.method = stereo::MatchMethod::kSemiGlobal;
  constexpr int kCount = (kMaxDisparity - kMinDisparity) / 16 * 16 + 16, kWindow = 5, kBlock = 13;
  const auto sgbm = cv::StereoSGBM::create(kMinDisparity, kCount, kWindow, 8 * kWindow * kWindow,
                                           32 * kWindow * kWindow, 1, 31, 5, 200, 1);
  const auto bm = cv::StereoBM::create(kCount, kBlock);
  bm->setMinDisparity(kMinDisparity);
  bm->setUniquenessRatio(5);
  bm->setSpeckleWindowSize(200);
  bm->setSpeckleRange(1);
  bm->setDisp12MaxDiff(1);

  Record of_block, of_semi_global, of_sgbm, of_bm;
  for (const AccuracyView& view : views) {
    const DisparityImage b = stereo::match(view.pair, block, a.threads, nullptr);
    of_block.add(view, b.disparity_px, b.sigma_px);
    const DisparityImage s = stereo::match(view.pair, semi_global, a.threads, nullptr);
    of_semi_global.add(view, s.disparity_px, s.sigma_px);
    const int border = kMinDisparity + kCount + kBlock;
    of_sgbm.add(view, openCv(*sgbm, border, view.pair), {});
    of_bm.add(view, openCv(*bm, border, view.pair), {});
  }
  std::printf("%s, %zu views\n", title.c_str(), views.size());
  std::printf("  %-18s %7s %7s %7s %8s %9s %7s %8s\n", "", "rms px", "median", "found %", "wrong %",
              "at step %", "peak", "bias px");
  print("block", of_block);
  print("semi_global", of_semi_global);
  print("OpenCV StereoBM", of_bm);
  print("OpenCV StereoSGBM", of_sgbm);
  printSigma("block", of_block);
  printSigma("semi_global", of_semi_global);
  std::printf("  rms / StereoSGBM's: block %.2f, semi_global %.2f\n\n",
              inlierRms(of_block.inliers) / inlierRms(of_sgbm.inliers),
              inlierRms(of_semi_global.inliers) / inlierRms(of_sgbm.inliers));
  std::fflush(stdout);
}

int measureAll(const Arguments& a) {
  std::printf(
      "rms, median: of errors below 1 px; wrong: of 1 px and more; at step: the same within\n"
      "10 px of a depth edge; peak: fullest of 8 bins of the fraction, over the truth's; bias:\n"
      "largest mean error of one true fraction; ratio: rms error over predicted sigma, by "
      "deciles;\n"
      "surest: rms of so many of all pixels, by sigma\n\n");
  if (!a.recording.bag.empty()) {
    measure(a.recording.bag, bench::recordedViews(a.recording, a.views, a.threads), a);
    return 0;
  }
  for (const std::string& scene : a.scenes) {
    for (const auto& [sensor, name] : kSensors) {
      measure(scene + ", " + name, bench::simulatedViews(scene, sensor, a.views, a.threads), a);
    }
  }
  return 0;
}

}  // namespace
}  // namespace scanner

int main(int argc, char** argv) {
  scanner::Arguments arguments;
  CLI::App app("Error of the disparities, and of their sigma, where the truth is known.",
               "stereo_accuracy");
  app.add_option("SCENES", arguments.scenes, "artwork, totem, target or mesh files: simulated")
      ->capture_default_str();
  CLI::Option* bag = app.add_option("--recording", arguments.recording.bag, "bag to use instead");
  CLI::Option* reference =
      app.add_option("--reference", arguments.recording.reference, "PLY of its object, map frame")
          ->needs(bag);
  CLI::Option* truth =
      app.add_option("--truth", arguments.recording.truth, "TUM of base_link in map")->needs(bag);
  bag->needs(reference)->needs(truth);
  app.add_option("--views", arguments.views, "numbers of the pairs")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  app.add_option("--max-sigma", arguments.max_sigma, "px; pixels of a larger sigma are dropped")
      ->capture_default_str();
  app.add_option("--max-residual", arguments.max_residual_share, "validation.max_residual_share")
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "threads to use")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  return scanner::tools::run(app, argc, argv, [&] { return scanner::measureAll(arguments); });
}
