#include "scanner/bumblebee/exposure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <vector>

namespace scanner::bumblebee {
namespace {

double brightness(const ExposureSetting& s) {
  return s.exposure_s * std::pow(10.0, s.gain_db / 20.0);
}

/// A linear sensor of 8 bits that clips, before a scene whose radiances spread over four stops
/// (and a sky, perhaps). Settings take effect `delay` frames after they are asked for.
class SimulatedCamera {
 public:
  SimulatedCamera(const ExposureSetting& setting, int delay) {
    for (int i = 0; i < delay; ++i) pipeline_.push_back(setting);
    asked_ = setting;
  }

  std::array<EyeStatistics, 2> take() {
    const double light = brightness(pipeline_.front()) * illumination;
    pipeline_.pop_front();
    pipeline_.push_back(asked_);
    return {eye(light), eye(light * 1.05)};  // eyes are never quite alike
  }
  void ask(const ExposureSetting& s) {
    EXPECT_DOUBLE_EQ(s.gain_db, std::round(s.gain_db)) << "whole dB";
    asked_ = {std::round(s.exposure_s * 1e6) * 1e-6, s.gain_db};  // microseconds, as cameras do
    pipeline_.back() = asked_;
  }
  const ExposureSetting& inForce() const { return asked_; }

  double illumination = 80.0;  ///< level 0.35 of full scale at some 4 ms
  double sky_share = 0.0;      ///< of the picture, eight times as bright as the rest

 private:
  EyeStatistics eye(double light) const {
    EyeStatistics s;
    constexpr int kPixels = 10000;
    double sum = 0.0;
    for (int i = 0; i < kPixels; ++i) {
      const bool sky = i < sky_share * kPixels;
      const double reflectance = sky ? 8.0 : std::pow(2.0, -2.0 + 4.0 * ((i * 7919) % 997) / 997.0);
      const int value = std::clamp(static_cast<int>(255.0 * light * reflectance), 0, 255);
      ++s.histogram[static_cast<std::size_t>(value)];
      sum += value;
    }
    s.mean_level = sum / 255.0 / kPixels;
    s.saturated_share = static_cast<double>(s.histogram[255]) / kPixels;
    return s;
  }

  std::deque<ExposureSetting> pipeline_;
  ExposureSetting asked_;
};

AutoExposureOptions options() {
  AutoExposureOptions o;
  o.gain_db = {0.0, 24.0};
  return o;
}

struct Course {
  std::vector<double> levels;  ///< mean of both eyes
  std::vector<ExposureSetting> asked;
};

Course run(AutoExposure& controller, SimulatedCamera& camera, int frames) {
  Course result;
  for (int i = 0; i < frames; ++i) {
    const auto eyes = camera.take();
    result.levels.push_back(0.5 * (eyes[0].mean_level + eyes[1].mean_level));
    if (const auto next = controller.update(eyes, camera.inForce())) {
      camera.ask(*next);
      result.asked.push_back(*next);
    }
  }
  return result;
}

/// Changes of direction: an oscillating loop has many.
int turns(const std::vector<ExposureSetting>& asked) {
  int count = 0;
  for (std::size_t i = 2; i < asked.size(); ++i) {
    const double before = brightness(asked[i - 1]) - brightness(asked[i - 2]);
    const double after = brightness(asked[i]) - brightness(asked[i - 1]);
    if (before * after < 0.0) ++count;
  }
  return count;
}

class AutoExposureDelay : public testing::TestWithParam<int> {};

TEST_P(AutoExposureDelay, ReachesTheTargetAfterStepsOfLightAndRests) {
  for (const double step : {16.0, 1.0 / 16.0}) {
    SimulatedCamera camera({0.004, 0.0}, GetParam());
    camera.illumination = step > 1.0 ? 40.0 : 160.0;
    AutoExposure controller(options());
    run(controller, camera, 40);
    camera.illumination *= step;
    const Course after = run(controller, camera, 60);
    EXPECT_NEAR(after.levels.back(), 0.35, 0.05) << "step " << step;
    EXPECT_LE(turns(after.asked), 1) << "step " << step;
    EXPECT_LE(after.asked.size(), 7U) << "step " << step;
    const Course rest = run(controller, camera, 100);
    EXPECT_TRUE(rest.asked.empty()) << "hunts at rest, step " << step;
    EXPECT_EQ(rest.levels.front(), rest.levels.back());
  }
}

TEST_P(AutoExposureDelay, IsQuick) {
  SimulatedCamera camera({0.008, 0.0}, GetParam());
  camera.illumination = 16.0 * 60.0;  // burnt out
  AutoExposure controller(options());
  const Course result = run(controller, camera, 16);
  EXPECT_GT(result.levels.front(), 0.95);
  EXPECT_NEAR(result.levels.back(), 0.35, 0.08) << "after 16 frames";
}

INSTANTIATE_TEST_SUITE_P(Frames, AutoExposureDelay, testing::Values(1, 2, 3));

TEST(AutoExposure, ExposesLongerBeforeItAmplifies) {
  AutoExposure controller(options());
  SimulatedCamera camera({0.001, 0.0}, 1);
  camera.illumination = 60.0;  // within what the exposure can do
  run(controller, camera, 40);
  EXPECT_EQ(camera.inForce().gain_db, 0.0);
  EXPECT_LT(camera.inForce().exposure_s, 0.008);
  camera.illumination = 10.0;
  const Course dark = run(controller, camera, 40);
  EXPECT_GT(camera.inForce().gain_db, 3.0);
  EXPECT_NEAR(camera.inForce().exposure_s, 0.008, 0.001);
  EXPECT_LE(camera.inForce().exposure_s, 0.008 + 1e-6);
  EXPECT_NEAR(dark.levels.back(), 0.35, 0.05);
  camera.illumination = 60.0;
  run(controller, camera, 40);
  EXPECT_EQ(camera.inForce().gain_db, 0.0) << "gain goes first when there is light again";
}

TEST(AutoExposure, StopsAtTheEndsOfTheRanges) {
  AutoExposure controller(options());
  SimulatedCamera camera({0.004, 0.0}, 2);
  camera.illumination = 0.01;
  EXPECT_LT(run(controller, camera, 100).asked.size(), 8U);
  EXPECT_EQ(camera.inForce().gain_db, 24.0);
  EXPECT_NEAR(camera.inForce().exposure_s, 0.008, 1e-9);
  EXPECT_TRUE(run(controller, camera, 50).asked.empty());
  camera.illumination = 1e6;
  EXPECT_LT(run(controller, camera, 100).asked.size(), 10U);
  EXPECT_EQ(camera.inForce().gain_db, 0.0);
  EXPECT_NEAR(camera.inForce().exposure_s, 10e-6, 1e-9);
}

TEST(AutoExposure, GivesHighlightsUpToHalfTheTarget) {
  AutoExposure controller(options());
  SimulatedCamera camera({0.004, 0.0}, 2);
  run(controller, camera, 40);
  const double plain = brightness(camera.inForce());
  camera.sky_share = 0.04;  // a little: can be kept from burning, within limits
  const Course result = run(controller, camera, 60);
  EXPECT_LT(brightness(camera.inForce()), 0.8 * plain);
  EXPECT_GE(result.levels.back(), 0.5 * 0.35 - 0.03);
  camera.sky_share = 0.4;  // much: the object must not drown in darkness
  const Course much = run(controller, camera, 100);
  EXPECT_GE(much.levels.back(), 0.5 * 0.35 - 0.03);
  EXPECT_TRUE(run(controller, camera, 50).asked.empty()) << "rests";
}

TEST(AutoExposure, LeavesSmallDeviationsAlone) {
  AutoExposure controller(options());
  SimulatedCamera camera({0.004, 0.0}, 1);
  run(controller, camera, 40);
  camera.illumination *= 1.03;
  EXPECT_TRUE(run(controller, camera, 30).asked.empty());
  camera.illumination *= 1.3;
  EXPECT_FALSE(run(controller, camera, 30).asked.empty());
}

TEST(AutoExposure, ABlackPictureIsNoTrouble) {
  AutoExposure controller(options());
  const auto next = controller.update({}, {0.001, 0.0});
  ASSERT_TRUE(next);
  EXPECT_TRUE(std::isfinite(next->exposure_s) && std::isfinite(next->gain_db));
  EXPECT_GT(brightness(*next), 0.001);
  EXPECT_FALSE(AutoExposure(options()).update({}, {0.0, 0.0})) << "nothing known of the camera";
}

TEST(AutoExposure, ASettingIsBroughtWithinTheRanges) {
  const AutoExposure controller(options());
  const ExposureSetting s = controller.within({0.016, 0.0});
  EXPECT_EQ(s.gain_db, 6.0);
  EXPECT_NEAR(brightness(s), 0.016, 0.0002);
  EXPECT_LE(s.exposure_s, 0.008);
  const ExposureSetting same = controller.within({0.003, 0.0});
  EXPECT_EQ(same.gain_db, 0.0);
  EXPECT_DOUBLE_EQ(same.exposure_s, 0.003);
}

TEST(AutoExposure, RefusesOptionsThatCannotBe) {
  AutoExposureOptions o = options();
  o.target = 1.0;
  EXPECT_THROW(AutoExposure{o}, ConfigurationError);
  o = options();
  o.exposure_s = {0.01, 0.001};
  EXPECT_THROW(AutoExposure{o}, ConfigurationError);
  o = options();
  o.gain_db.max = std::nan("");
  EXPECT_THROW(AutoExposure{o}, ConfigurationError);
  o = options();
  o.settle_frames = 0;
  EXPECT_THROW(AutoExposure{o}, ConfigurationError);
}

}  // namespace
}  // namespace scanner::bumblebee
