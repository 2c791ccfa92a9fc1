#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "scanner/core/status.h"
#include "scanner/simulation/scene.h"

namespace scanner::simulation {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3f;

constexpr float kMid = 0.2158605F;  ///< linear value of sRGB 128 / 255

class MeshSceneTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              (std::string("mesh_scene_") +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name, std::ios::binary) << content;
    return (folder_ / name).string();
  }

  /// The message of the refusal.
  static std::string refusal(const std::string& path, const SceneOptions& options = {}) {
    try {
      loadMeshScene(path, options, 1);
    } catch (const ConfigurationError& error) {
      return error.what();
    }
    return "accepted";
  }

  fs::path folder_;
};

Appearance shadeAt(const Part& part, std::size_t vertex, float footprint_m) {
  SurfacePoint point;
  point.position = part.vertices[vertex];
  point.normal = part.normals[vertex];
  point.uv = part.uvs.empty() ? Eigen::Vector2f(0.0F, 0.0F) : part.uvs[vertex];
  if (!part.colors.empty()) point.color = part.colors[vertex];
  point.footprint_m = footprint_m;
  return part.shader(point);
}

/// A standing square in x and z, 2 x 2, lower left at (10, 20, 5); the picture fills it.
const char* const kSquareObj =
    "mtllib square.mtl\n"
    "v 10 20 5\nv 12 20 5\nv 12 20 7\nv 10 20 7\n"
    "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    "usemtl picture\nf 1/1 2/2 3/3 4/4\n";

TEST_F(MeshSceneTest, ObjWithPictureIsPlacedAndColoured) {
  const std::string path = write("square.obj", kSquareObj);
  write("square.mtl", "newmtl picture\nKd 0.8 0.8 0.8\nmap_Kd picture.png\n");
  // Red above, green below; a column of grey on the right.
  cv::Mat picture(64, 64, CV_8UC3, cv::Scalar(0, 0, 255));
  picture.rowRange(32, 64).setTo(cv::Scalar(0, 255, 0));
  picture.colRange(48, 64).setTo(cv::Scalar(128, 128, 128));
  cv::imwrite((folder_ / "picture.png").string(), picture);

  SceneOptions options;
  options.background = false;
  const Scene scene = loadMeshScene(path, options, 1);
  EXPECT_EQ(scene.name, "square");
  EXPECT_TRUE(scene.bounds.min().isApprox(Vector3f(-0.375F, 0.0F, 0.0F), 1e-5F));
  EXPECT_TRUE(scene.bounds.max().isApprox(Vector3f(0.375F, 0.0F, 0.75F), 1e-5F));
  ASSERT_EQ(scene.object.size(), 1U);
  const Part& part = scene.object[0];
  SurfacePoint point;
  point.normal = -Vector3f::UnitY();
  point.position.setZero();
  point.footprint_m = 0.001F;
  const auto colorAt = [&](float u, float v) {
    point.uv = {u, v};
    return part.shader(point).albedo;
  };
  EXPECT_LT((colorAt(0.2F, 0.8F) - Vector3f(0.95F, 0.0F, 0.0F)).norm(), 1e-3F);
  EXPECT_LT((colorAt(0.2F, 0.2F) - Vector3f(0.0F, 0.95F, 0.0F)).norm(), 1e-3F);
  EXPECT_LT((colorAt(0.88F, 0.5F) - Vector3f::Constant(kMid)).norm(), 1e-3F);
  // Between two texels the colours mix; a pixel as large as the picture sees its mean.
  EXPECT_NEAR(colorAt(0.2F, 0.5F).x(), 0.5F, 0.01F);
  point.footprint_m = 0.75F;
  EXPECT_NEAR(colorAt(0.2F, 0.8F).y(), 0.375F + 0.25F * kMid, 0.01F);

  const Mesh reference = referenceMesh(scene);
  EXPECT_EQ(reference.vertices.size(), 4U);
  EXPECT_EQ(reference.faces.size(), 2U);
  EXPECT_EQ(refusal(path), "accepted");
  fs::remove(folder_ / "picture.png");
  EXPECT_NE(refusal(path).find("picture.png"), std::string::npos) << refusal(path);
  EXPECT_NE(refusal(path).find("square.obj"), std::string::npos);
}

const char* const kColoredPly =
    "ply\nformat ascii 1.0\nelement vertex 4\n"
    "property float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 255 0 0\n2 0 0 0 255 0\n0 2 0 128 128 128\n0 0 4 0 0 255\n"
    "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

TEST_F(MeshSceneTest, PlyWithVertexColours) {
  SceneOptions options;
  options.background = false;
  options.mesh_height_m = 0.0;
  const Scene scene = loadMeshScene(write("tetra.ply", kColoredPly), options, 1);
  EXPECT_TRUE(scene.bounds.sizes().isApprox(Vector3f(2.0F, 2.0F, 4.0F), 1e-5F));
  ASSERT_EQ(scene.object.size(), 1U);
  const Part& part = scene.object[0];
  for (std::size_t i = 0; i < part.vertices.size(); ++i) {
    const Vector3f albedo = shadeAt(part, i, 0.001F).albedo;
    if (part.vertices[i].z() > 1.0F) {
      EXPECT_NEAR(albedo.z(), 0.95F, 1e-5F);
    }
    if (part.vertices[i].y() > 0.5F) {
      EXPECT_NEAR(albedo.x(), kMid, 1e-4F);
    }
  }
  const Mesh reference = referenceMesh(scene);
  EXPECT_EQ(reference.vertices.size(), 4U);
  // The options' axis points up: x of the file, 2 long.
  options.mesh_up = "x";
  const Scene turned = loadMeshScene((folder_ / "tetra.ply").string(), options, 1);
  EXPECT_TRUE(turned.bounds.sizes().isApprox(Vector3f(2.0F, 4.0F, 2.0F), 1e-5F));
}

TEST_F(MeshSceneTest, StlWithoutColourLooksWeatheredUnlessToldOtherwise) {
  const std::string path = write(
      "wedge.stl",
      "solid wedge\nfacet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\n"
      "endloop\nendfacet\nendsolid wedge\n");
  SceneOptions options;
  options.background = false;
  const auto spread = [&] {
    const Scene scene = loadMeshScene(path, options, 1);
    SurfacePoint point;
    point.normal = -Vector3f::UnitY();
    point.uv.setZero();
    point.footprint_m = 0.0007F;
    float low = 1.0F, high = 0.0F;
    for (int i = 0; i < 100; ++i) {
      point.position = {0.001F * static_cast<float>(i), 0.0F, 0.1F};
      const float brightness = scene.object[0].shader(point).albedo.mean();
      low = std::min(low, brightness);
      high = std::max(high, brightness);
    }
    return high - low;
  };
  EXPECT_GT(spread(), 0.1F);
  options.mesh_weathered = false;
  EXPECT_EQ(spread(), 0.0F);
}

TEST_F(MeshSceneTest, BadFilesAreRefusedByName) {
  EXPECT_NE(refusal(write("rubbish.glb", "this is not a mesh")).find("rubbish.glb"),
            std::string::npos);
  EXPECT_NE(refusal(write("points.ply",
                          "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                          "property float y\nproperty float z\nend_header\n0 0 0\n"))
                .find("points.ply"),
            std::string::npos);
  EXPECT_NE(refusal((folder_ / "absent.obj").string()).find("absent.obj"), std::string::npos);
  const std::string flat = write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_NE(refusal(flat).find("no height"), std::string::npos) << refusal(flat);
  SceneOptions options;
  options.mesh_up = "w";
  EXPECT_NE(refusal(flat, options).find("mesh_up"), std::string::npos);
}

TEST(RealDataMeshes, GlbFilesStandUprightAndAreTextured) {
  const char* folder = std::getenv("SCANNER_DATA");
  const fs::path data =
      folder != nullptr ? fs::path(folder) : fs::path(SCANNER_SOURCE_DIR "/../shared/data");
  if (!fs::exists(data / "meshes")) GTEST_SKIP() << "no folder " << data / "meshes";
  SceneOptions options;
  options.background = false;
  for (const std::string name : {"venus_de_milo", "whale_cranium"}) {
    const Scene scene = loadMeshScene((data / "meshes" / (name + ".glb")).string(), options, 1);
    EXPECT_EQ(scene.name, name);
    EXPECT_NEAR(scene.bounds.sizes().z(), 0.75F, 1e-4F);
    EXPECT_NEAR(scene.bounds.min().z(), 0.0F, 1e-5F);
    const Mesh reference = referenceMesh(scene);
    EXPECT_GT(reference.faces.size(), 10000U);
    double sum = 0.0, squares = 0.0;
    for (const Rgb8& c : reference.vertices.colors) {
      sum += c.g;
      squares += static_cast<double>(c.g) * c.g;
    }
    const auto count = static_cast<double>(reference.vertices.size());
    EXPECT_GT(std::sqrt(squares / count - sum * sum / count / count), 5.0) << name;
  }
  // Standing, she is taller than wide.
  const Scene venus = loadMeshScene((data / "meshes/venus_de_milo.glb").string(), options, 1);
  EXPECT_LT(venus.bounds.sizes().x(), 0.4F);
}

}  // namespace
}  // namespace scanner::simulation
