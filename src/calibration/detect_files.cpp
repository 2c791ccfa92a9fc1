#include <algorithm>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "calibration/text.h"
#include "scanner/calibration/calibration_files.h"
#include "scanner/core/parallel.h"

namespace scanner::calibration {
namespace {

cv::Mat readGray(const std::string& path) {
  // Pictures carry the order of the sensor's pixels; a viewer's hint to turn them is not followed.
  cv::Mat gray = cv::imread(path, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  if (gray.empty()) throw ConfigurationError("cannot read picture " + path);
  return gray;
}

std::string sizeText(cv::Size size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

/// A board of another size that the pictures do show, for the message.
std::string otherBoard(const std::vector<PicturePair>& pairs, const Board& board,
                       const StereoCalibrationOptions& options) {
  constexpr std::size_t kMost = 3;
  for (std::size_t i = 0; i < std::min(kMost, pairs.size()); ++i) {
    const cv::Mat gray = readGray(pairs[i].left);
    for (const auto& [columns, rows] : {std::pair(board.columns - 1, board.rows - 1),
                                        std::pair(board.columns + 1, board.rows + 1)}) {
      const Board other{columns, rows, board.square_m};
      if (columns < 3 || rows < 3 || detectBoard(gray, other, options).empty()) continue;
      return format("; they show one of %dx%d: a board is counted in inner corners, --board %dx%d",
                    columns, rows, columns, rows);
    }
  }
  return ": count its inner corners, and see that all of it and a white border are in both "
         "pictures, sharp and evenly lit";
}

}  // namespace

Result<DetectedBoards> detectBoards(const std::vector<PicturePair>& pairs, const Board& board,
                                    const StereoCalibrationOptions& options, int threads,
                                    const Progress& progress) {
  validate(board);
  std::vector<std::optional<Result<BoardObservation>>> found(pairs.size());
  std::vector<cv::Size> sizes(pairs.size());
  std::mutex mutex;
  std::size_t done = 0;
  parallelFor(pairs.size(), 1, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const cv::Mat left = readGray(pairs[i].left), right = readGray(pairs[i].right);
      sizes[i] = left.size();
      found[i] = detectBoards(pairs[i].name, left, right, board, options);
      const std::lock_guard<std::mutex> lock(mutex);
      if (progress) progress(++done, pairs.size(), pairs[i].name);
    }
  });
  DetectedBoards boards;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (i > 0 && sizes[i] != sizes[0]) {
      return Status(StatusCode::kInvalidInput, pairs[i].left + " is " + sizeText(sizes[i]) + ", " +
                                                   pairs[0].left + " is " + sizeText(sizes[0]));
    }
    if (*found[i]) {
      boards.observations.push_back(**found[i]);
      boards.pairs.push_back(pairs[i]);
    } else if (found[i]->status().code() == StatusCode::kNotEnoughData) {
      boards.skipped.push_back(found[i]->status().message());
    } else {
      return found[i]->status();
    }
  }
  if (boards.observations.empty() && !pairs.empty()) {
    return Status(StatusCode::kNotEnoughData, "no pair shows a board of " +
                                                  std::to_string(board.columns) + "x" +
                                                  std::to_string(board.rows) + " inner corners" +
                                                  otherBoard(pairs, board, options));
  }
  if (!pairs.empty()) boards.image_size = sizes[0];
  return boards;
}

}  // namespace scanner::calibration
