#include "scanner/surface/holes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <limits>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "surface/hole_patch.h"
#include "surface/mesh_edges.h"

namespace scanner::surface {
namespace {

constexpr std::uint32_t kBoundary = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint32_t kBroken = kBoundary - 1;  ///< non-manifold, or two faces the same way round

/// For every side 3f+k (face f, from corner k to the next) the side across its edge.
std::vector<std::uint32_t> oppositeSides(const std::vector<Face>& faces,
                                         const std::vector<EdgeUse>& uses) {
  std::vector<std::uint32_t> opposite(3 * faces.size(), kBroken);
  const auto sideOf = [&](const EdgeUse& use) {
    const Face& f = faces[use.face];
    return 3 * use.face +
           static_cast<std::uint32_t>(std::find(f.begin(), f.end(), use.from()) - f.begin());
  };
  forEachEdge(uses, [&](std::size_t begin, std::size_t end) {
    if (end - begin == 1) {
      opposite[sideOf(uses[begin])] = kBoundary;
    } else if (end - begin == 2 && uses[begin].forward != uses[begin + 1].forward) {
      opposite[sideOf(uses[begin])] = sideOf(uses[begin + 1]);
      opposite[sideOf(uses[begin + 1])] = sideOf(uses[begin]);
    }
  });
  return opposite;
}

std::uint32_t nextSide(std::uint32_t side) { return side - side % 3 + (side % 3 + 1) % 3; }

/// Sides of the boundary loop that `start` belongs to; empty when it runs into a broken edge.
std::vector<std::uint32_t> walkLoop(std::uint32_t start,
                                    const std::vector<std::uint32_t>& opposite) {
  std::vector<std::uint32_t> loop;
  std::uint32_t side = start;
  do {
    loop.push_back(side);
    // Turn about the end of this side, face by face, until the next open side.
    side = nextSide(side);
    while (opposite[side] != kBoundary) {
      if (opposite[side] == kBroken) return {};
      side = nextSide(opposite[side]);
    }
  } while (side != start && loop.size() <= opposite.size());
  return loop;
}

struct Loop {
  HoleRim rim;
  double diameter = 0.0;
  bool simple = true;  ///< no vertex twice, and more than one face around it
  bool outer = false;  ///< the outline of an open sheet rather than a hole in it
};

Loop describeLoop(const Mesh& mesh, const std::vector<std::uint32_t>& sides) {
  Loop loop;
  const std::size_t n = sides.size();
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
  Eigen::Vector3f high = -low;
  Eigen::Vector3d faces_around = Eigen::Vector3d::Zero();
  Eigen::Vector3d patch_area = Eigen::Vector3d::Zero();
  std::set<std::uint32_t> faces;
  // The patch runs the other way along every side, so the rim is walked backwards.
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t side = sides[n - 1 - i];
    const Face& face = mesh.faces[side / 3];
    const std::uint32_t from = face[(side % 3 + 1) % 3];
    const std::uint32_t to = face[side % 3];
    loop.rim.vertices.push_back(from);
    loop.rim.outer_normals.push_back(areaVector(mesh, face).normalized());
    const Eigen::Vector3f& p = mesh.vertices.points[from];
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    const Eigen::Vector3d origin = mesh.vertices.points[mesh.faces[sides[0] / 3][0]].cast<double>();
    patch_area +=
        0.5 * (p.cast<double>() - origin).cross(mesh.vertices.points[to].cast<double>() - origin);
    faces_around +=
        loop.rim.outer_normals.back() * (mesh.vertices.points[to] - p).cast<double>().norm();
    faces.insert(side / 3);
  }
  loop.diameter = double{(high - low).norm()};
  std::vector<std::uint32_t> sorted = loop.rim.vertices;
  std::sort(sorted.begin(), sorted.end());
  loop.simple =
      faces.size() > 1 && std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end();
  loop.outer = patch_area.dot(faces_around) < -0.5 * patch_area.norm() * faces_around.norm();
  return loop;
}

double meanEdge(const Mesh& mesh, const std::vector<EdgeUse>& uses) {
  double sum = 0.0;
  std::size_t count = 0;
  forEachEdge(uses, [&](std::size_t begin, std::size_t) {
    sum += (mesh.vertices.points[uses[begin].low] - mesh.vertices.points[uses[begin].high])
               .cast<double>()
               .norm();
    ++count;
  });
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

using EdgeSet = std::set<std::pair<std::uint32_t, std::uint32_t>>;

/// Closes one loop and notes the new edges.
void fill(Mesh& mesh, const Loop& loop, const EdgeExists& exists, EdgeSet& added,
          HoleStatistics& s) {
  std::vector<Face> patch;
  if (loop.simple) patch = triangulateRim(mesh, loop.rim, exists);
  if (patch.empty()) {
    ++s.failed;
    return;
  }
  const std::size_t before = mesh.vertices.size();
  refinePatch(mesh, loop.rim, exists, patch);
  for (const Face& f : patch) {
    for (std::size_t k = 0; k < 3; ++k) added.insert(std::minmax(f[k], f[(k + 1) % 3]));
  }
  mesh.faces.insert(mesh.faces.end(), patch.begin(), patch.end());
  ++s.filled;
  s.faces_added += patch.size();
  s.vertices_added += mesh.vertices.size() - before;
}

}  // namespace

Mesh fillHoles(Mesh mesh, const HoleOptions& options, HoleStatistics* statistics) {
  HoleStatistics s;
  const auto uses = sortedEdgeUses(mesh.faces);
  const auto opposite = oppositeSides(mesh.faces, uses);
  const double widest =
      options.max_diameter_m > 0.0 ? options.max_diameter_m : 20.0 * meanEdge(mesh, uses);
  EdgeSet added;
  const EdgeExists exists = [&](std::uint32_t a, std::uint32_t b) {
    const std::pair<std::uint32_t, std::uint32_t> key{std::min(a, b), std::max(a, b)};
    const auto at =
        std::lower_bound(uses.begin(), uses.end(), key, [](const EdgeUse& use, const auto& k) {
          return std::tie(use.low, use.high) < std::tie(k.first, k.second);
        });
    return (at != uses.end() && at->low == key.first && at->high == key.second) ||
           added.count(key) > 0;
  };
  std::vector<char> visited(opposite.size(), 0);
  for (std::uint32_t side = 0; side < visited.size(); ++side) {
    if (opposite[side] != kBoundary || visited[side]) continue;
    const auto sides = walkLoop(side, opposite);
    visited[side] = 1;
    for (const std::uint32_t i : sides) visited[i] = 1;
    ++s.loops;
    if (sides.empty()) {
      ++s.failed;
      continue;
    }
    const Loop loop = describeLoop(mesh, sides);
    if (loop.outer) {
      ++s.outer_rims;
    } else if (sides.size() > static_cast<std::size_t>(options.max_edges) ||
               loop.diameter > widest) {
      ++s.too_large;
    } else {
      fill(mesh, loop, exists, added, s);
    }
  }
  if (statistics != nullptr) *statistics = s;
  return mesh;
}

}  // namespace scanner::surface
