// Debian packages no PLY library that keeps points, normals, colours and custom properties together
// without pulling in a renderer (PCL's reader links VTK; Assimp drops clouds without faces), hence
// this small reader and writer.

#include "scanner/core/ply.h"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <system_error>

#include "core/ply_parser.h"

namespace scanner {
namespace {

static_assert(sizeof(float) == 4 && sizeof(std::uint32_t) == 4, "PLY needs 32-bit types");

template <typename T>
void put(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string header(const PointCloud& cloud, std::size_t faces, bool with_faces) {
  std::ostringstream out;
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << cloud.size() << "\n"
      << "property float x\nproperty float y\nproperty float z\n";
  if (cloud.hasNormals()) out << "property float nx\nproperty float ny\nproperty float nz\n";
  if (cloud.hasColors()) {
    out << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  }
  if (cloud.hasSigmas()) out << "property float sigma\n";
  if (with_faces) out << "element face " << faces << "\nproperty list uchar int vertex_indices\n";
  out << "end_header\n";
  return out.str();
}

void putVertices(std::string& out, const PointCloud& cloud) {
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (int k = 0; k < 3; ++k) put(out, cloud.points[i][k]);
    if (cloud.hasNormals()) {
      for (int k = 0; k < 3; ++k) put(out, cloud.normals[i][k]);
    }
    if (cloud.hasColors()) {
      put(out, cloud.colors[i].r);
      put(out, cloud.colors[i].g);
      put(out, cloud.colors[i].b);
    }
    if (cloud.hasSigmas()) put(out, cloud.sigmas[i]);
  }
}

}  // namespace

Status writeFileAtomically(const std::string& path, const std::string& content) {
  // POSIX rename within one folder is atomic: a reader sees the old file or the new one.
  const std::string temporary = path + ".part";
  std::FILE* file = std::fopen(temporary.c_str(), "wb");
  if (file == nullptr) {
    return {StatusCode::kIoError, "cannot write " + path + ": " + std::strerror(errno)};
  }
  const bool written = std::fwrite(content.data(), 1, content.size(), file) == content.size();
  int error = written ? 0 : errno;
  if (std::fclose(file) != 0 && error == 0) error = errno;
  if (error == 0 && std::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error == 0) return Status::ok();
  std::remove(temporary.c_str());
  return {StatusCode::kIoError, "cannot write " + path + ": " + std::strerror(error)};
}

Status writePly(const std::string& path, const PointCloud& cloud) {
  std::string out = header(cloud, 0, false);
  putVertices(out, cloud);
  return writeFileAtomically(path, out);
}

Status writePly(const std::string& path, const Mesh& mesh) {
  if (mesh.vertices.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    return {StatusCode::kUnsupported, path + ": too many vertices for PLY's 32-bit indices"};
  }
  std::string out = header(mesh.vertices, mesh.faces.size(), true);
  putVertices(out, mesh.vertices);
  for (const auto& face : mesh.faces) {
    put(out, std::uint8_t{3});
    for (const std::uint32_t index : face) put(out, index);
  }
  return writeFileAtomically(path, out);
}

Result<Mesh> readPly(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return Status(StatusCode::kIoError, "cannot read " + path);
  try {
    return ply::parse(in);
  } catch (const ply::ParseError& error) {
    return Status(StatusCode::kInvalidInput, path + ": " + error.what());
  }
}

}  // namespace scanner
