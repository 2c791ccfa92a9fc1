#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <thread>

#include "scanner/calibration/calibration_files.h"
#include "tools/progress_bar.h"
#include "tools/run.h"

namespace {

namespace calibration = scanner::calibration;

struct Request {
  std::string folder, board, out, rig, config;
  double square_m = 0.0, square_height_m = 0.0;
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
};

calibration::Board boardOf(const Request& request) {
  calibration::Board board;
  board.square_m = request.square_m;
  board.square_height_m = request.square_height_m;
  char rest = 0;
  if (std::sscanf(request.board.c_str(), "%dx%d%c", &board.columns, &board.rows, &rest) != 2) {
    throw scanner::ConfigurationError("--board " + request.board +
                                      ": give inner corners as COLUMNSxROWS, for example 9x6");
  }
  calibration::validate(board);
  return board;
}

template <typename T>
T require(scanner::Result<T> result, const std::string& folder) {
  if (!result) throw std::runtime_error(folder + ": " + result.status().message());
  return std::move(result).value();
}

void writePicture(const std::string& path, const cv::Mat& picture) {
  if (!cv::imwrite(path, picture)) throw scanner::ConfigurationError("cannot write " + path);
}

/// The pair that the check picture is made of: the used board that reaches furthest out, where a
/// wrong calibration shows.
std::size_t telling(const calibration::StereoCalibrationReport& report) {
  const cv::Point2d middle(0.5 * report.calibration.left.width,
                           0.5 * report.calibration.left.height);
  std::size_t best = 0;
  double furthest = -1.0;
  for (std::size_t i = 0; i < report.views.size(); ++i) {
    if (!report.views[i].used) continue;
    for (const cv::Point2f& p : report.views[i].left) {
      const double distance = cv::norm(cv::Point2d(p) - middle);
      if (distance <= furthest) continue;
      furthest = distance;
      best = i;
    }
  }
  return best;
}

int calibrate(const Request& request) {
  const calibration::Board board = boardOf(request);
  const auto options = request.config.empty() ? calibration::StereoCalibrationOptions()
                                              : calibration::loadCalibrationOptions(request.config);
  if (!request.rig.empty()) scanner::loadRig(request.rig);
  const auto folder = calibration::findPicturePairs(request.folder);
  if (folder.pairs.empty()) {
    throw std::runtime_error(request.folder +
                             ": no pair of pictures; name them like left01.png "
                             "and right01.png, or put them into left/ and right/");
  }
  scanner::tools::ProgressBar bar("boards");
  const auto boards =
      require(calibration::detectBoards(
                  folder.pairs, board, options, request.threads,
                  [&](auto done, auto total, const auto& name) { bar.show(done, total, name); }),
              request.folder);
  for (const std::string& name : folder.unpaired) std::printf("no pair     %s\n", name.c_str());
  for (const std::string& line : boards.skipped) std::printf("skipped     %s\n", line.c_str());
  const auto report = require(
      calibrateStereo(boards.observations, board, boards.image_size, options, request.threads),
      request.folder);

  const auto stem = std::filesystem::path(request.out).replace_extension().string();
  const calibration::PicturePair& pair = boards.pairs[telling(report)];
  constexpr int kFlags = cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION;
  calibration::writeRig(request.out, report, request.rig);
  writePicture(stem + ".rectified.png",
               calibration::rectifiedPicture(cv::imread(pair.left, kFlags),
                                             cv::imread(pair.right, kFlags), report.calibration));
  writePicture(stem + ".residuals.png", calibration::residualPicture(report));
  std::ofstream json(stem + ".report.json");
  json << calibration::reportJson(report);
  json.close();
  if (!json) throw scanner::ConfigurationError("cannot write " + stem + ".report.json");

  std::fputs(reportText(report).c_str(), stdout);
  return scanner::tools::kOk;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CLI::App app("Calibrates a stereo camera from pairs of pictures of a chessboard.",
               "calibrate_stereo");
  app.add_option("DIR", request.folder, "folder with pairs: left01.png and right01.png, or alike")
      ->required();
  app.add_option("--board", request.board,
                 "inner corners, COLUMNSxROWS: a board of 5x7 squares is 4x6")
      ->required();
  app.add_option("--square", request.square_m, "m, side of one square as measured on the print")
      ->required()
      ->check(CLI::Range(1e-4, 10.0));
  app.add_option("--square-height", request.square_height_m,
                 "m, if squares are not as high (along COLUMNS of corners) as they are wide")
      ->check(CLI::Range(1e-4, 10.0));
  app.add_option("--out", request.out,
                 "rig file to write; .rectified.png, .residuals.png, .report.json beside it")
      ->required();
  app.add_option("--rig", request.rig, "rig file whose other entries are kept");
  app.add_option("--config", request.config, "YAML file with a block `calibration`");
  app.add_option("--threads", request.threads, "the result does not depend on it")
      ->check(CLI::Range(1, 256));
  // Pairs run side by side; OpenCV's own threads would only wait for each other.
  cv::setNumThreads(1);
  return scanner::tools::run(app, argc, argv, [&] { return calibrate(request); });
}
