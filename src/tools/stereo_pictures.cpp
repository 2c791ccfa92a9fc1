#include "tools/stereo_pictures.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

namespace scanner::tools {
namespace {

constexpr double kLargestError = 4.0;
constexpr int kTitleHeight = 18;

/// `low`..`high` onto a colour map; NaN in one colour.
cv::Mat colored(const cv::Mat& values, double low, double high, int map, const cv::Scalar& none) {
  cv::Mat levels, out;
  const cv::Mat known = values == values;
  values.convertTo(levels, CV_8U, 255.0 / (high - low), -255.0 * low / (high - low));
  cv::applyColorMap(levels, out, map);
  out.setTo(none, ~known);
  return out;
}

cv::Mat disparityPicture(const evaluation::StereoScene& scene, const cv::Mat& disparity) {
  return colored(disparity, scene.min_disparity_px, scene.max_disparity_px, cv::COLORMAP_TURBO,
                 cv::Scalar::all(0));
}

cv::Mat errorPicture(const evaluation::StereoScene& scene, const cv::Mat& disparity) {
  const cv::Mat error = cv::abs(disparity - scene.truth);
  cv::Mat out = colored(error, 0.0, kLargestError, cv::COLORMAP_PLASMA, cv::Scalar::all(255));
  out.setTo(cv::Scalar::all(128), ~scene.all);
  return out;
}

cv::Mat titled(const cv::Mat& picture, const std::string& title) {
  cv::Mat out;
  cv::copyMakeBorder(picture, out, kTitleHeight, 0, 0, 0, cv::BORDER_CONSTANT);
  cv::putText(out, title, {4, kTitleHeight - 5}, cv::FONT_HERSHEY_SIMPLEX, 0.4,
              cv::Scalar::all(255), 1, cv::LINE_AA);
  return out;
}

void write(const std::filesystem::path& file, const cv::Mat& picture) {
  if (!cv::imwrite(file.string(), picture)) {
    throw std::runtime_error(file.string() + ": cannot be written");
  }
}

}  // namespace

void writeStereoPictures(const std::filesystem::path& folder, const evaluation::StereoScene& scene,
                         const std::vector<StereoMethod>& methods,
                         const std::vector<StereoRun>& runs) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
  const cv::Mat truth = disparityPicture(scene, scene.truth);
  write(folder / "truth.png", truth);
  std::vector<cv::Mat> rows(3);
  cv::Mat regions;  // white nonocc, grey occluded, blue near depth steps
  cv::cvtColor(scene.all / 2, regions, cv::COLOR_GRAY2BGR);
  regions.setTo(cv::Scalar::all(255), scene.nonocc);
  regions.setTo(cv::Scalar(255, 160, 64), scene.disc);
  rows[0] = titled(scene.left, scene.name);
  rows[1] = titled(truth, "truth");
  rows[2] = titled(regions, "nonocc, all, disc");
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const std::string& name = methods[m].name;
    const cv::Mat disparity = disparityPicture(scene, runs[m].disparity);
    cv::Mat filled = cv::Mat::zeros(disparity.size(), disparity.type());
    if (!runs[m].filled.empty()) {
      filled = disparityPicture(scene, runs[m].filled);
      write(folder / (name + "_filled.png"), filled);
    }
    const cv::Mat wrong = errorPicture(scene, runs[m].disparity);
    write(folder / (name + "_disparity.png"), disparity);
    write(folder / (name + "_error.png"), wrong);
    cv::hconcat(rows[0], titled(disparity, name), rows[0]);
    cv::hconcat(rows[1], titled(filled, name + ", filled"), rows[1]);
    cv::hconcat(rows[2], titled(wrong, name + ", error, 0..4 px"), rows[2]);
  }
  cv::Mat sheet;
  cv::vconcat(rows, sheet);
  write(folder / "sheet.png", sheet);
}

}  // namespace scanner::tools
