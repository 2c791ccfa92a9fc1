#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "fixtures.h"
#include "scanner/core/options.h"
#include "scanner/core/ply.h"
#include "scanner/surface/ball_pivot.h"
#include "scanner/surface/mesh_io.h"
#include "scanner/surface/options.h"
#include "scanner/surface/render.h"
#include "support/temporary_folder.h"

namespace scanner::surface {
namespace {

class MeshIo : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_ / name; }
  std::string content(const std::string& name) const {
    std::ifstream in(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  scanner::test::TemporaryFolder folder_;
};

TEST_F(MeshIo, PlyRoundTrip) {
  Mesh mesh = test::cube({1, 2, 3});
  mesh.vertices.sigmas.assign(8, 1e-3F);
  ASSERT_TRUE(writeMesh(path("a.PLY"), mesh).isOk());
  const Result<Mesh> read = readPly(path("a.PLY"));
  ASSERT_TRUE(read.isOk()) << read.status().message();
  EXPECT_TRUE(test::sameBytes(*read, mesh));
}

TEST_F(MeshIo, ObjHoldsColorsNormalsAndFacesFromOne) {
  ASSERT_TRUE(writeMesh(path("a.obj"), test::cube()).isOk());
  std::istringstream in(content("a.obj"));
  std::string line;
  int v = 0, vn = 0, f = 0;
  while (std::getline(in, line)) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    if (key == "v") {
      double x, y, z, r, g, b;
      ASSERT_TRUE(words >> x >> y >> z >> r >> g >> b);
      EXPECT_EQ(x, r);  // corner colours of the test cube equal its coordinates
      EXPECT_EQ(z, b);
      ++v;
    }
    vn += key == "vn" ? 1 : 0;
    if (key == "f" && f++ == 0) {
      EXPECT_EQ(line, "f 1//1 3//3 2//2");
    }
  }
  EXPECT_EQ(v, 8);
  EXPECT_EQ(vn, 8);
  EXPECT_EQ(f, 12);
}

TEST_F(MeshIo, StlHasTheRightLengthAndNormals) {
  ASSERT_TRUE(writeMesh(path("a.stl"), test::cube()).isOk());
  const std::string bytes = content("a.stl");
  ASSERT_EQ(bytes.size(), 84U + 12U * 50U);
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, 4);
  EXPECT_EQ(count, 12U);
  float nz = 0.0F;
  std::memcpy(&nz, bytes.data() + 84 + 8, 4);
  EXPECT_EQ(nz, -1.0F);
}

TEST_F(MeshIo, GlbIsConsistent) {
  ASSERT_TRUE(writeMesh(path("a.glb"), test::cube()).isOk());
  const std::string bytes = content("a.glb");
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  };
  ASSERT_GT(bytes.size(), 20U);
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), bytes.size());
  EXPECT_EQ(word(12) % 4, 0U);
  const auto json = nlohmann::json::parse(bytes.substr(20, word(12)));
  const std::size_t binary = 20 + word(12) + 8;
  EXPECT_EQ(binary + word(binary - 8), bytes.size());
  EXPECT_EQ(json["buffers"][0]["byteLength"], 8 * 36 + 12 * 3 * 4);
  const auto& primitive = json["meshes"][0]["primitives"][0];
  const auto& accessor = json["accessors"][primitive["indices"].get<std::size_t>()];
  EXPECT_EQ(accessor["count"], 36);
  const auto& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
  EXPECT_EQ(word(binary + view["byteOffset"].get<std::size_t>() + 4), 2U);  // faces[0][1]
  EXPECT_EQ(json["accessors"][0]["max"], (std::vector<float>{1, 1, 1}));
}

TEST_F(MeshIo, RefusesWhatItCannotWrite) {
  EXPECT_EQ(writeMesh(path("a.xyz"), test::cube()).code(), StatusCode::kUnsupported);
  EXPECT_EQ(writeMesh(path("ply"), test::cube()).code(), StatusCode::kUnsupported);
  EXPECT_EQ(writeMesh(path("none/a.stl"), test::cube()).code(), StatusCode::kIoError);
  Mesh bad = test::cube();
  bad.faces[3][1] = 8;
  EXPECT_EQ(writeMesh(path("a.obj"), bad).code(), StatusCode::kInvalidInput);
  bad = test::cube();
  bad.vertices.points[2].x() = std::numeric_limits<float>::infinity();
  EXPECT_EQ(writeMesh(path("a.ply"), bad).code(), StatusCode::kInvalidInput);
  EXPECT_FALSE(std::filesystem::exists(path("a.ply")));
}

TEST(Render, SphereCoversItsDiscAndShowsItsColors) {
  const Mesh sphere = ballPivot(test::spherePoints(5000, 0.1), {}).value();
  const int w = 200, h = 160;
  const ViewPoint view = autoView(sphere, {-1.0, 0.0, 0.0}, w, h);  // from +x
  const cv::Mat image = renderMesh(sphere, view.T_map_camera, view.K, w, h, {0, 0, 255});
  ASSERT_EQ(image.type(), CV_8UC3);
  int covered = 0;
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x)
      covered += image.at<cv::Vec3b>(y, x) != cv::Vec3b(255, 0, 0) ? 1 : 0;
  }
  // The disc nearly fills the height; a hair is lost to the polygonal outline.
  const double r = 0.5 * h / 1.05;
  EXPECT_NEAR(covered, test::kPi * r * r, 0.04 * test::kPi * r * r);
  EXPECT_EQ(image.at<cv::Vec3b>(2, 2), cv::Vec3b(255, 0, 0));
  // From +x: red in the middle, green (y) to the right, blue (z) upwards.
  EXPECT_GT(image.at<cv::Vec3b>(80, 100)[2], image.at<cv::Vec3b>(80, 100)[1]);
  EXPECT_GT(image.at<cv::Vec3b>(80, 150)[1], image.at<cv::Vec3b>(80, 50)[1]);
  EXPECT_GT(image.at<cv::Vec3b>(30, 100)[0], image.at<cv::Vec3b>(130, 100)[0]);
  // Not inside out.
  Mesh inverted = sphere;
  for (auto& f : inverted.faces) std::swap(f[0], f[1]);
  const cv::Mat back = renderMesh(inverted, view.T_map_camera, view.K, w, h);
  EXPECT_LT(back.at<cv::Vec3b>(80, 100)[2], image.at<cv::Vec3b>(80, 100)[2]);
}

TEST(Render, NearerFaceHides) {
  Mesh mesh = test::gridMesh(1);
  Mesh nearer = mesh;
  for (auto& p : nearer.vertices.points) p.z() += 0.5F;
  mesh.vertices.colors.assign(4, Rgb8{255, 0, 0});
  nearer.vertices.colors.assign(4, Rgb8{0, 255, 0});
  for (const bool swap : {false, true}) {
    const Mesh both = swap ? test::joined(nearer, mesh) : test::joined(mesh, nearer);
    const ViewPoint view = autoView(both, {0.0, 0.0, -1.0}, 50, 50, Eigen::Vector3d::UnitY());
    const cv::Mat image = renderMesh(both, view.T_map_camera, view.K, 50, 50);
    EXPECT_GT(image.at<cv::Vec3b>(25, 25)[1], 100);
    EXPECT_EQ(image.at<cv::Vec3b>(25, 25)[2], 0);
  }
}

TEST(Render, EmptyMeshAndBadSize) {
  const ViewPoint view = autoView({}, {1.0, 0.0, 0.0}, 8, 8);
  const cv::Mat image = renderMesh({}, view.T_map_camera, view.K, 8, 8, {1, 2, 3});
  EXPECT_EQ(image.at<cv::Vec3b>(4, 4), cv::Vec3b(3, 2, 1));
  EXPECT_THROW(renderMesh({}, view.T_map_camera, view.K, 0, 8), ConfigurationError);
  EXPECT_THROW(autoView({}, {0.0, 0.0, 0.0}, 8, 8), ConfigurationError);
}

TEST(SurfaceOptions, RoundTripAndBounds) {
  SurfaceOptions options;
  options.fusion.voxel_m = 2e-3;
  options.smoothing.method = SmoothingMethod::kTwoStep;
  const ParameterTree tree = dumpOptions(options);
  SurfaceOptions loaded;
  loadOptions(tree, "surface", loaded);
  EXPECT_EQ(dumpOptions(loaded), tree);
  EXPECT_EQ(tree["smoothing"]["method"], "two_step");
  EXPECT_THROW(loadOptions(ParameterTree::parse(R"({"fusion": {"voxel": 1}})"), "surface", loaded),
               ConfigurationError);
  EXPECT_THROW(loadOptions(ParameterTree::parse(R"({"ball_pivot": {"radius_count": 9}})"),
                           "surface", loaded),
               ConfigurationError);
}

}  // namespace
}  // namespace scanner::surface
