#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <stdexcept>
#include <thread>

#include "scanner/pipeline/config.h"
#include "scanner/ros/package_files.h"
#include "tools/progress_bar.h"
#include "tools/reference_matchers.h"
#include "tools/run.h"
#include "tools/stereo_pictures.h"
#include "tools/stereo_tables.h"

namespace {

namespace fs = std::filesystem;
using scanner::tools::StereoMethod;
using scanner::tools::StereoRun;

struct Request {
  std::string folder, config, out, json;
  std::vector<std::string> methods{"ours_block", "ours_semi_global", "bm", "sgbm"};
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  int repetitions = 3;
  int bm_window = scanner::tools::kReferenceBlockWindow;
  int sgbm_window = scanner::tools::kReferenceSemiGlobalWindow;
  bool full = false;
  bool fill = true;
};

/// Ours take the configuration that the user names, else the one that suits such pictures.
StereoMethod makeMethod(const Request& request, const std::string& name) {
  StereoMethod method =
      scanner::tools::stereoMethod(name, name == "bm" ? request.bm_window : request.sgbm_window);
  if (!method.ours) return method;
  const std::string suitable = method.block ? "middlebury_block" : "middlebury";
  const std::string config = request.config.empty() ? suitable : request.config;
  const auto loaded = scanner::pipeline::loadConfig(scanner::bridge::configPath(config));
  configure(loaded.stereo.matcher, config, method);
  return method;
}

void printHead(const Request& request, const std::vector<StereoMethod>& methods) {
  std::printf(
      "%d threads, times are wall time without filling holes, best of %d; shares are of the pixels "
      "of known disparity\n",
      request.threads, request.repetitions);
  for (const StereoMethod& method : methods) {
    std::printf("  %-17s  %s\n", method.name.c_str(), method.settings.c_str());
  }
  std::printf(
      "OpenCV's search every column (pictures prolonged on the left) of the same range, and "
      "all maps are filled the same way.\n");
}

void writeJson(const Request& request, const std::vector<StereoMethod>& methods,
               const std::vector<scanner::tools::SceneResult>& results) {
  nlohmann::json root = {{"threads", request.threads}, {"scenes", toJson(results)}};
  for (const StereoMethod& method : methods) root["methods"][method.name] = method.settings;
  std::ofstream file(request.json);
  file << root.dump(2) << "\n";
  if (!file.flush()) throw std::runtime_error(request.json + ": cannot be written");
}

/// OpenCV takes no other windows.
CLI::Validator oddWindow(int least) {
  const auto check = [least](const std::string& text) {
    int value = 0;
    if (CLI::detail::lexical_cast(text, value) && value >= least && value <= 51 && value % 2 == 1) {
      return std::string();
    }
    return text + " is not odd, or not from " + std::to_string(least) + " to 51";
  };
  return CLI::Validator(check, "ODD");
}

std::vector<scanner::tools::SceneResult> measureScenes(const Request& request,
                                                       const std::vector<std::string>& folders,
                                                       const std::vector<StereoMethod>& methods) {
  scanner::tools::ProgressBar bar("evaluate_stereo");
  std::vector<scanner::tools::SceneResult> results;
  for (const std::string& folder : folders) {
    const auto scene = scanner::evaluation::readStereoScene(folder);
    if (!scene) throw std::runtime_error(scene.status().message());
    std::vector<StereoRun> runs;
    runs.reserve(methods.size());
    for (const StereoMethod& method : methods) {
      runs.push_back(runStereo(method, *scene, request.threads, request.repetitions));
      if (request.fill) fillRun(*scene, request.threads, runs.back());
    }
    results.push_back(measureScene(*scene, methods, runs));
    std::fputs(sceneTable(results.back(), request.full).c_str(), stdout);
    std::fflush(stdout);
    if (!request.out.empty()) {
      const fs::path name = fs::path(scene->group) / scene->name;
      writeStereoPictures(fs::path(request.out) / name, *scene, methods, runs);
    }
    bar.show(results.size(), folders.size(), scene->name);
  }
  return results;
}

int evaluate(const Request& request) {
  std::vector<StereoMethod> methods;
  for (const std::string& name : request.methods) methods.push_back(makeMethod(request, name));
  const auto folders = scanner::evaluation::findStereoScenes(request.folder);
  if (!folders) throw std::runtime_error(folders.status().message());
  cv::setNumThreads(request.threads);
  printHead(request, methods);
  const auto results = measureScenes(request, *folders, methods);
  std::fputs(averageTables(results).c_str(), stdout);
  std::fputs(comparisonTables(results).c_str(), stdout);
  if (!request.json.empty()) writeJson(request, methods, results);
  return scanner::tools::kOk;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CLI::App app("Disparity maps against known ones: ours and OpenCV's, side by side.",
               "evaluate_stereo");
  app.add_option("DIR", request.folder, "scene of a Middlebury set, or a folder of them")
      ->required();
  app.add_option("--config", request.config,
                 "of ours: field, thesis, room or a YAML file; default: middlebury for "
                 "ours_semi_global, middlebury_block for ours_block");
  app.add_option("--methods", request.methods, "what to compare")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  app.add_option("--threads", request.threads, "threads to use; the result is the same")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--repeat", request.repetitions, "runs of each method, for the time")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--bm-window", request.bm_window, "px, of StereoBM")
      ->check(oddWindow(5))
      ->capture_default_str();
  app.add_option("--sgbm-window", request.sgbm_window, "px, of StereoSGBM")
      ->check(oddWindow(1))
      ->capture_default_str();
  app.add_flag("--full", request.full, "every threshold and region of every scene");
  app.add_flag("!--no-fill", request.fill,
               "leave out the filled maps, which take longer than matching");
  app.add_option("--out", request.out, "folder for pictures of disparities and errors");
  app.add_option("--json", request.json, "file for all figures");
  return scanner::tools::run(app, argc, argv, [&] { return evaluate(request); });
}
