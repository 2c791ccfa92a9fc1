#include "scanner/surface/mesh_io.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "scanner/core/ply.h"
#include "surface/mesh_edges.h"

namespace scanner::surface {
namespace {

Status checkMesh(const Mesh& mesh) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices.points[i].allFinite()) {
      return {StatusCode::kInvalidInput,
              "writeMesh: position of vertex " + std::to_string(i) + " is not finite"};
    }
  }
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (const std::uint32_t v : mesh.faces[f]) {
      if (v < mesh.vertices.size()) continue;
      return {StatusCode::kInvalidInput, "writeMesh: face " + std::to_string(f) + " names vertex " +
                                             std::to_string(v) + " of " +
                                             std::to_string(mesh.vertices.size())};
    }
  }
  return Status::ok();
}

std::string toObj(const Mesh& mesh) {
  std::string out;
  std::array<char, 128> line{};
  const auto print = [&](const char* format, auto... values) {
    const int n = std::snprintf(line.data(), line.size(), format, values...);
    out.append(line.data(), static_cast<std::size_t>(n));
  };
  const PointCloud& v = mesh.vertices;
  for (std::size_t i = 0; i < v.size(); ++i) {
    const Eigen::Vector3d p = v.points[i].cast<double>();
    print("v %.9g %.9g %.9g", p.x(), p.y(), p.z());
    if (v.hasColors()) {
      print(" %.4f %.4f %.4f", v.colors[i].r / 255.0, v.colors[i].g / 255.0, v.colors[i].b / 255.0);
    }
    out += '\n';
  }
  if (v.hasNormals()) {
    for (const auto& normal : v.normals) {
      const Eigen::Vector3d n =
          normal.allFinite() ? Eigen::Vector3d(normal.cast<double>()) : Eigen::Vector3d::Zero();
      print("vn %.6g %.6g %.6g\n", n.x(), n.y(), n.z());
    }
  }
  for (const Face& f : mesh.faces) {
    const std::array<unsigned, 3> c{f[0] + 1, f[1] + 1, f[2] + 1};
    if (v.hasNormals()) {
      print("f %u//%u %u//%u %u//%u\n", c[0], c[0], c[1], c[1], c[2], c[2]);
    } else {
      print("f %u %u %u\n", c[0], c[1], c[2]);
    }
  }
  return out;
}

/// Little-endian bytes; the platforms we build for are.
template <typename T>
void appendBytes(std::string& out, const T& value) {
  std::array<char, sizeof(T)> bytes{};
  std::memcpy(bytes.data(), &value, sizeof(T));
  out.append(bytes.data(), bytes.size());
}

void appendVector(std::string& out, const Eigen::Vector3f& v) {
  for (int axis = 0; axis < 3; ++axis) appendBytes(out, v[axis]);
}

std::string toStl(const Mesh& mesh) {
  std::string out(80, ' ');
  out.replace(0, 19, "binary STL, metres ");
  appendBytes(out, static_cast<std::uint32_t>(mesh.faces.size()));
  for (const Face& f : mesh.faces) {
    const Eigen::Vector3d n = areaVector(mesh, f);
    appendVector(out, n.norm() > 0.0 ? Eigen::Vector3f(n.normalized().cast<float>())
                                     : Eigen::Vector3f::Zero());
    for (const std::uint32_t v : f) appendVector(out, mesh.vertices.points[v]);
    appendBytes(out, std::uint16_t{0});
  }
  return out;
}

/// glTF vertex colours are linear, ours are as the camera gives them (sRGB).
float linear(std::uint8_t value) {
  const double c = value / 255.0;
  return static_cast<float>(c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
}

/// Binary buffer of a .glb and the JSON that describes it.
class GltfBuilder {
 public:
  GltfBuilder() {
    root_["asset"] = {{"version", "2.0"}, {"generator", "scanner"}};
    root_["bufferViews"] = nlohmann::json::array();
    root_["accessors"] = nlohmann::json::array();
  }

  /// Adds one accessor over `bytes`; returns its index.
  std::size_t add(const std::string& bytes, std::size_t count, int component, const char* type,
                  int target) {
    root_["bufferViews"].push_back({{"buffer", 0},
                                    {"byteOffset", binary_.size()},
                                    {"byteLength", bytes.size()},
                                    {"target", target}});
    root_["accessors"].push_back({{"bufferView", root_["bufferViews"].size() - 1},
                                  {"componentType", component},
                                  {"count", count},
                                  {"type", type}});
    binary_ += bytes;
    return root_["accessors"].size() - 1;
  }

  nlohmann::json& root() { return root_; }

  std::string finish() {
    root_["buffers"] = {{{"byteLength", binary_.size()}}};
    std::string text = root_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    binary_.resize((binary_.size() + 3) / 4 * 4, '\0');
    std::string out = "glTF";
    appendBytes(out, std::uint32_t{2});
    appendBytes(out, static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + binary_.size()));
    appendBytes(out, static_cast<std::uint32_t>(text.size()));
    out += "JSON" + text;
    appendBytes(out, static_cast<std::uint32_t>(binary_.size()));
    out += std::string("BIN\0", 4) + binary_;
    return out;
  }

 private:
  nlohmann::json root_;
  std::string binary_;
};

std::string toGlb(const Mesh& mesh) {
  constexpr int kFloat = 5126, kUnsigned = 5125, kVertices = 34962, kIndices = 34963;
  const PointCloud& v = mesh.vertices;
  GltfBuilder gltf;
  std::string bytes;
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
  Eigen::Vector3f high = -low;
  for (const auto& p : v.points) {
    appendVector(bytes, p);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  nlohmann::json attributes;
  const std::size_t position = gltf.add(bytes, v.size(), kFloat, "VEC3", kVertices);
  attributes["POSITION"] = position;
  gltf.root()["accessors"][position]["min"] = {low.x(), low.y(), low.z()};
  gltf.root()["accessors"][position]["max"] = {high.x(), high.y(), high.z()};
  if (v.hasNormals()) {
    bytes.clear();
    for (const auto& n : v.normals) {
      appendVector(bytes, n.allFinite() ? n : Eigen::Vector3f(Eigen::Vector3f::UnitZ()));
    }
    attributes["NORMAL"] = gltf.add(bytes, v.size(), kFloat, "VEC3", kVertices);
  }
  if (v.hasColors()) {
    bytes.clear();
    for (const Rgb8& c : v.colors) appendVector(bytes, {linear(c.r), linear(c.g), linear(c.b)});
    attributes["COLOR_0"] = gltf.add(bytes, v.size(), kFloat, "VEC3", kVertices);
  }
  bytes.clear();
  for (const Face& f : mesh.faces) {
    for (const std::uint32_t corner : f) appendBytes(bytes, corner);
  }
  const std::size_t indices = gltf.add(bytes, 3 * mesh.faces.size(), kUnsigned, "SCALAR", kIndices);
  gltf.root()["materials"] = {
      {{"pbrMetallicRoughness", {{"metallicFactor", 0.0}, {"roughnessFactor", 1.0}}},
       {"doubleSided", true}}};
  gltf.root()["meshes"] = {
      {{"primitives", {{{"attributes", attributes}, {"indices", indices}, {"material", 0}}}}}};
  // z up to y up: -90 degrees about x.
  const double half = std::sqrt(0.5);
  gltf.root()["nodes"] = {{{"mesh", 0}, {"rotation", {-half, 0.0, 0.0, half}}}};
  gltf.root()["scenes"] = {{{"nodes", {0}}}};
  gltf.root()["scene"] = 0;
  return gltf.finish();
}

}  // namespace

Status writeMesh(const std::string& path, const Mesh& mesh) {
  const std::size_t dot = path.find_last_of("./");
  std::string extension = dot == std::string::npos || path[dot] == '/' ? "" : path.substr(dot);
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const Status status = checkMesh(mesh);
  if (!status) return status;
  if (extension == ".ply") return writePly(path, mesh);
  if (extension == ".obj") return writeFileAtomically(path, toObj(mesh));
  if (extension == ".stl") return writeFileAtomically(path, toStl(mesh));
  if (extension == ".glb") {
    if (mesh.faces.empty()) {
      return {StatusCode::kInvalidInput, "writeMesh: " + path + ": glTF cannot hold an empty mesh"};
    }
    return writeFileAtomically(path, toGlb(mesh));
  }
  return {StatusCode::kUnsupported,
          "writeMesh: " + path + ": extension is none of .ply .obj .stl .glb"};
}

}  // namespace scanner::surface
