// How accurate is the fraction of a pixel, and is sigma true? Simulated pairs with exact disparity,
// ours beside OpenCV. Prints one line for each matcher, over all views of a scene.
//
//   stereo_accuracy [--views 0,12,25,38] [--threads 2] [--max-sigma PX] [--max-residual SHARE]
//                   [SCENE ...]            SCENE: artwork, totem, target or a mesh file
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "scanner/simulation/simulation.h"
#include "scanner/stereo/match.h"

namespace scanner {
namespace {

constexpr int kMinDisparity = 80, kMaxDisparity = 335;
constexpr double kInlierPx = 1.0;
/// A true step of this many pixels between neighbours is a depth edge; its surroundings are judged
/// on their own.
constexpr double kStepPx = 3.0;
constexpr int kNearStepPx = 10;
constexpr int kBins = 8;

struct Arguments {
  std::vector<std::string> scenes;
  std::vector<int> views{0, 12, 25, 38};
  int threads = 2;
  double max_sigma = stereo::ValidationOptions().max_sigma_px;
  double max_residual_share = stereo::ValidationOptions().max_residual_share;
};

Arguments parse(int argc, char** argv) {
  Arguments a;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto value = [&]() -> std::string {
      if (i + 1 >= argc) throw std::invalid_argument(word + " needs a value");
      return argv[++i];
    };
    if (word == "--threads") {
      a.threads = std::stoi(value());
    } else if (word == "--max-sigma") {
      a.max_sigma = std::stod(value());
    } else if (word == "--max-residual") {
      a.max_residual_share = std::stod(value());
    } else if (word == "--views") {
      a.views.clear();
      std::istringstream list(value());
      for (std::string view; std::getline(list, view, ',');) a.views.push_back(std::stoi(view));
    } else if (word.rfind("--", 0) == 0) {
      throw std::invalid_argument("unknown option " + word);
    } else {
      a.scenes.push_back(word);
    }
  }
  if (a.scenes.empty()) a.scenes = {"artwork", "totem"};
  return a;
}

/// A rectified pair, the exact disparity of the object (NaN elsewhere) and where it has steps.
struct View {
  stereo::RectifiedPair pair;
  cv::Mat truth, near_step;
};

View makeView(const simulation::Simulation& simulation, const simulation::Renderer& renderer,
              int index) {
  const StereoCalibration& cameras = simulation.rig().calibration;
  View view;
  auto pair = stereo::Rectifier(cameras).rectify(simulation.frame(index));
  if (!pair) throw std::runtime_error(pair.status().message());
  view.pair = *pair;
  const Eigen::Isometry3d T_map_camera =
      simulation.motion().at(simulation.viewTime(index)).T_map_base *
      simulation.rig().T_base_camera;
  const double fb = cameras.focalLength() * cameras.baseline();
  view.truth = fb / renderer.rectifiedDepth(cameras.left, T_map_camera, true);
  cv::Mat all = fb / renderer.rectifiedDepth(cameras.left, T_map_camera, false);
  all.setTo(0.0f, ~(all == all));
  cv::Mat high, low;
  cv::dilate(all, high, cv::Mat());
  cv::erode(all, low, cv::Mat());
  const int side = 2 * kNearStepPx + 1;
  cv::dilate((high - low) > kStepPx, view.near_step, cv::Mat::ones(side, side, CV_8UC1));
  return view;
}

struct Sample {
  float truth, found, sigma;
};

/// Everything that is known of one matcher on one scene.
struct Record {
  std::vector<Sample> inliers;
  std::size_t possible = 0, found = 0, near_step = 0, wrong_near_step = 0;

  void add(const View& view, const cv::Mat& disparity, const cv::Mat& sigma) {
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

enum class Sensor { kIdeal, kNoiseFree, kReal };
constexpr std::pair<Sensor, const char*> kSensors[] = {
    {Sensor::kIdeal, "without noise and mosaic"},
    {Sensor::kNoiseFree, "without noise"},
    {Sensor::kReal, "with noise"},
};

void measure(const std::string& scene, Sensor sensor, const char* sensor_name, const Arguments& a) {
  simulation::SimulationOptions options;
  if (sensor != Sensor::kReal) {
    options = simulation::noiseFree(options);
    options.render.samples = 16;  // few samples are noise too
    if (sensor == Sensor::kIdeal) options.sensor.format = PixelFormat::kMono8;
  }
  const simulation::Simulation simulation(scene, options, 1, Time(), a.threads);
  simulation::RenderOptions unlit;
  unlit.sky_occlusion = false;
  const simulation::Renderer renderer(simulation.scene(), unlit, a.threads);

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
  for (const int index : a.views) {
    const View view = makeView(simulation, renderer, index);
    const DisparityImage b = stereo::match(view.pair, block, a.threads, nullptr);
    of_block.add(view, b.disparity_px, b.sigma_px);
    const DisparityImage s = stereo::match(view.pair, semi_global, a.threads, nullptr);
    of_semi_global.add(view, s.disparity_px, s.sigma_px);
    const int border = kMinDisparity + kCount + kBlock;
    of_sgbm.add(view, openCv(*sgbm, border, view.pair), {});
    of_bm.add(view, openCv(*bm, border, view.pair), {});
  }
  std::printf("%s, %s, %zu views\n", scene.c_str(), sensor_name, a.views.size());
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

}  // namespace
}  // namespace scanner

int main(int argc, char** argv) {
  try {
    const scanner::Arguments arguments = scanner::parse(argc, argv);
    std::printf(
        "rms, median: of errors below 1 px; wrong: of 1 px and more; at step: the same within\n"
        "10 px of a depth edge; peak: fullest of 8 bins of the fraction, over the truth's; bias:\n"
        "largest mean error of one true fraction; ratio: rms error over predicted sigma, by "
        "deciles;\n"
        "surest: rms of so many of all pixels, by sigma\n\n");
    for (const std::string& scene : arguments.scenes) {
      for (const auto& [sensor, name] : scanner::kSensors) {
        scanner::measure(scene, sensor, name, arguments);
      }
    }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "stereo_accuracy: %s\n", e.what());
    return 1;
  }
  return 0;
}
