#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/simulation/scene.h"
#include "simulation/materials.h"
#include "simulation/surroundings.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

float decodeSrgb(float encoded) {
  return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

Vector3f decodeSrgb(const Vector3f& encoded) {
  return encoded.unaryExpr([](float v) { return decodeSrgb(v); });
}

/// A picture as a pyramid of linear colours; repeats in both directions. Immutable.
class Texture {
 public:
  enum class Encoding { kSrgb, kLinear };

  /// `picture`: CV_8UC3 in OpenCV's order (BGR), not empty.
  Texture(const cv::Mat& picture, Encoding encoding) {
    cv::Mat_<std::uint16_t> table(1, 256);
    for (int i = 0; i < 256; ++i) {
      const float value = static_cast<float>(i) / 255.0F;
      const float linear = encoding == Encoding::kSrgb ? decodeSrgb(value) : value;
      table(i) = static_cast<std::uint16_t>(std::lround(linear * kFull));
    }
    cv::Mat level(picture.size(), CV_16UC3);
    for (int y = 0; y < picture.rows; ++y) {
      const auto* from = picture.ptr<cv::Vec3b>(y);
      auto* to = level.ptr<Texel>(y);
      for (int x = 0; x < picture.cols; ++x) {
        for (int c = 0; c < 3; ++c) to[x][c] = table(from[x][c]);
      }
    }
    levels_.push_back(level);
    while (levels_.back().rows > 1 || levels_.back().cols > 1) levels_.push_back(halved());
  }

  Eigen::Vector2f size() const {
    return {static_cast<float>(levels_[0].cols), static_cast<float>(levels_[0].rows)};
  }

  /// Linear RGB at `uv` (v upwards from the bottom), averaged over about `texels` texels:
  /// trilinear.
  Vector3f sample(const Vector2f& uv, float texels) const {
    const float level =
        std::clamp(std::log2(std::max(texels, 1.0F)), 0.0F, static_cast<float>(levels_.size() - 1));
    const auto fine = static_cast<std::size_t>(level);
    const float blend = level - static_cast<float>(fine);
    const Vector3f color = bilinear(levels_[fine], uv);
    if (blend <= 0.0F) return color;
    return color + blend * (bilinear(levels_[fine + 1], uv) - color);
  }

 private:
  using Texel = cv::Vec<std::uint16_t, 3>;
  static constexpr float kFull = 65535.0F;

  /// Means of 2x2; an odd last row or column is its own neighbour.
  cv::Mat halved() const {
    const cv::Mat& from = levels_.back();
    cv::Mat to((from.rows + 1) / 2, (from.cols + 1) / 2, CV_16UC3);
    for (int y = 0; y < to.rows; ++y) {
      const auto* above = from.ptr<Texel>(2 * y);
      const auto* below = from.ptr<Texel>(std::min(2 * y + 1, from.rows - 1));
      auto* row = to.ptr<Texel>(y);
      for (int x = 0; x < to.cols; ++x) {
        const int left = 2 * x, right = std::min(2 * x + 1, from.cols - 1);
        for (int c = 0; c < 3; ++c) {
          const unsigned sum =
              0U + above[left][c] + above[right][c] + below[left][c] + below[right][c];
          row[x][c] = static_cast<std::uint16_t>((sum + 2U) / 4U);
        }
      }
    }
    return to;
  }

  static Vector3f bilinear(const cv::Mat& level, const Vector2f& uv) {
    const float x = (uv.x() - std::floor(uv.x())) * static_cast<float>(level.cols) - 0.5F;
    const float y = (std::ceil(uv.y()) - uv.y()) * static_cast<float>(level.rows) - 0.5F;
    const float x0 = std::floor(x), y0 = std::floor(y);
    const auto texel = [&](int dx, int dy) {
      const int column = (static_cast<int>(x0) + dx + level.cols) % level.cols;
      const int row = (static_cast<int>(y0) + dy + level.rows) % level.rows;
      const auto& t = level.at<Texel>(row, column);
      return Vector3f(static_cast<float>(t[2]), static_cast<float>(t[1]), static_cast<float>(t[0]));
    };
    const float u = x - x0, v = y - y0;
    const Vector3f upper = texel(0, 0) + u * (texel(1, 0) - texel(0, 0));
    const Vector3f lower = texel(0, 1) + u * (texel(1, 1) - texel(0, 1));
    return (upper + v * (lower - upper)) / kFull;
  }

  std::vector<cv::Mat> levels_;  ///< CV_16UC3, linear, the finest first
};

std::string extensionOf(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

/// One file on its way to parts of a scene.
class MeshImport {
 public:
  MeshImport(const std::string& path, const SceneOptions& options, int seed)
      : path_(path), options_(options), seed_(seed), is_gltf_(isGltf(path)) {
    importer_.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                                 aiPrimitiveType_POINT | aiPrimitiveType_LINE);
    file_ = importer_.ReadFile(path, aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                                         aiProcess_GenSmoothNormals | aiProcess_SortByPType |
                                         aiProcess_PreTransformVertices);
    if (file_ == nullptr) fail(importer_.GetErrorString());
  }

  std::vector<Part> run() {
    std::vector<Part> parts;
    for (unsigned i = 0; i < file_->mNumMeshes; ++i) {
      if (file_->mMeshes[i]->HasFaces()) parts.push_back(readGeometry(*file_->mMeshes[i]));
    }
    if (parts.empty()) fail("it holds no triangles");
    place(&parts);
    std::size_t next = 0;
    for (unsigned i = 0; i < file_->mNumMeshes; ++i) {
      const aiMesh& mesh = *file_->mMeshes[i];
      if (!mesh.HasFaces()) continue;
      Part& part = parts[next++];
      part.shader = makeShader(mesh, part);
    }
    return parts;
  }

 private:
  static bool isGltf(const std::string& path) {
    const std::string extension = extensionOf(path);
    return extension == ".glb" || extension == ".gltf";
  }
  [[noreturn]] void fail(const std::string& why) const {
    throw ConfigurationError("mesh '" + path_ + "': " + why);
  }

  Part readGeometry(const aiMesh& mesh) const;
  Vector3f upright(const aiVector3D& v) const;
  void place(std::vector<Part>* parts) const;
  Shader makeShader(const aiMesh& mesh, const Part& part);
  std::shared_ptr<const Texture> textureOf(const aiMaterial& material,
                                           std::initializer_list<aiTextureType> types,
                                           Texture::Encoding encoding);
  Shader makeStoneShader(const aiMaterial& material, const Part& part, const Vector3f& color);
  cv::Mat readPicture(const std::string& name) const;
  Vector3f colorOf(const aiMaterial& material) const;

  std::string path_;
  SceneOptions options_;
  int seed_;
  bool is_gltf_;
  Assimp::Importer importer_;
  const aiScene* file_ = nullptr;
  std::map<std::string, std::shared_ptr<const Texture>> textures_;
};

/// The file's axes to ours, z up.
Vector3f MeshImport::upright(const aiVector3D& v) const {
  const std::string& up = options_.mesh_up;
  if (up == "y" || (up == "auto" && is_gltf_)) return {v.x, -v.z, v.y};
  if (up == "x") return {v.y, v.z, v.x};
  return {v.x, v.y, v.z};
}

Part MeshImport::readGeometry(const aiMesh& mesh) const {
  Part part;
  part.name = mesh.mName.C_Str();
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const Vector3f normal = upright(mesh.mNormals[i]);
    part.vertices.push_back(upright(mesh.mVertices[i]));
    if (!part.vertices.back().allFinite()) fail("a vertex is not finite");
    const bool usable = normal.allFinite() && normal.squaredNorm() > 0.0F;
    part.normals.push_back(usable ? normal.normalized() : Vector3f::UnitZ());
    if (mesh.HasTextureCoords(0)) {
      part.uvs.emplace_back(mesh.mTextureCoords[0][i].x, mesh.mTextureCoords[0][i].y);
    }
    if (mesh.HasVertexColors(0)) {
      const aiColor4D& c = mesh.mColors[0][i];
      const Vector3f color(c.r, c.g, c.b);
      part.colors.push_back(is_gltf_ ? color : decodeSrgb(color));
    }
  }
  for (unsigned i = 0; i < mesh.mNumFaces; ++i) {
    const aiFace& face = mesh.mFaces[i];
    if (face.mNumIndices == 3) {
      part.faces.push_back({face.mIndices[0], face.mIndices[1], face.mIndices[2]});
    }
  }
  return part;
}

/// Scaled to the height that is asked for, over the origin, on the ground.
void MeshImport::place(std::vector<Part>* parts) const {
  Eigen::AlignedBox3f box;
  for (const Part& part : *parts) {
    for (const Vector3f& v : part.vertices) box.extend(v);
  }
  const float height = box.sizes().z();
  if (!(height > 0.0F)) fail("it has no height");
  const auto wanted = static_cast<float>(options_.mesh_height_m);
  const float scale = wanted > 0.0F ? wanted / height : 1.0F;
  const Vector3f foot(box.center().x(), box.center().y(), box.min().z());
  for (Part& part : *parts) {
    for (Vector3f& v : part.vertices) v = scale * (v - foot);
  }
}

cv::Mat MeshImport::readPicture(const std::string& name) const {
  cv::Mat picture;
  if (const aiTexture* embedded = file_->GetEmbeddedTexture(name.c_str())) {
    if (embedded->mHeight == 0) {
      const cv::Mat bytes(1, static_cast<int>(embedded->mWidth), CV_8UC1, embedded->pcData);
      picture = cv::imdecode(bytes, cv::IMREAD_COLOR);
    } else {
      const cv::Mat bgra(static_cast<int>(embedded->mHeight), static_cast<int>(embedded->mWidth),
                         CV_8UC4, embedded->pcData);
      picture.create(bgra.size(), CV_8UC3);
      cv::mixChannels(std::vector<cv::Mat>{bgra}, std::vector<cv::Mat>{picture},
                      std::vector<int>{0, 0, 1, 1, 2, 2});
    }
  } else {
    std::string relative = name;
    std::replace(relative.begin(), relative.end(), '\\', '/');
    const std::filesystem::path folder = std::filesystem::path(path_).parent_path();
    picture = cv::imread((folder / relative).string(), cv::IMREAD_COLOR);
  }
  if (picture.empty()) fail("its texture '" + name + "' cannot be read");
  return picture;
}

std::shared_ptr<const Texture> MeshImport::textureOf(const aiMaterial& material,
                                                     std::initializer_list<aiTextureType> types,
                                                     Texture::Encoding encoding) {
  for (const aiTextureType type : types) {
    aiString name;
    if (material.GetTexture(type, 0, &name) != aiReturn_SUCCESS) continue;
    std::shared_ptr<const Texture>& texture = textures_[name.C_Str()];
    if (!texture) texture = std::make_shared<const Texture>(readPicture(name.C_Str()), encoding);
    return texture;
  }
  return nullptr;
}

/// Colour of a material without texture, or the factor of its texture. glTF states it linear and as
/// a factor; other formats as one sees it, and often left over from before there was a texture.
Vector3f MeshImport::colorOf(const aiMaterial& material) const {
  aiColor4D color(1.0F, 1.0F, 1.0F, 1.0F);
  if (is_gltf_ && material.Get(AI_MATKEY_BASE_COLOR, color) == aiReturn_SUCCESS) {
    return {color.r, color.g, color.b};
  }
  aiString texture;
  if (material.GetTexture(aiTextureType_DIFFUSE, 0, &texture) == aiReturn_SUCCESS) {
    return Vector3f::Ones();
  }
  if (material.Get(AI_MATKEY_COLOR_DIFFUSE, color) != aiReturn_SUCCESS) {
    return Vector3f::Constant(0.5F);
  }
  return decodeSrgb(Vector3f(color.r, color.g, color.b).cwiseMax(0.0F).cwiseMin(1.0F));
}

/// Metres per texel, the mean over the part. 0 when the texture coordinates span no area.
float texelSize(const Part& part, const Vector2f& texture_size) {
  double surface = 0.0, texels = 0.0;
  for (const auto& [a, b, c] : part.faces) {
    const Vector3f e1 = part.vertices[b] - part.vertices[a];
    const Vector3f e2 = part.vertices[c] - part.vertices[a];
    const Vector2f t1 = (part.uvs[b] - part.uvs[a]).cwiseProduct(texture_size);
    const Vector2f t2 = (part.uvs[c] - part.uvs[a]).cwiseProduct(texture_size);
    surface += static_cast<double>(e1.cross(e2).norm());
    texels += static_cast<double>(std::abs(t1.x() * t2.y() - t1.y() * t2.x()));
  }
  return texels > 0.0 ? static_cast<float>(std::sqrt(surface / texels)) : 0.0F;
}

Appearance dull(const SurfacePoint& point, const Vector3f& albedo) {
  Appearance a;
  a.albedo = albedo.cwiseMax(0.0F).cwiseMin(0.95F);
  a.normal = point.normal;
  a.specular = 0.03F;
  a.roughness = 0.6F;
  return a;
}

/// Old stone of this colour. Where the file has the occlusion of its hollows, rain has not cleaned
/// them.
Shader MeshImport::makeStoneShader(const aiMaterial& material, const Part& part,
                                   const Vector3f& color) {
  StonePalette palette;
  palette.base = 0.62F * color;
  palette.dark = 0.2F * color;
  palette.light = 0.8F * color;
  palette.stain = color.cwiseProduct(Vector3f(0.30F, 0.22F, 0.14F));
  palette.grain_m = 0.0013F;
  palette.lichen = 0.35F;
  palette.bump = 0.1F;
  const auto seed = static_cast<std::uint32_t>(seed_);
  const std::shared_ptr<const Texture> occlusion =
      part.uvs.empty()
          ? nullptr
          : textureOf(material, {aiTextureType_AMBIENT_OCCLUSION, aiTextureType_LIGHTMAP},
                      Texture::Encoding::kLinear);
  if (!occlusion) return stone(palette, seed);
  const float texel_m = texelSize(part, occlusion->size());
  return [=](const SurfacePoint& point) {
    Appearance a = shadeStone(point, palette, seed);
    const float texels = texel_m > 0.0F ? point.footprint_m / texel_m : 1.0F;
    a.albedo *= 0.35F + 0.65F * occlusion->sample(point.uv, texels).x();
    return a;
  };
}

Shader MeshImport::makeShader(const aiMesh& mesh, const Part& part) {
  const aiMaterial& material = *file_->mMaterials[mesh.mMaterialIndex];
  const Vector3f factor = colorOf(material);
  const std::shared_ptr<const Texture> texture =
      part.uvs.empty() ? nullptr
                       : textureOf(material, {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE},
                                   Texture::Encoding::kSrgb);
  if (!texture) {
    if (part.colors.empty() && options_.mesh_weathered) {
      return makeStoneShader(material, part, factor);
    }
    // Vertex colours say it all: the material of a file that has them is the importer's default.
    const Vector3f tint = part.colors.empty() || is_gltf_ ? factor : Vector3f::Ones();
    return [tint](const SurfacePoint& p) { return dull(p, tint.cwiseProduct(p.color)); };
  }
  const float texel_m = texelSize(part, texture->size());
  return [=](const SurfacePoint& point) {
    const float texels = texel_m > 0.0F ? point.footprint_m / texel_m : 1.0F;
    const Vector3f color = factor.cwiseProduct(texture->sample(point.uv, texels));
    return dull(point, color.cwiseProduct(point.color));
  };
}

}  // namespace

Scene loadMeshScene(const std::string& path, const SceneOptions& options, int seed) {
  static const std::array<std::string, 4> kAxes = {"auto", "x", "y", "z"};
  if (std::find(kAxes.begin(), kAxes.end(), options.mesh_up) == kAxes.end()) {
    throw ConfigurationError("simulation.scene.mesh_up is '" + options.mesh_up +
                             "', must be auto, x, y or z");
  }
  Scene scene;
  scene.name = std::filesystem::path(path).stem().string();
  scene.object = MeshImport(path, options, seed).run();
  for (const Part& part : scene.object) {
    for (const Vector3f& v : part.vertices) scene.bounds.extend(v);
  }
  scene.surroundings = makeSurroundings(scene.bounds, options.background, seed);
  return scene;
}

}  // namespace scanner::simulation
