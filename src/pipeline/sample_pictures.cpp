#include "scanner/pipeline/sample_pictures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

namespace scanner::pipeline {
namespace {

constexpr int kWidth = 480;
constexpr std::size_t kMost = 64;  // kept while the scan goes on

std::string jpeg(const cv::Mat& image) {
  constexpr int kQuality = 85;
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return std::string(bytes.begin(), bytes.end());
}

cv::Mat small(const cv::Mat& image, int interpolation) {
  if (image.cols <= kWidth) return image;
  const double scale = static_cast<double>(kWidth) / image.cols;
  cv::Mat out;
  cv::resize(image, out, {kWidth, static_cast<int>(std::lround(scale * image.rows))}, 0.0, 0.0,
             interpolation);
  return out;
}

/// The values between which nearly all of the disparities lie; equal when there are none.
std::pair<float, float> usualRange(const cv::Mat& disparity_px) {
  std::vector<float> values;
  for (int row = 0; row < disparity_px.rows; ++row) {
    const float* pixels = disparity_px.ptr<float>(row);
    std::copy_if(pixels, pixels + disparity_px.cols, std::back_inserter(values),
                 [](float value) { return std::isfinite(value); });
  }
  if (values.empty()) return {0.0F, 0.0F};
  std::sort(values.begin(), values.end());
  constexpr std::size_t kLeftOut = 50;  // one in fifty at either end
  return {values[values.size() / kLeftOut], values[values.size() - 1 - values.size() / kLeftOut]};
}

/// Near is yellow, far is dark blue, unknown is grey.
cv::Mat colored(const cv::Mat& disparity_px) {
  const auto [low, high] = usualRange(disparity_px);
  const float scale = high > low ? 255.0F / (high - low) : 0.0F;
  cv::Mat levels(disparity_px.size(), CV_8UC1), unknown(disparity_px.size(), CV_8UC1);
  for (int row = 0; row < disparity_px.rows; ++row) {
    const float* pixels = disparity_px.ptr<float>(row);
    for (int column = 0; column < disparity_px.cols; ++column) {
      const bool known = std::isfinite(pixels[column]);
      const float level = known ? scale * (pixels[column] - low) : 0.0F;
      levels.at<unsigned char>(row, column) =
          static_cast<unsigned char>(std::clamp(level, 0.0F, 255.0F));
      unknown.at<unsigned char>(row, column) = known ? 0 : 255;
    }
  }
  cv::Mat out;
  cv::applyColorMap(levels, out, cv::COLORMAP_VIRIDIS);
  out.setTo(cv::Scalar(225, 222, 220), unknown);
  return out;
}

}  // namespace

void SamplePictures::add(int index, const cv::Mat& left, const DisparityImage& disparity) {
  const std::size_t number = seen_++;
  if (number % stride_ != 0) return;
  samples_.push_back({index, number, jpeg(small(left, cv::INTER_AREA)),
                      jpeg(colored(small(disparity.disparity_px, cv::INTER_NEAREST)))});
  if (samples_.size() <= kMost) return;
  stride_ *= 2;
  const auto odd = [this](const Sample& sample) { return sample.number % stride_ != 0; };
  samples_.erase(std::remove_if(samples_.begin(), samples_.end(), odd), samples_.end());
}

Status SamplePictures::write(ScanFolder& folder) const {
  if (samples_.empty()) return Status::ok();
  constexpr std::size_t kQuarters = 4;
  std::set<std::size_t> chosen;
  for (std::size_t quarter = 0; quarter < kQuarters; ++quarter) {
    const std::size_t wanted = quarter * seen_ / kQuarters;
    chosen.insert(std::min((wanted + stride_ / 2) / stride_, samples_.size() - 1));
  }
  for (const std::size_t i : chosen) {
    const Sample& sample = samples_[i];
    for (const auto& [name, bytes] :
         {std::pair{"left", &sample.left}, {"left_disparity", &sample.disparity}}) {
      if (Status status = folder.writePicture(sample.index, name, *bytes); !status) return status;
    }
  }
  return Status::ok();
}

}  // namespace scanner::pipeline
