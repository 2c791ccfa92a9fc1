// The calibration target: exact planes, the numbers of appendix B, the file that is shipped, and a
// texture that stereo can match.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "scanner/simulation/scene.h"
#include "simulation/symbols.h"
#include "simulation/target_model.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3d;

TargetModel readObj(const std::string& path) {
  TargetModel model;
  std::ifstream file(path);
  EXPECT_TRUE(file) << path;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    if (key == "v") {
      Vector3d v;
      words >> v.x() >> v.y() >> v.z();
      model.vertices.push_back(v);
    } else if (key == "f") {
      model.faces.emplace_back();
      for (int i = 0; words >> i;) model.faces.back().push_back(i - 1);
    }
  }
  return model;
}

Vector3d corner(const TargetModel& model, std::size_t face, std::size_t i) {
  return model.vertices.at(static_cast<std::size_t>(model.faces.at(face).at(i)));
}

Vector3d normalOf(const TargetModel& model, std::size_t face) {
  const Vector3d a = corner(model, face, 0);
  return (corner(model, face, 1) - a).cross(corner(model, face, 2) - a).normalized();
}

/// Point k of a raster with `columns` points per row, in steps of one.
Eigen::Vector2f rasterPoint(int k, int columns) {
  const int column = k % columns, row = k / columns;
  return {static_cast<float>(column), static_cast<float>(row)};
}

Scene plainTarget(int seed) {
  SceneOptions options;
  options.background = false;
  return makeTarget(options, seed);
}

TEST(Target, FileEqualsCode) {
  const TargetModel file =
      readObj(std::string(SCANNER_SOURCE_DIR) + "/config/target/appendix_b.obj");
  const TargetModel& code = targetModel();
  ASSERT_EQ(file.vertices.size(), 15U);
  ASSERT_EQ(code.vertices.size(), file.vertices.size());
  for (std::size_t i = 0; i < code.vertices.size(); ++i) {
    EXPECT_LT((code.vertices[i] - file.vertices[i]).norm(), 1e-9) << "vertex " << i + 1;
  }
  EXPECT_EQ(code.faces, file.faces);
}

TEST(Target, StaysWithTheAppendix) {
  // As printed, in the order of the listing.
  const std::vector<Vector3d> printed = {
      {-0.15, 0, 0.1325},   {0.15, 0, 0.1325},   {0.15, 0, -0.1325},  {-0.15, 0, -0.1325},
      {-0.15, 0, 0},        {0.15, 0, 0},        {0.15, 0.265, 0},    {-0.15, 0.265, 0},
      {0, 0, 0.1325},       {0, 0, -0.1325},     {0, 0.1447, 0.0875}, {-0.0988, 0.1447, 0},
      {0, 0.1447, -0.0875}, {0.0988, 0.1447, 0}, {0, 0.265, 0}};
  const TargetModel& model = targetModel();
  ASSERT_EQ(model.vertices.size(), printed.size());
  for (std::size_t i = 0; i < printed.size(); ++i) {
    const double off = (model.vertices[i] - printed[i]).norm();
    EXPECT_LT(off, i >= 10 && i <= 13 ? 0.00014 : 1e-12) << "vertex " << i + 1;
  }
}

TEST(Target, FacesArePlanarAndFaceOutwards) {
  const TargetModel& model = targetModel();
  ASSERT_EQ(model.faces.size(), 10U);
  const Vector3d inside(0.0, 0.1, 0.0);
  for (std::size_t f = 0; f < model.faces.size(); ++f) {
    const Vector3d n = normalOf(model, f);
    for (std::size_t i = 0; i < model.faces[f].size(); ++i) {
      EXPECT_NEAR(n.dot(corner(model, f, i) - corner(model, f, 0)), 0.0, 1e-6) << f << " " << i;
    }
    if (f > 1) {
      EXPECT_GT(n.dot(corner(model, f, 0) - inside), 0.01) << "face " << f + 1;
    }
  }
  EXPECT_LT((normalOf(model, kTargetPlate) - Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_LT((normalOf(model, kTargetBoard) - Vector3d::UnitZ()).norm(), 1e-12);
}

TEST(Target, SolidClosesOnThePlateAndIsCutByTheBoard) {
  const TargetModel& model = targetModel();
  // Edges of the eight facets: all shared by two, in opposite directions, but the diamond on the
  // plate.
  std::vector<std::pair<int, int>> edges;
  for (std::size_t f = 2; f < model.faces.size(); ++f) {
    const std::vector<int>& face = model.faces[f];
    for (std::size_t i = 0; i < face.size(); ++i) {
      edges.emplace_back(face[i], face[(i + 1) % face.size()]);
    }
  }
  int open = 0;
  for (const auto& [from, to] : edges) {
    EXPECT_EQ(std::count(edges.begin(), edges.end(), std::make_pair(from, to)), 1);
    if (std::count(edges.begin(), edges.end(), std::make_pair(to, from)) == 1) continue;
    ++open;
    EXPECT_EQ(model.vertices[static_cast<std::size_t>(from)].y(), 0.0);
    EXPECT_EQ(model.vertices[static_cast<std::size_t>(to)].y(), 0.0);
  }
  EXPECT_EQ(open, 4);
  // The outline 5-12-15-14-6 is in the board's plane, and the apex on its upper edge.
  for (const std::size_t i : {4U, 11U, 14U, 13U, 5U}) EXPECT_EQ(model.vertices[i].z(), 0.0);
  EXPECT_EQ(model.vertices[14].y(), model.vertices[6].y());
}

TEST(Target, SidesOfTheSolidLeanAlike) {
  // Hand-eye calibration needs planes of well spread directions: the four lower sides lean by the
  // same angle, the upper ones by another.
  const TargetModel& model = targetModel();
  for (std::size_t f = 3; f < 6; ++f) {
    EXPECT_NEAR(normalOf(model, f).y(), normalOf(model, 2).y(), 1e-9);
  }
  for (std::size_t f = 7; f < 10; ++f) {
    EXPECT_NEAR(normalOf(model, f).y(), normalOf(model, 6).y(), 1e-9);
  }
  // Distance of a diamond's side from its middle, over the height that it takes to come in.
  const double side = 0.15 * 0.1325 / std::hypot(0.15, 0.1325);
  const double lower = std::atan((1.0 - 0.6594) * side / 0.1447);
  const double upper = std::atan(0.6594 * side / (0.265 - 0.1447));
  EXPECT_NEAR(std::asin(normalOf(model, 2).y()), lower, 1e-9);
  EXPECT_NEAR(std::asin(normalOf(model, 6).y()), upper, 1e-9);
  EXPECT_GT(normalOf(model, 2).cross(normalOf(model, 3)).norm(), 0.5);
}

TEST(Target, SceneHasTheModelsPlanes) {
  const Scene scene = plainTarget(1);
  ASSERT_EQ(scene.object.size(), 1U);
  const Part& part = scene.object[0];
  EXPECT_EQ(part.uvs.size(), part.vertices.size());
  const float base = scene.bounds.min().z();
  EXPECT_GT(base, 0.0F);
  EXPECT_LT((scene.bounds.sizes() - Eigen::Vector3f(0.3F, 0.265F, 0.265F)).norm(), 1e-5F);
  EXPECT_LT(scene.bounds.center().head<2>().norm(), 1e-6F);
  std::vector<int> uses(targetModel().faces.size(), 0);
  for (const auto& face : part.faces) {
    int matches = 0;
    for (std::size_t f = 0; f < targetModel().faces.size(); ++f) {
      const Vector3d n = normalOf(targetModel(), f);
      const Vector3d origin = corner(targetModel(), f, 0);
      bool on = true;
      for (const std::uint32_t i : face) {
        const Vector3d v = part.vertices[i].cast<double>();
        const Vector3d in_model(v.x(), v.z() - static_cast<double>(base), -v.y());
        const Vector3d m = part.normals[i].cast<double>();
        const Vector3d normal(m.x(), m.z(), -m.y());
        // The board's two sides are a hair apart, so that they can be told from each other.
        const double tolerance = f == kTargetBoard ? 2.2e-5 : 1e-6;
        const double along = normal.dot(n);
        on = on && std::abs(n.dot(in_model - origin)) < tolerance &&
             (f == kTargetBoard ? std::abs(along) : along) > 1.0 - 1e-6;
      }
      if (on) ++uses[f], ++matches;
    }
    EXPECT_EQ(matches, 1);
  }
  // Two triangles for a quadrangle, one for a triangle, and the board has a back.
  EXPECT_EQ(uses, (std::vector<int>{2, 4, 2, 2, 2, 2, 1, 1, 1, 1}));
}

TEST(Target, TextureHasContrastEverywhere) {
  const Scene scene = plainTarget(4);
  const Part& part = scene.object[0];
  // Windows of 11 pixels at 0.7 mm, at many places of every face.
  int poor = 0, windows = 0;
  for (const auto& face : part.faces) {
    for (int k = 0; k < 60; ++k) {
      const float b = std::fmod(0.618F * static_cast<float>(k), 1.0F) * 0.9F;
      const float c = std::fmod(0.414F * static_cast<float>(k), 1.0F) * (0.95F - b);
      SurfacePoint point;
      point.normal = part.normals[face[0]];
      point.footprint_m = 0.0007F;
      const Eigen::Vector2f middle =
          (1.0F - b - c) * part.uvs[face[0]] + b * part.uvs[face[1]] + c * part.uvs[face[2]];
      float low = 1.0F, high = 0.0F;
      for (int i = 0; i < 121; ++i) {
        point.uv = middle + 0.0007F * (rasterPoint(i, 11) - Eigen::Vector2f::Constant(5.0F));
        const float value = part.shader(point).albedo.mean();
        low = std::min(low, value);
        high = std::max(high, value);
      }
      ++windows;
      if (high - low < 0.25F) ++poor;
    }
  }
  EXPECT_LT(poor, windows / 50) << "of " << windows;
}

TEST(Target, SymbolsDoNotRepeatWithinTheDisparityRange) {
  // Patches of 8 mm against the same row further along: the best match elsewhere must be much
  // worse.
  const auto ink = [](const Eigen::Vector2f& at) {
    float tone = 0.0F;
    return symbolInk(at, 0.0005F, 9, &tone);
  };
  int mistaken = 0;
  constexpr int kPatches = 40;
  for (int k = 0; k < kPatches; ++k) {
    const Eigen::Vector2f start = static_cast<float>(k) * Eigen::Vector2f(0.013F, 0.0091F);
    bool found = false;
    for (int shift = 8; shift < 160 && !found; ++shift) {
      float difference = 0.0F;
      for (int i = 0; i < 256; ++i) {
        const Eigen::Vector2f at = start + 0.0005F * rasterPoint(i, 16);
        const Eigen::Vector2f aside(0.0005F * static_cast<float>(shift), 0.0F);
        difference += std::abs(ink(at) - ink(at + aside));
      }
      found = difference < 0.08F * 256.0F;
    }
    if (found) ++mistaken;
  }
  EXPECT_LE(mistaken, kPatches / 10);
}

TEST(Target, SymbolsFadeIntoTheirMean) {
  const auto mean = [](float footprint_m) {
    double sum = 0.0;
    for (int i = 0; i < 40000; ++i) {
      float tone = 0.0F;
      const Eigen::Vector2f at = 0.0021F * rasterPoint(i, 200);
      sum += static_cast<double>(symbolInk(at, footprint_m, 3, &tone));
    }
    return sum / 40000.0;
  };
  const double sharp = mean(0.0001F);
  EXPECT_NEAR(mean(0.001F), sharp, 0.03);
  EXPECT_NEAR(mean(0.05F), sharp, 0.03);
}

TEST(Target, SameSeedSameSymbols) {
  const Scene a = plainTarget(5), b = plainTarget(5), c = plainTarget(6);
  EXPECT_EQ(a.object[0].vertices, b.object[0].vertices);
  EXPECT_EQ(a.object[0].vertices, c.object[0].vertices);  // the geometry is the appendix's
  int different = 0;
  SurfacePoint point;
  point.footprint_m = 0.0005F;
  for (int i = 0; i < 500; ++i) {
    point.uv = {0.0013F * static_cast<float>(i), 0.0007F * static_cast<float>(i)};
    const Eigen::Vector3f color = a.object[0].shader(point).albedo;
    EXPECT_EQ(color, b.object[0].shader(point).albedo);
    if ((color - c.object[0].shader(point).albedo).norm() > 0.2F) ++different;
  }
  EXPECT_GT(different, 100);
}

}  // namespace
}  // namespace scanner::simulation
