#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "evaluation/pfm.h"
#include "evaluation/stereo_layout.h"
#include "scanner/evaluation/stereo_evaluation.h"

namespace scanner::evaluation {
namespace fs = std::filesystem;
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
/// Masks are white in the region; grey and black mean other things.
constexpr double kWhite = 250.0;
constexpr int kMaxDisparity = 16384;

/// What the pages of version 2 of the table prescribe.
struct Prescribed {
  const char* name;
  int width, height, disparities;
};
constexpr std::array<Prescribed, 4> kVersion2{{{"tsukuba", 384, 288, 16},
                                               {"venus", 434, 383, 20},
                                               {"teddy", 450, 375, 60},
                                               {"cones", 450, 375, 60}}};

const Prescribed* prescribed(const std::string& name, const cv::Size& size) {
  std::string lower = name;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const Prescribed& scene : kVersion2) {
    if (lower == scene.name && size == cv::Size(scene.width, scene.height)) return &scene;
  }
  return nullptr;
}

std::string text(const cv::Size& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

Result<cv::Mat> readPicture(const fs::path& file, int mode) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) {
    return Status(StatusCode::kIoError, file.string() + ": no such file");
  }
  cv::Mat picture;
  try {
    picture = cv::imread(file.string(), mode);
  } catch (const cv::Exception&) {
    picture.release();  // a header that promises too much
  }
  if (picture.empty()) return Status(StatusCode::kIoError, file.string() + ": not a picture");
  return picture;
}

Status sameSize(const fs::path& file, const cv::Mat& picture, const cv::Size& size) {
  if (picture.size() == size) return Status::ok();
  return {StatusCode::kInvalidInput,
          file.string() + ": is " + text(picture.size()) + ", the left picture is " + text(size)};
}

/// Grey levels per pixel, or 0 where no rule says it.
double scaleOf(const StereoLayout& layout, int rows) {
  if (layout.scale > 0.0) return layout.scale;
  // The sets come at full, half, third and quarter size, and scale disparities as the pictures.
  const auto full = [rows](double full_rows) {
    return std::max(1.0, std::round(full_rows / rows));
  };
  switch (layout.kind) {
    case StereoLayout::Kind::k2005:
      return full(1110.0);
    case StereoLayout::Kind::k2003:
      return full(1500.0);
    case StereoLayout::Kind::kScale8:
      return 8.0;
    case StereoLayout::Kind::kScale16:
      return 16.0;
    default:
      return 0.0;
  }
}

/// CV_32FC1, NaN where unknown. `levels`, out: largest disparity that the file can hold, or 0.
Result<cv::Mat> readTruth(const fs::path& file, const StereoLayout& layout, const cv::Size& size,
                          int& levels) {
  cv::Mat truth;
  if (file.extension() == ".pfm") {
    const auto map = readPfm(file.string());
    if (!map) return map.status();
    truth = *map;
    const double scale = layout.scale > 0.0 ? layout.scale : 1.0;
    for (float& d : cv::Mat_<float>(truth)) {
      d = std::isfinite(d) ? static_cast<float>(d / scale) : kNan;
    }
    levels = 0;
  } else {
    const auto picture = readPicture(file, cv::IMREAD_ANYDEPTH | cv::IMREAD_GRAYSCALE);
    if (!picture) return picture.status();
    const double scale = scaleOf(layout, picture->rows);
    if (scale <= 0.0) {
      return Status(StatusCode::kInvalidInput,
                    file.string() + ": scale unknown, scene.txt must give it (scale = 8)");
    }
    picture->convertTo(truth, CV_32F, 1.0 / scale);
    truth.setTo(kNan, *picture == 0);
    levels = static_cast<int>((picture->depth() == CV_8U ? 255.0 : 65535.0) / scale);
  }
  if (const Status s = sameSize(file, truth, size); !s) return s;
  return truth;
}

Result<cv::Mat> readMask(const fs::path& file, const cv::Size& size) {
  auto picture = readPicture(file, cv::IMREAD_GRAYSCALE);
  if (!picture) return picture.status();
  if (const Status s = sameSize(file, *picture, size); !s) return s;
  return cv::Mat(*picture >= kWhite);
}

Status readPictures(const fs::path& folder, const StereoLayout& layout, StereoScene& scene) {
  for (auto [name, picture] :
       {std::pair{&layout.left, &scene.left}, std::pair{&layout.right, &scene.right}}) {
    const fs::path file = folder / *name;
    auto read = readPicture(file, cv::IMREAD_COLOR);
    if (!read) return read.status();
    *picture = std::move(*read);
    if (const Status s = sameSize(file, *picture, scene.left.size()); !s) return s;
  }
  return Status::ok();
}

Status readRegions(const fs::path& folder, const StereoLayout& layout, const cv::Mat& right_truth,
                   StereoScene& scene) {
  const cv::Size size = scene.left.size();
  const auto given = [&](const std::string& name, cv::Mat& mask) {
    auto read = readMask(folder / name, size);
    if (!read) return read.status();
    mask = std::move(*read);
    return Status::ok();
  };
  scene.all = cv::Mat(scene.truth == scene.truth);
  if (layout.border > 0) {
    cv::Mat inner = cv::Mat::zeros(size, CV_8UC1);
    const cv::Rect kept(layout.border, layout.border, size.width - 2 * layout.border,
                        size.height - 2 * layout.border);
    if (kept.width > 0 && kept.height > 0) inner(kept).setTo(255);
    scene.all &= inner;
  }
  if (!layout.all.empty()) {
    cv::Mat mask;
    if (const Status s = given(layout.all, mask); !s) return s;
    scene.all &= mask;
  }
  scene.nonocc_derived = layout.nonocc.empty();
  if (scene.nonocc_derived) scene.nonocc = nonOccluded(scene.truth, right_truth);
  if (!scene.nonocc_derived) {
    if (const Status s = given(layout.nonocc, scene.nonocc); !s) return s;
  }
  scene.nonocc &= scene.all;
  scene.disc_derived = layout.disc.empty();
  if (scene.disc_derived) {
    const cv::Mat occluded = scene.all & ~scene.nonocc;
    scene.disc = nearDepthSteps(scene.truth, occluded, kStepGap, kStepWidth);
  }
  if (!scene.disc_derived) {
    if (const Status s = given(layout.disc, scene.disc); !s) return s;
  }
  scene.disc &= scene.nonocc;
  return Status::ok();
}

/// Range to search: scene.txt, the table's, calib.txt, what the file can hold; in this order.
Status findRange(const fs::path& folder, const StereoLayout& layout, int levels,
                 StereoScene& scene) {
  const Prescribed* known = prescribed(scene.name, scene.left.size());
  scene.in_version2_table = known != nullptr;
  int high = readCount(folder / "calib.txt", "ndisp", levels + 1) - 1;
  if (known != nullptr) high = known->disparities - 1;
  if (layout.max_disparity >= 0) high = layout.max_disparity;
  scene.min_disparity_px = std::max(0, layout.min_disparity);
  if (high < 1 || high > kMaxDisparity || high <= scene.min_disparity_px) {
    return {StatusCode::kInvalidInput,
            folder.string() +
                ": range of disparities unknown or empty; calib.txt (ndisp) or "
                "scene.txt (max_disparity) must give it"};
  }
  scene.max_disparity_px = std::min(high, scene.left.cols - 1);
  return Status::ok();
}

}  // namespace

Result<StereoScene> readStereoScene(const std::string& folder_name) {
  const fs::path folder = fs::weakly_canonical(folder_name);
  const auto layout = findLayout(folder);
  if (!layout) return layout.status();
  StereoScene scene;
  scene.name = folder.filename().string();
  scene.group = folder.parent_path().filename().string();
  if (const Status s = readPictures(folder, *layout, scene); !s) return s;
  int levels = 0, ignored = 0;
  auto truth = readTruth(folder / layout->truth, *layout, scene.left.size(), levels);
  if (!truth) return truth.status();
  scene.truth = std::move(*truth);
  cv::Mat right_truth;
  if (!layout->truth_right.empty()) {
    auto read = readTruth(folder / layout->truth_right, *layout, scene.left.size(), ignored);
    if (!read) return read.status();
    right_truth = std::move(*read);
  }
  if (const Status s = readRegions(folder, *layout, right_truth, scene); !s) return s;
  if (const Status s = findRange(folder, *layout, levels, scene); !s) return s;
  if (cv::countNonZero(scene.all) == 0) {
    return Status(StatusCode::kNotEnoughData,
                  (folder / layout->truth).string() + ": no disparity in it is known");
  }
  return scene;
}

Result<std::vector<std::string>> findStereoScenes(const std::string& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return Status(StatusCode::kIoError, folder + ": no such folder");
  }
  if (looksLikeScene(folder)) return std::vector<std::string>{folder};
  std::vector<std::string> found;
  const auto skip = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator it(folder, skip, error), end; it != end && !error;
       it.increment(error)) {
    std::error_code ignored;
    if (it->is_directory(ignored) && looksLikeScene(it->path())) {
      found.push_back(it->path().string());
    }
  }
  if (found.empty()) return Status(StatusCode::kNotEnoughData, folder + ": no stereo scene in it");
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace scanner::evaluation
