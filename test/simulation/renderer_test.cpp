#include "scanner/simulation/renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "camera_fixtures.h"
#include "scanner/simulation/noise.h"
#include "scanner/simulation/rig.h"
#include "simulation/ray_table.h"

namespace scanner::simulation {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3f;

constexpr int kThreads = 2;
constexpr float kDepth_m = 0.75F;

RenderOptions plain() {
  RenderOptions options;
  options.sky_occlusion = false;
  options.shadows = false;
  options.specular = false;
  options.lens_blur_px = 0.0;
  options.motion_samples = 1;
  return options;
}

Appearance matte(float albedo) {
  Appearance look;
  look.albedo.setConstant(albedo);
  look.normal = -Vector3f::UnitZ();
  return look;
}

Shader noiseShader(float wavelength_m) {
  return [=](const SurfacePoint& point) {
    return matte(0.5F + 0.4F * fractalNoise(point.position, 4.0F * wavelength_m, wavelength_m, 0.8F,
                                            point.footprint_m, 3U));
  };
}

cv::Mat brightness(const cv::Mat& radiance) {
  cv::Mat green;
  cv::extractChannel(radiance, green, 1);
  return green;
}

/// Bright discs on a black sheet.
struct Discs {
  static constexpr float kRadius_m = 0.004F;
  std::vector<cv::Point3d> centres;

  Discs() {
    for (int row = -3; row <= 3; ++row) {
      for (int col = -4; col <= 4; ++col) {
        centres.emplace_back(0.0701 * col, 0.0653 * row, static_cast<double>(kDepth_m));
      }
    }
  }
  Shader shader() const {
    return [centres = centres](const SurfacePoint& point) {
      for (const cv::Point3d& c : centres) {
        if (std::hypot(point.position.x() - static_cast<float>(c.x),
                       point.position.y() - static_cast<float>(c.y)) < kRadius_m) {
          return matte(0.9F);
        }
      }
      return matte(0.0F);
    };
  }
};

/// Distance between where the discs are seen and where OpenCV projects them, RMS over both eyes'
/// discs that lie well inside the picture.
double discError(const cv::Mat& picture, const std::vector<cv::Point2d>& expected, int* seen) {
  const cv::Mat light = brightness(picture);
  constexpr int kHalf = 12;
  double sum = 0.0;
  for (const cv::Point2d& p : expected) {
    const cv::Rect box(cvRound(p.x) - kHalf, cvRound(p.y) - kHalf, 2 * kHalf + 1, 2 * kHalf + 1);
    if ((box & cv::Rect(0, 0, light.cols, light.rows)) != box) continue;
    const cv::Moments m = cv::moments(light(box));
    const cv::Point2d found(box.x + m.m10 / m.m00, box.y + m.m01 / m.m00);
    sum += (found - p).dot(found - p);
    ++*seen;
  }
  return sum;
}

TEST(Renderer, KnownPointsReprojectInBothEyes) {
  const SimulatedRig rig = makeRig(RigOptions(), 5);  // distortion and misalignment are on
  const Discs discs;
  RenderOptions options = plain();
  options.samples = 16;
  const Renderer renderer(
      test::makeSheetScene(test::makeSheet(1.0F, kDepth_m, 0.0F, discs.shader())), options,
      kThreads);
  int seen = 0;
  double sum = discError(renderer.radiance(rig.calibration.left, {Isometry3d::Identity()}, 1),
                         test::project(rig.calibration.left, discs.centres), &seen);
  std::vector<cv::Point3d> in_right;
  for (const cv::Point3d& c : discs.centres) {
    const Eigen::Vector3d p = rig.T_left_right.inverse() * Eigen::Vector3d(c.x, c.y, c.z);
    in_right.emplace_back(p.x(), p.y(), p.z());
  }
  sum += discError(renderer.radiance(rig.calibration.right, {rig.T_left_right}, 2),
                   test::project(rig.calibration.right, in_right), &seen);
  ASSERT_GT(seen, 80);
  const double rms = std::sqrt(sum / seen);
  RecordProperty("reprojection_rms_px", std::to_string(rms));
  EXPECT_LT(rms, 0.03);
}

/// The directions of the rays, projected by OpenCV, come back to the pixels they were made for.
TEST(Renderer, RaysUndoTheLensAsOpenCvDefinesIt) {
  CameraModel plumb_bob = makeRig(RigOptions(), 3).calibration.left;
  CameraModel rational = plumb_bob;
  rational.distortion_model = "rational_polynomial";
  rational.D = {0.21, -0.05, 4e-4, -3e-4, 0.01, 0.29, -0.02, 0.004};
  CameraModel prism = rational;
  prism.D.insert(prism.D.end(), {2e-3, -1e-3, -1.5e-3, 5e-4});
  for (const CameraModel& camera : {plumb_bob, rational, prism}) {
    const RayTable table(camera, kThreads);
    std::vector<cv::Point3d> rays;
    std::vector<cv::Point2d> places;
    for (int row = 0; row < camera.height; row += 51) {
      for (int col = 0; col < camera.width; col += 31) {
        const Vector3f ray = table.direction(col, row, 0.375F, -0.125F);
        rays.emplace_back(ray.x(), ray.y(), ray.z());
        places.emplace_back(col + 0.375, row - 0.125);
      }
    }
    const std::vector<cv::Point2d> seen = test::project(camera, rays);
    for (std::size_t i = 0; i < seen.size(); ++i) {
      EXPECT_LT(cv::norm(seen[i] - places[i]), 3e-4) << places[i];  // single precision
    }
  }
}

TEST(Renderer, LensesThatCannotBeUndoneAreRefused) {
  CameraModel camera = makeRig(RigOptions(), 3).calibration.left;
  camera.D = {-2.0, 0.0, 0.0, 0.0};  // folds inside the picture
  EXPECT_THROW(RayTable(camera, 1), ConfigurationError);
  camera.D = {0.0, 0.0, 0.0};
  EXPECT_THROW(RayTable(camera, 1), ConfigurationError);
  camera.distortion_model = "equidistant";
  camera.D = {0.0, 0.0, 0.0, 0.0};
  EXPECT_THROW(RayTable(camera, 1), ConfigurationError);
}

/// Rectified left and right, compared along the exact disparity shifted by some offsets: the best
/// offset must be none.
TEST(Renderer, PicturesAgreeWithTheExactDepth) {
  const SimulatedRig rig = makeRig(RigOptions(), 6);
  const StereoCalibration& c = rig.calibration;
  const Renderer renderer(
      test::makeSheetScene(test::makeSheet(1.0F, kDepth_m, 0.4F, noiseShader(0.002F))), plain(),
      kThreads);
  const auto rectified = [](const CameraModel& camera, const cv::Mat& raw) {
    cv::Mat x, y, out;
    cv::initUndistortRectifyMap(test::toCv(camera.K), camera.D, test::toCv(camera.R),
                                test::toCv(camera.P.leftCols<3>()), raw.size(), CV_32FC1, x, y);
    cv::remap(raw, out, x, y, cv::INTER_CUBIC);
    return out;
  };
  const cv::Mat left =
      rectified(c.left, brightness(renderer.radiance(c.left, {Isometry3d::Identity()}, 1)));
  const cv::Mat right =
      rectified(c.right, brightness(renderer.radiance(c.right, {rig.T_left_right}, 2)));
  const cv::Mat depth = renderer.rectifiedDepth(c.left, Isometry3d::Identity(), true);
  const auto difference = [&](float offset) {
    cv::Mat x(left.size(), CV_32FC1), y(left.size(), CV_32FC1), moved;
    for (int row = 0; row < x.rows; ++row) {
      for (int col = 0; col < x.cols; ++col) {
        const double disparity =
            c.focalLength() * c.baseline() / static_cast<double>(depth.at<float>(row, col));
        x.at<float>(row, col) = static_cast<float>(col - disparity) + offset;
        y.at<float>(row, col) = static_cast<float>(row);
      }
    }
    cv::remap(right, moved, x, y, cv::INTER_CUBIC);
    const cv::Rect inside(400, 60, 560, 640);
    return cv::norm(moved(inside), left(inside), cv::NORM_L2SQR);
  };
  const double before = difference(-0.2F), at = difference(0.0F), after = difference(0.2F);
  EXPECT_LT(at, before);
  EXPECT_LT(at, after);
  const double best = 0.2 * 0.5 * (before - after) / (before - 2.0 * at + after);
  RecordProperty("disparity_bias_px", std::to_string(best));
  EXPECT_LT(std::abs(best), 0.02);
}

TEST(Renderer, DepthOfASlantedSheetIsExact) {
  const SimulatedRig rig = makeRig(RigOptions(), 1);
  const CameraModel& camera = rig.calibration.left;
  const float slant = 0.3F;
  const Renderer renderer(
      test::makeSheetScene(test::makeSheet(0.3F, kDepth_m, slant, noiseShader(0.01F))), plain(),
      kThreads);
  const cv::Mat depth = renderer.rectifiedDepth(camera, Isometry3d::Identity(), true);
  EXPECT_TRUE(std::isnan(depth.at<float>(384, 2)));  // beside the sheet
  for (int col = 300; col < 700; col += 50) {
    const double x = (col - camera.P(0, 2)) / camera.P(0, 0);
    const double y = (300 - camera.P(1, 2)) / camera.P(1, 1);
    const Eigen::Vector3d ray(x, y, 1.0);
    const Eigen::Vector3d normal(std::sin(slant), 0.0, std::cos(slant));
    const double exact = normal.z() * static_cast<double>(kDepth_m) / normal.dot(ray);
    EXPECT_NEAR(depth.at<float>(300, col), exact, 2e-6) << col;
  }
}

class Switches : public ::testing::Test {
 protected:
  static CameraModel camera() {
    RigOptions small;
    small.width_px = 256;
    small.height_px = 192;
    return makeRig(small, 1).calibration.left;
  }
  /// A small sheet in front of a large one, both bright.
  static Scene layers() {
    Scene scene = test::makeSheetScene(test::makeSheet(0.1F, kDepth_m, 0.0F, noiseShader(0.004F)));
    scene.surroundings.push_back(test::makeSheet(2.0F, 1.0F, 0.0F, noiseShader(0.02F)));
    scene.light.to_sun = Vector3f(0.5F, 0.0F, -0.8F).normalized();
    return scene;
  }
  static cv::Mat render(const RenderOptions& options,
                        const std::vector<Isometry3d>& poses = {Isometry3d::Identity()}) {
    return Renderer(layers(), options, kThreads).radiance(camera(), poses, 3);
  }
};

TEST_F(Switches, ShadowsDarkenOnlySomePixels) {
  RenderOptions with = plain();
  with.shadows = true;
  const cv::Mat lit = brightness(render(plain())), shadowed = brightness(render(with));
  int darker = 0, brighter = 0;
  for (int i = 0; i < lit.rows * lit.cols; ++i) {
    const float change =
        shadowed.at<float>(i / lit.cols, i % lit.cols) - lit.at<float>(i / lit.cols, i % lit.cols);
    darker += change < -0.05F;
    brighter += change > 0.05F;
  }
  EXPECT_GT(darker, 500);
  EXPECT_LT(darker, lit.rows * lit.cols / 2);
  EXPECT_LT(brighter, 200);  // only where the edges' extra samples fall
}

TEST_F(Switches, MotionBlurAndLensBlurTakeContrastAway) {
  const auto contrast = [](const cv::Mat& radiance) {
    cv::Mat edges;
    cv::Laplacian(brightness(radiance), edges, CV_32F);
    return cv::norm(edges, cv::NORM_L1);
  };
  RenderOptions many = plain();  // else the noise of few samples is the contrast
  many.samples = 16;
  const double sharp = contrast(render(many));
  RenderOptions soft = many;
  soft.lens_blur_px = 4.0;  // one pixel at this resolution
  EXPECT_LT(contrast(render(soft)), 0.8 * sharp);
  std::vector<Isometry3d> moving(8, Isometry3d::Identity());
  for (std::size_t i = 0; i < moving.size(); ++i) {
    moving[i].translation().x() = 0.003 * static_cast<double>(i);
  }
  EXPECT_LT(contrast(render(many, moving)), 0.8 * sharp);
}

/// Few samples stand for the middle of the exposure, whatever the number of poses.
TEST_F(Switches, OneSampleIsTakenInTheMiddleOfTheExposure) {
  RenderOptions one = plain();
  one.samples = 1;
  one.adaptive = false;
  Isometry3d middle = Isometry3d::Identity(), begin = middle, end = middle;
  begin.translation().x() = -0.01;
  end.translation().x() = 0.01;
  const cv::Mat exact = render(one, {middle});
  EXPECT_LT(cv::norm(exact, render(one, {begin, end}), cv::NORM_INF), 1e-5);
  EXPECT_EQ(cv::norm(exact, render(one, {begin, middle, end}), cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(exact, render(one, {begin}), cv::NORM_INF), 0.05);
}

TEST_F(Switches, AdaptiveSamplesChangeEdgesOnly) {
  RenderOptions one = plain();
  one.samples = 1;
  one.adaptive = false;
  RenderOptions adaptive = one;
  adaptive.adaptive = true;
  cv::Mat difference;
  cv::absdiff(brightness(render(one)), brightness(render(adaptive)), difference);
  const int changed = cv::countNonZero(difference > 1e-6F);
  EXPECT_GT(changed, 100);
  EXPECT_LT(changed, difference.rows * difference.cols / 10);
}

/// Level ground, finely cut, so that its light is known per vertex, and a wall on it at x = 0.
Scene groundWithWall() {
  const Shader grey = [](const SurfacePoint& point) {
    Appearance look = matte(0.5F);
    look.normal = point.normal;
    return look;
  };
  constexpr std::uint32_t kCells = 60;
  Part ground;
  ground.name = "ground";
  for (std::uint32_t i = 0; i <= kCells; ++i) {
    for (std::uint32_t j = 0; j <= kCells; ++j) {
      ground.vertices.emplace_back(0.02F * static_cast<float>(j) - 0.6F,
                                   0.02F * static_cast<float>(i) - 0.6F, 0.0F);
      ground.normals.push_back(Vector3f::UnitZ());
      if (i == kCells || j == kCells) continue;
      const std::uint32_t k = i * (kCells + 1) + j;
      ground.faces.push_back({k, k + 1, k + kCells + 1});
      ground.faces.push_back({k + 1, k + kCells + 2, k + kCells + 1});
    }
  }
  ground.shader = grey;
  Part wall;
  wall.name = "wall";
  wall.vertices = {{0, -3, 0}, {0, 3, 0}, {0, 3, 0.6F}, {0, -3, 0.6F}};
  wall.normals.assign(4, Vector3f::UnitX());
  wall.faces = {{0, 1, 2}, {0, 2, 3}};
  wall.shader = grey;
  Scene scene = test::makeSheetScene(ground);
  scene.surroundings.push_back(wall);
  scene.light.sun.setZero();
  return scene;
}

TEST_F(Switches, SkyOcclusionDarkensTheFootOfAWall) {
  Isometry3d from_above = Isometry3d::Identity();
  from_above.linear() = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix();
  from_above.translation().z() = 1.5;
  const auto footAgainstOpen = [&](bool occlusion) {
    RenderOptions options = plain();
    options.sky_occlusion = occlusion;
    const CameraModel model = camera();
    const cv::Mat picture =
        brightness(Renderer(groundWithWall(), options, kThreads).radiance(model, {from_above}, 1));
    const auto at = [&](double x) {
      const int col = static_cast<int>(model.K(0, 2) + x / 1.5 * model.K(0, 0));
      return picture.at<float>(model.height / 2, col);
    };
    return at(0.03) / at(0.5);
  };
  EXPECT_NEAR(footAgainstOpen(false), 1.0F, 0.02F);
  EXPECT_LT(footAgainstOpen(true), 0.75F);  // half of the sky is gone there
}

TEST_F(Switches, SameBytesForEveryThreadCount) {
  RenderOptions options;  // everything on
  const Scene scene = layers();
  const std::vector<Isometry3d> poses(3, Isometry3d::Identity());
  const cv::Mat one = Renderer(scene, options, 1).radiance(camera(), poses, 3);
  const cv::Mat four = Renderer(scene, options, 4).radiance(camera(), poses, 3);
  EXPECT_EQ(cv::norm(one, four, cv::NORM_INF), 0.0);
}

TEST_F(Switches, BrokenNormalsDoNotBreakThePicture) {
  Scene scene = groundWithWall();  // finely cut: its normals enter the light of the sky
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 0; i < scene.object[0].normals.size(); i += 3) {
    scene.object[0].normals[i].setConstant(i % 2 == 0 ? nan : 0.0F);
  }
  scene.object[0].faces.push_back({5, 5, 9});  // without area
  Isometry3d from_above = Isometry3d::Identity();
  from_above.linear() = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix();
  from_above.translation().z() = 1.5;
  const auto picture = [&](const Scene& s) {
    return Renderer(s, RenderOptions(), kThreads).radiance(camera(), {from_above}, 1);
  };
  const cv::Mat broken = picture(scene);
  EXPECT_TRUE(cv::checkRange(broken));
  EXPECT_LT(cv::norm(broken, picture(groundWithWall()), cv::NORM_INF), 0.02);
}

TEST_F(Switches, PartsThatDoNotFitAreRefusedByName) {
  Scene scene = layers();
  scene.object[0].faces.push_back({0, 1, 99});
  try {
    const Renderer renderer(scene, plain(), kThreads);
    FAIL() << "accepted";
  } catch (const ConfigurationError& error) {
    EXPECT_NE(std::string(error.what()).find("sheet"), std::string::npos) << error.what();
  }
  EXPECT_THROW(Renderer(layers(), plain(), kThreads).radiance(camera(), {}, 1), ConfigurationError);
}

}  // namespace
}  // namespace scanner::simulation
