#include "ros/mesh_preview.h"

#include <cmath>
#include <map>
#include <vector>

namespace scanner::bridge {
namespace {

double meanEdge(const Mesh& mesh) {
  double sum = 0.0;
  for (const auto& f : mesh.faces) {
    for (std::size_t i = 0; i < 3; ++i) {
      sum += static_cast<double>(
          (mesh.vertices.points[f[i]] - mesh.vertices.points[f[(i + 1) % 3]]).norm());
    }
  }
  return sum / (3.0 * static_cast<double>(mesh.faces.size()));
}

struct Cell {
  std::uint32_t vertex = 0;
  std::size_t count = 0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d color = Eigen::Vector3d::Zero();
};

std::uint8_t channel(double sum, std::size_t count) {
  return static_cast<std::uint8_t>(std::lround(sum / static_cast<double>(count)));
}

}  // namespace

Mesh clustered(const Mesh& mesh, double cell_m) {
  const bool colored = mesh.vertices.hasColors();
  std::map<std::array<std::int64_t, 3>, std::size_t> index;
  std::vector<Cell> cells;
  std::vector<std::size_t> cell_of(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3d p = mesh.vertices.points[i].cast<double>();
    std::array<std::int64_t, 3> key{};
    for (std::size_t k = 0; k < 3; ++k) {
      key[k] = static_cast<std::int64_t>(std::floor(p[static_cast<Eigen::Index>(k)] / cell_m));
    }
    const std::size_t c = index.emplace(key, cells.size()).first->second;
    if (c == cells.size()) cells.emplace_back();
    cell_of[i] = c;
    ++cells[c].count;
    cells[c].point += p;
    if (!colored) continue;
    const Rgb8& rgb = mesh.vertices.colors[i];
    cells[c].color += Eigen::Vector3d(rgb.r, rgb.g, rgb.b);
  }
  Mesh out;
  for (const Cell& cell : cells) {
    out.vertices.points.push_back((cell.point / static_cast<double>(cell.count)).cast<float>());
    if (!colored) continue;
    out.vertices.colors.push_back({channel(cell.color.x(), cell.count),
                                   channel(cell.color.y(), cell.count),
                                   channel(cell.color.z(), cell.count)});
  }
  for (const auto& f : mesh.faces) {
    const std::size_t a = cell_of[f[0]], b = cell_of[f[1]], c = cell_of[f[2]];
    if (a == b || b == c || c == a) continue;
    out.faces.push_back({static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b),
                         static_cast<std::uint32_t>(c)});
  }
  return out;
}

Mesh previewMesh(const Mesh& mesh, std::size_t max_faces) {
  if (mesh.faces.size() <= max_faces || mesh.faces.empty()) return mesh;
  // Faces shrink with the square of the cell; from there on by steps until it fits.
  double cell = meanEdge(mesh) *
                std::sqrt(static_cast<double>(mesh.faces.size()) / static_cast<double>(max_faces));
  constexpr double kStep = 1.25;
  Mesh out = clustered(mesh, cell);
  while (out.faces.size() > max_faces) {
    cell *= kStep;
    out = clustered(mesh, cell);
  }
  return out;
}

}  // namespace scanner::bridge
