#include "scanner/surface/clean.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <tuple>
#include <vector>

#include "surface/mesh_edges.h"

namespace scanner::surface {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Drops the faces that `drop` flags; returns how many.
std::size_t dropFaces(Mesh& mesh, const std::vector<char>& drop) {
  std::size_t n = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (!drop[f]) mesh.faces[n++] = mesh.faces[f];
  }
  const std::size_t dropped = mesh.faces.size() - n;
  mesh.faces.resize(n);
  return dropped;
}

template <typename Predicate>
std::size_t dropFacesIf(Mesh& mesh, Predicate&& predicate) {
  std::vector<char> drop(mesh.faces.size());
  for (std::size_t f = 0; f < drop.size(); ++f) drop[f] = predicate(mesh.faces[f]) ? 1 : 0;
  return dropFaces(mesh, drop);
}

std::size_t dropInvalidFaces(Mesh& mesh) {
  return dropFacesIf(mesh, [&](const Face& f) {
    return std::any_of(f.begin(), f.end(), [&](std::uint32_t v) {
      return v >= mesh.vertices.size() || !mesh.vertices.points[v].allFinite();
    });
  });
}

/// Points faces at the first of the vertices in one place; the others become unreferenced and are
/// removed at once, so that the count means what it says.
std::size_t mergeDuplicateVertices(Mesh& mesh) {
  const PointCloud& v = mesh.vertices;
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < v.size(); ++i) {
    if (v.points[i].allFinite()) order.push_back(i);
  }
  const auto place = [&](std::uint32_t i) {
    const Eigen::Vector3f& p = v.points[i];
    return std::make_tuple(p.x(), p.y(), p.z());
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return place(a) != place(b) ? place(a) < place(b) : a < b;
  });
  std::vector<std::uint32_t> target(v.size());
  std::iota(target.begin(), target.end(), 0U);
  std::vector<std::size_t> kept;
  std::size_t merged = 0;
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin + 1;
    while (end < order.size() && place(order[end]) == place(order[begin])) ++end;
    for (std::size_t i = begin + 1; i < end; ++i) {
      for (std::size_t j = begin; j < i; ++j) {
        const bool opposed = v.hasNormals() && v.normals[order[i]].dot(v.normals[order[j]]) < 0.0F;
        if (opposed || target[order[j]] != order[j]) continue;
        target[order[i]] = order[j];
        ++merged;
        break;
      }
    }
    begin = end;
  }
  if (merged == 0) return 0;
  std::vector<std::uint32_t> renumbered(v.size(), kNone);
  for (std::uint32_t i = 0; i < v.size(); ++i) {
    if (target[i] != i) continue;
    renumbered[i] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(i);
  }
  for (Face& f : mesh.faces) {
    for (std::uint32_t& corner : f) corner = renumbered[target[corner]];
  }
  mesh.vertices = subset(mesh.vertices, kept);
  return merged;
}

std::size_t dropDegenerateFaces(Mesh& mesh) {
  return dropFacesIf(mesh, [&](const Face& f) {
    if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) return true;
    double longest2 = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3f side =
          mesh.vertices.points[f[k]] - mesh.vertices.points[f[(k + 1) % 3]];
      longest2 = std::max(longest2, side.cast<double>().squaredNorm());
    }
    // Height below a millionth of the longest side: no area at the precision of the vertices.
    return 2.0 * areaVector(mesh, f).norm() <= 1e-6 * longest2;
  });
}

std::size_t dropDuplicateFaces(Mesh& mesh) {
  std::vector<std::pair<Face, std::uint32_t>> keyed;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    Face key = mesh.faces[f];
    std::sort(key.begin(), key.end());
    keyed.emplace_back(key, static_cast<std::uint32_t>(f));
  }
  std::sort(keyed.begin(), keyed.end());
  std::vector<char> drop(mesh.faces.size(), 0);
  for (std::size_t i = 1; i < keyed.size(); ++i) {
    if (keyed[i].first == keyed[i - 1].first) drop[keyed[i].second] = 1;
  }
  return dropFaces(mesh, drop);
}

void dropColor(Mesh& mesh, const CleaningOptions& o, CleaningStatistics& stats) {
  if (!mesh.vertices.hasColors()) return;
  std::vector<char> matches(mesh.vertices.size());
  const auto close = [&](int a, int b) { return std::abs(a - b) <= o.color_tolerance; };
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Rgb8 c = mesh.vertices.colors[i];
    matches[i] = close(c.r, o.color_r) && close(c.g, o.color_g) && close(c.b, o.color_b) ? 1 : 0;
  }
  stats.colored_faces += dropFacesIf(
      mesh, [&](const Face& f) { return matches[f[0]] || matches[f[1]] || matches[f[2]]; });
  std::vector<std::size_t> kept;
  std::vector<std::uint32_t> renumbered(matches.size(), kNone);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i]) continue;
    renumbered[i] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(i);
  }
  stats.colored_vertices += matches.size() - kept.size();
  for (Face& f : mesh.faces) {
    for (std::uint32_t& corner : f) corner = renumbered[corner];
  }
  mesh.vertices = subset(mesh.vertices, kept);
}

/// Lets every edge keep one face for each direction along it, the larger ones.
std::size_t dropNonManifoldFaces(Mesh& mesh) {
  const auto uses = sortedEdgeUses(mesh.faces);
  std::vector<double> area(mesh.faces.size());
  for (std::size_t f = 0; f < area.size(); ++f) area[f] = areaVector(mesh, mesh.faces[f]).norm();
  std::vector<char> drop(mesh.faces.size(), 0);
  forEachEdge(uses, [&](std::size_t begin, std::size_t end) {
    // Largest first; one face may stay for each direction along the edge.
    std::vector<EdgeUse> here;
    for (std::size_t i = begin; i < end; ++i) {
      if (!drop[uses[i].face]) here.push_back(uses[i]);
    }
    std::stable_sort(here.begin(), here.end(), [&](const EdgeUse& a, const EdgeUse& b) {
      return area[a.face] > area[b.face];
    });
    std::array<bool, 2> taken{false, false};
    for (const EdgeUse& use : here) {
      bool& side = taken[use.forward ? 1 : 0];
      if (side) drop[use.face] = 1;
      side = true;
    }
  });
  return dropFaces(mesh, drop);
}

struct Piece {
  std::size_t faces = 0;
  double area = 0.0;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(std::numeric_limits<double>::lowest());
  double diameter() const { return (high - low).norm(); }
  Eigen::Vector3d center() const { return 0.5 * (low + high); }
};

void dropPieces(Mesh& mesh, const CleaningOptions& o, CleaningStatistics& stats) {
  std::size_t count = 0;
  const auto piece_of = facePieces(mesh.faces, count);
  if (count == 0) return;
  std::vector<Piece> pieces(count);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    Piece& piece = pieces[piece_of[f]];
    ++piece.faces;
    piece.area += areaVector(mesh, mesh.faces[f]).norm();
    for (const std::uint32_t v : mesh.faces[f]) {
      piece.low = piece.low.cwiseMin(mesh.vertices.points[v].cast<double>());
      piece.high = piece.high.cwiseMax(mesh.vertices.points[v].cast<double>());
    }
  }
  const auto largest = static_cast<std::size_t>(
      std::max_element(pieces.begin(), pieces.end(),
                       [](const Piece& a, const Piece& b) { return a.area < b.area; }) -
      pieces.begin());
  std::vector<char> drop_piece(count, 0);
  for (std::size_t p = 0; p < count; ++p) {
    if (p == largest) continue;
    const double distance = (pieces[p].center() - pieces[largest].center()).norm();
    const bool drop = o.keep_largest_piece ||
                      pieces[p].faces < static_cast<std::size_t>(o.min_piece_faces) ||
                      pieces[p].diameter() < o.min_piece_diameter * pieces[largest].diameter() ||
                      (o.max_piece_distance_m > 0.0 && distance > o.max_piece_distance_m);
    drop_piece[p] = drop ? 1 : 0;
    stats.pieces += drop ? 1 : 0;
  }
  std::vector<char> drop(mesh.faces.size());
  for (std::size_t f = 0; f < drop.size(); ++f) drop[f] = drop_piece[piece_of[f]];
  stats.piece_faces += dropFaces(mesh, drop);
}

/// Gives every fan of faces around a vertex its own copy of it; the first fan keeps the vertex.
std::size_t splitVertices(Mesh& mesh) {
  // Corners 3f+k of one vertex belong to one fan when their faces share an edge at it.
  DisjointSets corners(3 * mesh.faces.size());
  const auto cornerAt = [&](std::uint32_t face, std::uint32_t vertex) {
    const Face& f = mesh.faces[face];
    return 3 * face + static_cast<std::uint32_t>(std::find(f.begin(), f.end(), vertex) - f.begin());
  };
  const auto uses = sortedEdgeUses(mesh.faces);
  forEachEdge(uses, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin + 1; i < end; ++i) {
      for (const std::uint32_t v : {uses[begin].low, uses[begin].high}) {
        corners.unite(cornerAt(uses[begin].face, v), cornerAt(uses[i].face, v));
      }
    }
  });
  std::vector<std::uint32_t> fan_of_vertex(mesh.vertices.size(), kNone);
  std::vector<std::uint32_t> copy_of_fan(3 * mesh.faces.size(), kNone);
  std::vector<std::size_t> vertices(mesh.vertices.size());
  std::iota(vertices.begin(), vertices.end(), std::size_t{0});
  for (std::uint32_t c = 0; c < 3 * mesh.faces.size(); ++c) {
    std::uint32_t& vertex = mesh.faces[c / 3][c % 3];
    const std::uint32_t fan = corners.find(c);
    if (copy_of_fan[fan] == kNone) {
      if (fan_of_vertex[vertex] == kNone) {
        fan_of_vertex[vertex] = fan;
        copy_of_fan[fan] = vertex;
      } else {
        copy_of_fan[fan] = static_cast<std::uint32_t>(vertices.size());
        vertices.push_back(vertex);
      }
    }
    vertex = copy_of_fan[fan];
  }
  const std::size_t added = vertices.size() - mesh.vertices.size();
  if (added > 0) mesh.vertices = subset(mesh.vertices, vertices);
  return added;
}

std::size_t dropUnreferencedVertices(Mesh& mesh) {
  std::vector<std::uint32_t> renumbered(mesh.vertices.size(), kNone);
  for (const Face& f : mesh.faces) {
    for (const std::uint32_t v : f) renumbered[v] = 0;
  }
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < renumbered.size(); ++i) {
    if (renumbered[i] == kNone) continue;
    renumbered[i] = static_cast<std::uint32_t>(kept.size());
    kept.push_back(i);
  }
  const std::size_t dropped = mesh.vertices.size() - kept.size();
  if (dropped == 0) return 0;
  for (Face& f : mesh.faces) {
    for (std::uint32_t& v : f) v = renumbered[v];
  }
  mesh.vertices = subset(mesh.vertices, kept);
  return dropped;
}

}  // namespace

Mesh clean(Mesh mesh, const CleaningOptions& o, CleaningStatistics* statistics) {
  CleaningStatistics s;
  s.invalid_faces = dropInvalidFaces(mesh);
  if (o.duplicate_vertices) s.duplicate_vertices = mergeDuplicateVertices(mesh);
  if (o.degenerate_faces) s.degenerate_faces = dropDegenerateFaces(mesh);
  if (o.duplicate_faces) s.duplicate_faces = dropDuplicateFaces(mesh);
  if (o.remove_color) dropColor(mesh, o, s);
  if (o.non_manifold_faces) s.non_manifold_faces = dropNonManifoldFaces(mesh);
  if (o.min_piece_faces > 0 || o.min_piece_diameter > 0.0 || o.max_piece_distance_m > 0.0 ||
      o.keep_largest_piece) {
    dropPieces(mesh, o, s);
  }
  if (o.non_manifold_vertices) s.split_vertices = splitVertices(mesh);
  if (o.unreferenced_vertices) s.unreferenced_vertices = dropUnreferencedVertices(mesh);
  if (statistics != nullptr) *statistics = s;
  return mesh;
}

}  // namespace scanner::surface
