#include "scanner/simulation/sensor.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>

#include "scanner/core/status.h"

namespace scanner::simulation {
namespace {

cv::Mat flat(float r, float g, float b, int rows = 128, int cols = 128) {
  return cv::Mat(rows, cols, CV_32FC3, cv::Scalar(r, g, b));
}

SensorOptions quiet() {
  SensorOptions options;
  options.noise = false;
  options.vignetting = 0.0;
  options.radiance_e_per_s = 1e6;
  options.full_well_e = 13000.0;
  return options;
}

const Exposure kExposure{0.005, 0.0};  // 5000 electrons for radiance 1: 98.1 of 255

TEST(Sensor, MosaicsPutTheColoursWhereTheFormatSays) {
  const cv::Mat light = flat(1.0F, 0.5F, 0.25F);
  const int r = 98, g = 49, b = 25;
  const std::map<PixelFormat, std::array<int, 4>> expected = {
      {PixelFormat::kBayerRggb8, {r, g, g, b}},
      {PixelFormat::kBayerBggr8, {b, g, g, r}},
      {PixelFormat::kBayerGbrg8, {g, b, r, g}},
      {PixelFormat::kBayerGrbg8, {g, r, b, g}}};
  for (const auto& [format, tile] : expected) {
    SensorOptions options = quiet();
    options.format = format;
    const Image image = expose(light, options, kExposure, 1, 2);
    ASSERT_EQ(image.data.type(), CV_8UC1);
    EXPECT_EQ(image.format, format);
    for (int i = 0; i < 4; ++i) {
      EXPECT_NEAR(image.data.at<std::uint8_t>(6 + i / 2, 8 + i % 2),
                  tile[static_cast<std::size_t>(i)], 1)
          << toString(format) << i;
    }
  }
}

TEST(Sensor, ColourAndGreyFormats) {
  SensorOptions options = quiet();
  options.format = PixelFormat::kBgr8;
  const Image color = expose(flat(1.0F, 0.5F, 0.25F), options, kExposure, 1, 1);
  EXPECT_NEAR(color.data.at<cv::Vec3b>(3, 3)[0], 25, 1);
  EXPECT_NEAR(color.data.at<cv::Vec3b>(3, 3)[2], 98, 1);
  options.format = PixelFormat::kMono8;
  const Image grey = expose(flat(0.5F, 0.5F, 0.5F), options, kExposure, 1, 1);
  EXPECT_NEAR(grey.data.at<std::uint8_t>(3, 3), 49, 1);
}

TEST(Sensor, ExposureAndGainAreProportionalUntilSaturation) {
  SensorOptions options = quiet();
  options.format = PixelFormat::kMono8;
  const auto value = [&](double exposure_s, double gain_db) {
    return static_cast<int>(expose(flat(0.5F, 0.5F, 0.5F), options, {exposure_s, gain_db}, 1, 1)
                                .data.at<std::uint8_t>(5, 5));
  };
  EXPECT_NEAR(value(0.010, 0.0), 2 * value(0.005, 0.0), 2);
  EXPECT_NEAR(value(0.005, 6.0206), 2 * value(0.005, 0.0), 2);
  EXPECT_EQ(value(1.0, 0.0), 255);
}

/// Photon transfer: the variance of a flat field is that of the photons and the read-out.
TEST(Sensor, NoiseFollowsPhotonsAndReadOut) {
  SensorOptions options = quiet();
  options.noise = true;
  options.format = PixelFormat::kMono8;
  options.full_well_e = 2000.0;  // noise well above the rounding
  options.read_noise_e = 15.0;
  for (const float radiance : {0.05F, 0.15F, 0.3F}) {
    const Image image =
        expose(flat(radiance, radiance, radiance, 512, 512), options, kExposure, 11, 2);
    cv::Scalar mean, sigma;
    cv::meanStdDev(image.data, mean, sigma);
    const double gain = 255.0 / options.full_well_e;
    const double electrons = static_cast<double>(radiance) * 5000.0;
    EXPECT_NEAR(mean[0], electrons * gain, 0.2);
    const double rounding = 1.0 / 12.0;
    const double expected = gain * gain * (electrons + 225.0) + rounding;
    EXPECT_NEAR(sigma[0] * sigma[0], expected, 0.05 * expected) << radiance;
  }
}

TEST(Sensor, NoiseDependsOnTheSeedOnly) {
  SensorOptions options = quiet();
  options.noise = true;
  const cv::Mat light = flat(0.3F, 0.3F, 0.3F);
  const cv::Mat a = expose(light, options, kExposure, 5, 1).data;
  EXPECT_EQ(cv::norm(a, expose(light, options, kExposure, 5, 4).data, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(a, expose(light, options, kExposure, 6, 1).data, cv::NORM_INF), 0.0);
}

TEST(Sensor, VignettingDarkensTheCorners) {
  SensorOptions options = quiet();
  options.format = PixelFormat::kMono8;
  options.vignetting = 0.3;
  const cv::Mat picture = expose(flat(1.0F, 1.0F, 1.0F), options, kExposure, 1, 1).data;
  const double centre = picture.at<std::uint8_t>(64, 64), corner = picture.at<std::uint8_t>(0, 0);
  EXPECT_NEAR(corner / centre, 0.7, 0.02);
}

TEST(Sensor, MeterFillsThePictureWithoutBurningItOut) {
  SensorOptions options = quiet();
  options.format = PixelFormat::kMono8;
  cv::Mat light(200, 200, CV_32FC3);
  for (int i = 0; i < 200; ++i) {
    light.row(i).setTo(cv::Scalar::all(0.01 * i / 2.0));
  }
  const Exposure metered = meter(light, options);
  const cv::Mat picture = expose(light, options, metered, 1, 1).data;
  EXPECT_NEAR(picture.at<std::uint8_t>(190, 100), 0.85 * 255.0, 6.0);
  EXPECT_LT(cv::countNonZero(picture == 255), picture.rows * picture.cols / 20);
}

TEST(Sensor, RefusesAnotherKindOfPicture) {
  EXPECT_THROW(expose(cv::Mat(4, 4, CV_8UC3), SensorOptions(), kExposure, 1, 1),
               ConfigurationError);
}

}  // namespace
}  // namespace scanner::simulation
