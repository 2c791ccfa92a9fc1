/// Speed and memory of the stereo stage beside OpenCV's matchers, all in turn in one process.
#include <hwy/highway.h>
#include <hwy/targets.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "scanner/pipeline/config.h"
#include "scanner/ros/package_files.h"
#include "scanner/stereo/match.h"
#include "scanner/stereo/normals.h"
#include "scanner/stereo/stereo_processor.h"
#include "scanner/stereo/triangulate.h"
#include "stereo/matcher.h"
#include "stereo_bench_scene.h"
#include "tools/reference_matchers.h"
#include "tools/run.h"

namespace scanner::bench {
namespace {

struct Request {
  std::string size = "1024x768", disparities = "100:330", config, left, right;
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  int repetitions = 7;
  bool targets = false;
};

/// What is measured: one row of the table.
struct Item {
  std::string name;
  std::string against;  ///< row that the ratio refers to; empty: none
  double cells = 0.0;   ///< disparities that are evaluated; 0: does not apply
  std::function<void()> run;
  std::vector<double> wall, cpu;  ///< seconds
  double peak_mb = 0.0;           ///< resident, beyond what was resident before
};

double cpuSeconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// A line "NAME: n kB" of /proc/self/status, in MB; NaN where the system has none.
double statusMegabytes(const std::string& name) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.compare(0, name.size() + 1, name + ":") == 0) {
      return std::stod(line.substr(name.size() + 1)) / 1024.0;
    }
  }
  return std::numeric_limits<double>::quiet_NaN();
}

/// Makes the highest resident size (VmHWM) start anew.
void resetPeak() { std::ofstream("/proc/self/clear_refs") << "5\n"; }

/// The first run: warms caches up and does not count, but for the memory.
void measureMemory(Item& item) {
  malloc_trim(0);  // what others left in the heap would hide what this one takes
  resetPeak();
  const double resident = statusMegabytes("VmRSS");
  item.run();
  item.peak_mb = statusMegabytes("VmHWM") - resident;
}

void measure(Item& item) {
  const double cpu = cpuSeconds();
  const auto start = std::chrono::steady_clock::now();
  item.run();
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  item.wall.push_back(wall.count());
  item.cpu.push_back(cpuSeconds() - cpu);
}

double best(const std::vector<double>& values) {
  return *std::min_element(values.begin(), values.end());
}
double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Alternating, so that a machine that slows down slows all of them down.
void measureAll(std::vector<Item>& items, int repetitions) {
  for (Item& item : items) measureMemory(item);
  for (int i = 0; i < repetitions; ++i) {
    for (Item& item : items) measure(item);
  }
}

void print(const std::vector<Item>& items) {
  std::printf("%-34s %9s %9s %9s %9s %9s  %s\n", "", "best ms", "median ms", "CPU ms", "Mdisp/s",
              "peak MB", "ratio (wall, CPU)");
  for (const Item& item : items) {
    std::printf("%-34s %9.1f %9.1f %9.1f ", item.name.c_str(), 1e3 * best(item.wall),
                1e3 * median(item.wall), 1e3 * best(item.cpu));
    if (item.cells > 0.0) {
      std::printf("%9.0f ", 1e-6 * item.cells / best(item.wall));
    } else {
      std::printf("%9s ", "");
    }
    std::printf("%9.1f", item.peak_mb);
    for (const Item& other : items) {
      if (item.against.empty() || other.name != item.against) continue;
      std::printf("  %.2f, %.2f x as fast as %s", best(other.wall) / best(item.wall),
                  best(other.cpu) / best(item.cpu), other.name.c_str());
    }
    std::printf("\n");
  }
}

std::pair<int, int> twoNumbers(const std::string& text, char separator, const std::string& what) {
  int first = 0, second = 0, used = 0;
  const std::string pattern = std::string("%d") + separator + "%d%n";
  if (std::sscanf(text.c_str(), pattern.c_str(), &first, &second, &used) != 2 ||
      used != static_cast<int>(text.size())) {
    throw ConfigurationError(what + ": \"" + text + "\" is not two numbers with '" + separator +
                             "' between them");
  }
  return {first, second};
}

stereo::StereoOptions loadOptions(const Request& request) {
  stereo::StereoOptions options;
  if (!request.config.empty()) {
    options = pipeline::loadConfig(bridge::configPath(request.config)).stereo;
  }
  std::tie(options.matcher.min_disparity_px, options.matcher.max_disparity_px) =
      twoNumbers(request.disparities, ':', "--disparities");
  stereo::validate(options);
  return options;
}

BenchPair loadPair(const Request& request, const stereo::MatcherOptions& options) {
  if (request.left.empty()) {
    const auto [width, height] = twoNumbers(request.size, 'x', "--size");
    if (width <= options.max_disparity_px || height < 16 || width > 16384 || height > 16384) {
      throw ConfigurationError("--size: " + request.size + " does not suit the disparities");
    }
    return makeBenchPair({width, height}, options.min_disparity_px, options.max_disparity_px);
  }
  BenchPair pair;
  for (auto [name, picture] :
       {std::pair{&request.left, &pair.left}, std::pair{&request.right, &pair.right}}) {
    // OpenCV prints a line of its own about a file that is absent.
    if (std::filesystem::is_regular_file(*name)) {
      *picture = cv::imread(*name, cv::IMREAD_GRAYSCALE);
    }
    if (picture->empty()) throw std::runtime_error(*name + ": cannot be read as a picture");
  }
  if (pair.left.size() != pair.right.size()) {
    throw std::runtime_error(request.right + ": of another size than " + request.left);
  }
  return pair;
}

/// The published rig, its focal length scaled to the width.
StereoCalibration calibrationOf(const cv::Size& size) {
  StereoCalibration c;
  const double f = 1098.0 * size.width / 1024.0;
  for (CameraModel* eye : {&c.left, &c.right}) {
    eye->width = size.width;
    eye->height = size.height;
    eye->D = std::vector<double>(5, 0.0);
    eye->K << f, 0.0, 0.5 * (size.width - 1), 0.0, f, 0.5 * (size.height - 1), 0.0, 0.0, 1.0;
    eye->P.leftCols<3>() = eye->K;
  }
  c.right.P(0, 3) = -f * 0.12;
  return c;
}

/// Disparities that exist for one row after another: pixels on the left have fewer.
double cellsOfOurs(const cv::Size& size, const stereo::MatcherOptions& o) {
  double sum = 0.0;
  for (int x = o.min_disparity_px; x < size.width; ++x) {
    sum += std::min(x, o.max_disparity_px) - o.min_disparity_px + 1;
  }
  return sum * size.height;
}

double cellsOfReference(const cv::Size& size, const tools::ReferenceOptions& o) {
  const int count = tools::referenceDisparities(o);
  return static_cast<double>(count) * size.height *
         std::max(0, size.width - o.min_disparity_px - count + 1);
}

/// Everything that the items work on, and keeps alive.
struct Bench {
  Bench(const Request& request, const stereo::StereoOptions& given)
      : options(given), pictures(loadPair(request, given.matcher)), threads(request.threads) {
    pair.left_gray = pictures.left;
    pair.right_gray = pictures.right;
    calibration = calibrationOf(pictures.left.size());
    // Grey surfaces: their mosaic is the grey picture.
    frame.left = {pictures.left, PixelFormat::kBayerRggb8};
    frame.right = {pictures.right, PixelFormat::kBayerRggb8};
    reference.min_disparity_px = options.matcher.min_disparity_px;
    reference.max_disparity_px = options.matcher.max_disparity_px;
    reference.all_columns = false;
  }

  stereo::StereoOptions withMethod(stereo::MatchMethod method) const {
    stereo::StereoOptions out = options;
    out.matcher.method = method;
    return out;
  }
  void addOurs(stereo::MatchMethod method, const std::string& against, std::vector<Item>& items);
  /// The block matcher without what StereoBM has not.
  void addPlainBlock(std::vector<Item>& items);
  /// Twice: without the removal of speckles, as our matchers alone, and with it.
  void addReference(tools::Reference method, int window_px, const std::string& name,
                    std::vector<Item>& items);
  void addRest(std::vector<Item>& items);

  stereo::StereoOptions options;
  BenchPair pictures;
  int threads;
  stereo::RectifiedPair pair;
  StereoFrame frame;
  StereoCalibration calibration;
  tools::ReferenceOptions reference;
};

void Bench::addOurs(stereo::MatchMethod method, const std::string& against,
                    std::vector<Item>& items) {
  const bool block = method == stereo::MatchMethod::kBlock;
  const std::string name = block ? "block" : "semi_global";
  const stereo::StereoOptions o = withMethod(method);
  const double cells = cellsOfOurs(pictures.left.size(), o.matcher);
  const stereo::DisparitySearch search{o.matcher.min_disparity_px, o.matcher.max_disparity_px};
  const std::shared_ptr<const stereo::Matcher> matcher =
      block ? stereo::makeBlockMatcher(o.matcher) : stereo::makeSemiGlobalMatcher(o.matcher);
  std::printf(
      "%s: working memory of the matcher at most %.1f MB\n", name.c_str(),
      1e-6 * static_cast<double>(matcher->workingMemory(pictures.left.size(), search, threads)));
  const auto add = [&](const std::string& what, const std::string& rival, double count,
                       std::function<void()> run) {
    items.push_back({name + what, rival, count, std::move(run), {}, {}, 0.0});
  };
  add(", matcher alone", against, cells,
      [this, matcher, search] { matcher->match(pictures.left, pictures.right, search, threads); });
  add(", match() with all tests", against + ", speckles removed", cells,
      [this, o] { stereo::match(pair, o.matcher, threads); });
  const auto processor = std::make_shared<stereo::StereoProcessor>(calibration, o, threads);
  add(", StereoProcessor::process()", "", 0.0, [this, processor] {
    const auto output = processor->process(frame);
    if (!output) throw std::runtime_error(output.status().message());
  });
}

void Bench::addPlainBlock(std::vector<Item>& items) {
  stereo::MatcherOptions o = options.matcher;
  o.block.edge_enhancement = stereo::EdgeEnhancement::kSobel;
  o.block.shift_px = 0;
  const stereo::DisparitySearch search{o.min_disparity_px, o.max_disparity_px};
  const std::shared_ptr<const stereo::Matcher> matcher = stereo::makeBlockMatcher(o);
  items.push_back(
      {"block, settings of StereoBM",
       "StereoBM",
       cellsOfOurs(pictures.left.size(), o),
       [this, matcher, search] { matcher->match(pictures.left, pictures.right, search, threads); },
       {},
       {},
       0.0});
}

void Bench::addReference(tools::Reference method, int window_px, const std::string& name,
                         std::vector<Item>& items) {
  tools::ReferenceOptions o = reference;
  o.window_px = window_px;
  std::printf("%s: %s\n", name.c_str(), tools::describeReference(method, o).c_str());
  for (const bool speckles : {false, true}) {
    o.remove_speckles = speckles;
    items.push_back(
        {name + (speckles ? ", speckles removed" : ""),
         "",
         cellsOfReference(pictures.left.size(), o),
         [this, method, o] { tools::matchReference(method, pictures.left, pictures.right, o); },
         {},
         {},
         0.0});
  }
}

void Bench::addRest(std::vector<Item>& items) {
  const auto rectifier = std::make_shared<stereo::Rectifier>(calibration);
  items.push_back({"rectify (Bayer, both eyes, colour)",
                   "",
                   0.0,
                   [this, rectifier] { rectifier->rectify(frame).value(); },
                   {},
                   {},
                   0.0});
  const auto disparity =
      std::make_shared<DisparityImage>(stereo::match(pair, options.matcher, threads));
  const auto color = std::make_shared<cv::Mat>(rectifier->rectify(frame).value().left_color);
  items.push_back({"triangulate",
                   "",
                   0.0,
                   [this, disparity, color] {
                     stereo::triangulate(*disparity, *color, calibration, options.depth, threads);
                   },
                   {},
                   {},
                   0.0});
  const auto cloud = std::make_shared<OrganizedCloud>(
      stereo::triangulate(*disparity, *color, calibration, options.depth, threads));
  items.push_back({"normals",
                   "",
                   0.0,
                   [this, cloud] { stereo::estimateNormals(*cloud, options.normals, threads); },
                   {},
                   {},
                   0.0});
}

int run(const Request& request) {
  const stereo::StereoOptions options = loadOptions(request);
  Bench bench(request, options);
  cv::setNumThreads(request.threads);
  std::printf("%dx%d, disparities %d..%d, %d threads, best and median of %d in turn\n",
              bench.pictures.left.cols, bench.pictures.left.rows, options.matcher.min_disparity_px,
              options.matcher.max_disparity_px, request.threads, request.repetitions);
  std::vector<Item> items;
  bench.addOurs(stereo::MatchMethod::kBlock, "StereoBM", items);
  bench.addPlainBlock(items);
  bench.addReference(tools::Reference::kBlock, options.matcher.block.window_px, "StereoBM", items);
  bench.addOurs(stereo::MatchMethod::kSemiGlobal, "StereoSGBM", items);
  bench.addReference(tools::Reference::kSemiGlobal, 0, "StereoSGBM", items);
  bench.addReference(tools::Reference::kSemiGlobalThree, 0, "StereoSGBM 3WAY", items);
  bench.addRest(items);
  std::printf("OpenCV skips the left %d columns; Mdisp/s counts what each really evaluates.\n\n",
              options.matcher.min_disparity_px + tools::referenceDisparities(bench.reference) - 1);
  if (!request.targets) {
    measureAll(items, request.repetitions);
    print(items);
    return tools::kOk;
  }
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (Item& item : items) {
      item.wall.clear();
      item.cpu.clear();
    }
    measureAll(items, request.repetitions);
    std::printf("%s (ours; OpenCV chooses its own)\n", hwy::TargetName(target));
    print(items);
    std::printf("\n");
  }
  hwy::SetSupportedTargetsForTest(0);
  return tools::kOk;
}

}  // namespace
}  // namespace scanner::bench

int main(int argc, char** argv) {
  scanner::bench::Request request;
  CLI::App app("Speed and memory of the stereo stage beside OpenCV's matchers.", "bench_stereo");
  app.add_option("--size", request.size, "WxH of the generated pictures")->capture_default_str();
  app.add_option("--disparities", request.disparities, "MIN:MAX, px")->capture_default_str();
  app.add_option("--config", request.config, "field, thesis, room or a YAML file");
  auto* left =
      app.add_option("--left", request.left, "rectified picture instead of generated ones");
  auto* right = app.add_option("--right", request.right, "its right one");
  left->needs(right);
  right->needs(left);
  app.add_option("--threads", request.threads, "threads to use")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--repeat", request.repetitions, "runs of each")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  app.add_flag("--targets", request.targets, "once for each instruction set of this machine");
  return scanner::tools::run(app, argc, argv, [&] { return scanner::bench::run(request); });
}
