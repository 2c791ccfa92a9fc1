#include "scanner/evaluation/deviation.h"

#include <gtest/gtest.h>

#include "evaluation/shapes.h"

namespace scanner::evaluation {
namespace {

const Eigen::Isometry3d kIdentity = Eigen::Isometry3d::Identity();

Deviation measured(const Mesh& model, const Mesh& reference, const DeviationOptions& options = {},
                   int threads = 2) {
  return *deviation(model, SurfaceDistance(reference), reference, kIdentity, options, threads);
}

TEST(Deviation, OfAScaledSphereIsTheDifferenceOfTheRadii) {
  // Corners of both lie on the same rays, and the nearest point of a corner is the corner below.
  const Deviation d = measured(shapes::sphere(0.302), shapes::sphere(0.3));
  EXPECT_NEAR(d.max_m, 0.002, 1e-7);
  EXPECT_NEAR(d.min_m, 0.002, 1e-7);
  EXPECT_NEAR(d.mean_m, 0.002, 1e-8);
  EXPECT_NEAR(d.mean_positive_m, 0.002, 1e-8);
  EXPECT_TRUE(std::isnan(d.mean_negative_m));
  EXPECT_NEAR(d.sigma_m, 0.0, 1e-7);
  EXPECT_NEAR(d.rmse_m, 0.002, 1e-8);
  EXPECT_NEAR(d.median_absolute_m, 0.002, 1e-7);
  EXPECT_EQ(d.points, 4098u);
  EXPECT_EQ(d.coverage, 1.0);
  // From inside the nearest point is on a face, not further than the faces' sagitta of 0.08 mm.
  const Deviation inside = measured(shapes::sphere(0.298), shapes::sphere(0.3));
  EXPECT_NEAR(inside.mean_m, -0.002, 1e-4);
  EXPECT_TRUE(std::isnan(inside.mean_positive_m));
}

TEST(Deviation, StatisticsOfKnownValues) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto s =
      deviationStatistics({0.001F, -0.002F, 0.003F, 0.0F, 0.5F, -0.5F, nan, 0.005F}, 0.025);
  EXPECT_EQ(s.points, 5u);
  EXPECT_EQ(s.outliers, 2u);
  EXPECT_EQ(s.skipped, 1u);
  EXPECT_NEAR(s.max_m, 0.005, 1e-9);
  EXPECT_NEAR(s.min_m, -0.002, 1e-9);
  EXPECT_NEAR(s.mean_positive_m, 0.003, 1e-9);  // zero is neither
  EXPECT_NEAR(s.mean_negative_m, -0.002, 1e-9);
  EXPECT_NEAR(s.mean_m, 0.0014, 1e-9);
  EXPECT_NEAR(s.rmse_m, std::sqrt(39e-6 / 5.0), 1e-9);
  EXPECT_NEAR(s.sigma_m, std::sqrt((39e-6 - 5.0 * 0.0014 * 0.0014) / 4.0), 1e-9);
  EXPECT_NEAR(s.median_absolute_m, 0.002, 1e-9);
  EXPECT_NEAR(s.p95_absolute_m, 0.0046, 1e-9);
}

TEST(Deviation, IsTakenAfterTheMotion) {
  const Mesh reference = shapes::cube();
  Mesh model;
  model.vertices.points = {{0.0F, 0.0F, 0.0F}};
  Eigen::Isometry3d T = kIdentity;
  T.translation() << 0.0, 0.0, 1.003;
  const auto d = deviation(model, SurfaceDistance(reference), reference, T, {}, 1);
  ASSERT_TRUE(d);
  EXPECT_NEAR(d->mean_m, 0.003, 1e-9);
  EXPECT_TRUE(d->alignment.isApprox(T, 0.0));
}

TEST(Deviation, CoverageOfHalfASphere) {
  const Mesh whole = shapes::sphere(0.5);
  Mesh half = whole;
  half.faces.clear();
  for (const auto& face : whole.faces) {
    float z = 0.0F;
    for (const auto i : face) z += whole.vertices.points[i].z();
    if (z > 0.0F) half.faces.push_back(face);
  }
  DeviationOptions options;
  options.coverage_m = 1e-5;
  EXPECT_NEAR(measured(half, whole, options).coverage, 0.5, 1e-3);
  // A cap's area goes with its height: the rim reaches sin(distance / radius) further.
  options.coverage_m = 0.02;
  EXPECT_NEAR(measured(half, whole, options).coverage, 0.5 * (1.0 + 0.02 / 0.5), 2e-3);
}

TEST(Deviation, CoverageByPointsWithoutFaces) {
  const Mesh reference = shapes::sphere(0.3);
  Mesh cloud = reference;
  cloud.faces.clear();
  EXPECT_EQ(measured(cloud, reference, DeviationOptions{0.025, 0.02}).coverage, 1.0);
  cloud.vertices.points.resize(1);
  DeviationOptions options;
  options.coverage_m = 0.03;  // the cap about one point: (1 - cos) / 2 with chord 0.03
  EXPECT_NEAR(measured(cloud, reference, options).coverage, 0.03 * 0.03 / (4 * 0.3 * 0.3), 2e-4);
}

TEST(Deviation, OutliersAreCountedAndNotAveraged) {
  Mesh model = shapes::sphere(0.301);
  for (std::size_t i = 0; i < 100; ++i) model.vertices.points[40 * i] *= 2.0F;
  const Deviation d = measured(model, shapes::sphere(0.3));
  EXPECT_EQ(d.outliers, 100u);
  EXPECT_EQ(d.points, 3998u);
  EXPECT_NEAR(d.max_m, 0.001, 1e-7);
  EXPECT_NEAR(static_cast<double>(d.signed_m[40]), 0.302, 1e-6);  // but kept in the list
}

TEST(Deviation, VerticesThatAreNotFiniteAreSkippedAndCounted) {
  Mesh model = shapes::sphere(0.301);
  const std::size_t faces = model.faces.size();
  model.vertices.points[7].x() = std::numeric_limits<float>::quiet_NaN();
  model.vertices.points[8].z() = std::numeric_limits<float>::infinity();
  const Deviation d = measured(model, shapes::sphere(0.3));
  EXPECT_EQ(d.skipped, 2u);
  EXPECT_EQ(d.points, 4096u);
  EXPECT_TRUE(std::isnan(d.signed_m[7]));
  EXPECT_TRUE(std::isfinite(d.signed_m[9]));
  EXPECT_GT(d.coverage, 0.99);
  EXPECT_EQ(model.faces.size(), faces);
}

TEST(Deviation, TroubleOfTheModelIsAStatus) {
  const Mesh reference = shapes::sphere(0.3);
  const SurfaceDistance surface(reference);
  EXPECT_EQ(deviation(Mesh{}, surface, reference, kIdentity, {}, 1).status().code(),
            StatusCode::kNotEnoughData);
  Mesh model = shapes::sphere(3.0);
  EXPECT_EQ(deviation(model, surface, reference, kIdentity, {}, 1).status().code(),
            StatusCode::kNotEnoughData);
  model.faces[0][1] = 1000000;
  EXPECT_EQ(deviation(model, surface, reference, kIdentity, {}, 1).status().code(),
            StatusCode::kInvalidInput);
  model.faces.clear();
  model.vertices.points.assign(3, Eigen::Vector3f::Constant(std::nanf("")));
  EXPECT_EQ(deviation(model, surface, reference, kIdentity, {}, 1).status().code(),
            StatusCode::kNotEnoughData);
}

TEST(Deviation, DoesNotDependOnThreads) {
  const Mesh reference = shapes::starShaped(4, shapes::bumpyRadius);
  const Mesh model =
      shapes::starShaped(5, [](const auto& d) { return 1.003 * shapes::bumpyRadius(d); });
  const Deviation one = measured(model, reference, {}, 1), two = measured(model, reference, {}, 2);
  EXPECT_EQ(one.signed_m, two.signed_m);
  EXPECT_EQ(one.coverage, two.coverage);
  EXPECT_EQ(one.sigma_m, two.sigma_m);
}

TEST(DeviationColor, RunsFromBlueThroughGreenToRed) {
  EXPECT_EQ(deviationColor(-0.002, 0.002), (Rgb8{0, 0, 255}));
  EXPECT_EQ(deviationColor(-0.001, 0.002), (Rgb8{0, 255, 255}));
  EXPECT_EQ(deviationColor(0.0, 0.002), (Rgb8{0, 255, 0}));
  EXPECT_EQ(deviationColor(0.001, 0.002), (Rgb8{255, 255, 0}));
  EXPECT_EQ(deviationColor(0.002, 0.002), (Rgb8{255, 0, 0}));
  EXPECT_EQ(deviationColor(9.0, 0.002), (Rgb8{255, 0, 0}));
}

TEST(ColorCoded, PaintsTheModel) {
  const Mesh reference = shapes::sphere(0.3);
  Mesh model = shapes::sphere(0.301);
  model.vertices.points[0] *= 1.5F;
  const Deviation d = measured(model, reference);
  const Mesh painted = colorCoded(model, d, 0.001, 0.025);
  EXPECT_EQ(painted.vertices.colors[0], kOutlierColor);
  EXPECT_GE(painted.vertices.colors[1].r, 254);
  EXPECT_EQ(painted.faces, model.faces);
  EXPECT_EQ(painted.vertices.points, model.vertices.points);
  EXPECT_THROW(colorCoded(Mesh{}, d, 0.001, 0.025), ConfigurationError);
}

}  // namespace
}  // namespace scanner::evaluation
