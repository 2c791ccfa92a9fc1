#include "scanner/simulation/sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "scanner/core/parallel.h"
#include "scanner/core/status.h"
#include "scanner/simulation/random.h"

namespace scanner::simulation {
namespace {

constexpr std::size_t kRowsPerTask = 16;
enum Channel { kRed = 0, kGreen = 1, kBlue = 2 };

/// Colour of the filter over each pixel of a 2x2 tile, by rows.
std::array<Channel, 4> mosaic(PixelFormat format) {
  switch (format) {
    case PixelFormat::kBayerRggb8:
      return {kRed, kGreen, kGreen, kBlue};
    case PixelFormat::kBayerBggr8:
      return {kBlue, kGreen, kGreen, kRed};
    case PixelFormat::kBayerGbrg8:
      return {kGreen, kBlue, kRed, kGreen};
    case PixelFormat::kBayerGrbg8:
      return {kGreen, kRed, kBlue, kGreen};
    case PixelFormat::kMono8:
    case PixelFormat::kBgr8:
      break;
  }
  throw ConfigurationError("mosaic of a format that has none");
}

/// Standard normal that depends on the two numbers only (Box and Muller 1958).
float normalOf(std::uint64_t seed, std::uint64_t index) {
  const std::uint64_t bits = mixSeed(seed, index);
  const float u = (static_cast<float>(bits >> 40U) + 0.5F) * 0x1.0p-24F;
  const float angle = static_cast<float>(bits & 0xffffffU) * (0x1.0p-24F * 6.2831853F);
  return std::sqrt(-2.0F * std::log(u)) * std::cos(angle);
}

class Pixel {
 public:
  Pixel(const cv::Size& size, const SensorOptions& options, const Exposure& exposure,
        std::uint64_t seed)
      : size_(size), options_(options), seed_(seed) {
    electrons_ = static_cast<float>(options.radiance_e_per_s * exposure.exposure_s);
    gain_ =
        static_cast<float>(255.0 / options.full_well_e * std::pow(10.0, exposure.gain_db / 20.0));
    read_variance_ = static_cast<float>(options.read_noise_e * options.read_noise_e);
  }

  /// Share of the light that reaches this pixel.
  float vignette(int row, int col) const {
    const float x = (static_cast<float>(col) + 0.5F) / static_cast<float>(size_.width) - 0.5F;
    const float y = (static_cast<float>(row) + 0.5F) / static_cast<float>(size_.height) - 0.5F;
    return 1.0F - static_cast<float>(options_.vignetting) * 2.0F * (x * x + y * y);
  }

  std::uint8_t digitize(float radiance, int row, int col, int channel) const {
    float electrons = std::max(0.0F, radiance) * electrons_;
    if (options_.noise) {
      const auto index =
          (static_cast<std::uint64_t>(row) * static_cast<std::uint64_t>(size_.width) +
           static_cast<std::uint64_t>(col)) *
              3U +
          static_cast<std::uint64_t>(channel);
      electrons += std::sqrt(electrons + read_variance_) * normalOf(seed_, index);
    }
    const float full = static_cast<float>(options_.full_well_e);
    const float value = std::clamp(electrons, 0.0F, full) * gain_ + 0.5F;
    return static_cast<std::uint8_t>(std::clamp(value, 0.0F, 255.0F));
  }

 private:
  cv::Size size_;
  const SensorOptions& options_;
  std::uint64_t seed_;
  float electrons_, gain_, read_variance_;
};

void exposeRow(const cv::Mat& radiance, const Pixel& pixel, PixelFormat format, int row,
               cv::Mat& out) {
  const auto* in = radiance.ptr<cv::Vec3f>(row);
  for (int col = 0; col < radiance.cols; ++col) {
    const cv::Vec3f light = in[col] * pixel.vignette(row, col);
    if (format == PixelFormat::kBgr8) {
      for (int c = 0; c < 3; ++c) {
        out.at<cv::Vec3b>(row, col)[2 - c] = pixel.digitize(light[c], row, col, c);
      }
    } else if (format == PixelFormat::kMono8) {
      constexpr float kLuma[] = {0.299F, 0.587F, 0.114F};
      const float grey = kLuma[0] * light[0] + kLuma[1] * light[1] + kLuma[2] * light[2];
      out.at<std::uint8_t>(row, col) = pixel.digitize(grey, row, col, 0);
    } else {
      const Channel channel = mosaic(format)[static_cast<std::size_t>((row % 2) * 2 + col % 2)];
      out.at<std::uint8_t>(row, col) = pixel.digitize(light[channel], row, col, 0);
    }
  }
}

}  // namespace

Image expose(const cv::Mat& radiance, const SensorOptions& options, const Exposure& exposure,
             std::uint64_t noise_seed, int threads) {
  if (radiance.type() != CV_32FC3) throw ConfigurationError("expose: radiance must be CV_32FC3");
  Image image;
  image.format = options.format;
  image.data.create(radiance.size(), image.format == PixelFormat::kBgr8 ? CV_8UC3 : CV_8UC1);
  const Pixel pixel(radiance.size(), options, exposure, noise_seed);
  parallelFor(static_cast<std::size_t>(radiance.rows), kRowsPerTask, threads,
              [&](std::size_t begin, std::size_t end) {
                for (std::size_t row = begin; row < end; ++row) {
                  exposeRow(radiance, pixel, image.format, static_cast<int>(row), image.data);
                }
              });
  return image;
}

Exposure meter(const cv::Mat& radiance, const SensorOptions& options) {
  constexpr double kShare = 0.95, kFill = 0.85, kShortest_s = 20e-6, kLongest_s = 30e-3;
  std::vector<float> brightest;
  brightest.reserve(radiance.total());
  for (const cv::Vec3f& light : cv::Mat_<cv::Vec3f>(radiance)) {
    brightest.push_back(std::max({light[0], light[1], light[2]}));
  }
  Exposure exposure{options.exposure_s, options.gain_db};
  if (brightest.empty()) return exposure;
  const auto at = brightest.begin() +
                  static_cast<std::ptrdiff_t>(kShare * static_cast<double>(brightest.size() - 1));
  std::nth_element(brightest.begin(), at, brightest.end());
  const double gain = std::pow(10.0, options.gain_db / 20.0);
  const double wanted_e = kFill * options.full_well_e / gain;
  const double rate = std::max(1.0, static_cast<double>(*at) * options.radiance_e_per_s);
  exposure.exposure_s = std::clamp(wanted_e / rate, kShortest_s, kLongest_s);
  return exposure;
}

}  // namespace scanner::simulation
