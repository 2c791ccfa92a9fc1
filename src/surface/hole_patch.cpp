#include "surface/hole_patch.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>

namespace scanner::surface {
namespace {

using EdgeKey = std::pair<std::uint32_t, std::uint32_t>;

EdgeKey keyOf(std::uint32_t a, std::uint32_t b) { return {std::min(a, b), std::max(a, b)}; }

/// Cost of a triangulation: worst turn between neighbouring faces first, then area.
struct Cost {
  double worst_turn = 0.0;  ///< 1 - cos of the dihedral turn, 0 flat, 2 folded back
  double area = 0.0;
  bool operator<(const Cost& o) const {
    // Turns closer than this are alike: area decides, else rounding would.
    if (std::abs(worst_turn - o.worst_turn) > 1e-9) return worst_turn < o.worst_turn;
    return area < o.area;
  }
};

constexpr double kForbidden = 1e30;

class RimTriangulation {
 public:
  RimTriangulation(const Mesh& mesh, const HoleRim& rim, const EdgeExists& exists)
      : rim_(rim), n_(rim.vertices.size()), exists_(exists), cost_(n_ * n_), split_(n_ * n_, 0) {
    for (const std::uint32_t v : rim.vertices) {
      points_.push_back(mesh.vertices.points[v].cast<double>());
    }
  }

  std::vector<Face> solve() {
    for (std::size_t span = 2; span < n_; ++span) {
      for (std::size_t i = 0; i + span < n_; ++i) solveSpan(i, i + span);
    }
    std::vector<Face> faces;
    if (at(0, n_ - 1).area < kForbidden) collect(0, n_ - 1, faces);
    return faces;
  }

 private:
  Cost& at(std::size_t i, std::size_t j) { return cost_[i * n_ + j]; }

  Eigen::Vector3d areaVectorOf(std::size_t i, std::size_t k, std::size_t j) const {
    return 0.5 * (points_[k] - points_[i]).cross(points_[j] - points_[i]);
  }

  /// Normal of the face beyond the side i -> j of a triangle above it.
  Eigen::Vector3d normalBeyond(std::size_t i, std::size_t j) const {
    if (j == i + 1) return rim_.outer_normals[i];
    return areaVectorOf(i, split_[i * n_ + j], j).normalized();
  }

  void solveSpan(std::size_t i, std::size_t j) {
    Cost best{kForbidden, kForbidden};
    const bool closing = i == 0 && j == n_ - 1;  // this side is the last edge of the rim
    if (closing || !exists_(rim_.vertices[i], rim_.vertices[j])) {
      for (std::size_t k = i + 1; k < j; ++k) {
        const Eigen::Vector3d area = areaVectorOf(i, k, j);
        Cost c;
        c.area = area.norm() + at(i, k).area + at(k, j).area;
        if (c.area >= kForbidden) continue;
        const Eigen::Vector3d normal = area.normalized();
        c.worst_turn =
            std::max({at(i, k).worst_turn, at(k, j).worst_turn,
                      1.0 - normal.dot(normalBeyond(i, k)), 1.0 - normal.dot(normalBeyond(k, j))});
        if (closing) {
          c.worst_turn = std::max(c.worst_turn, 1.0 - normal.dot(rim_.outer_normals[j]));
        }
        if (c < best) {
          best = c;
          split_[i * n_ + j] = k;
        }
      }
    }
    at(i, j) = best;
  }

  void collect(std::size_t i, std::size_t j, std::vector<Face>& faces) const {
    if (j == i + 1) return;
    const std::size_t k = split_[i * n_ + j];
    faces.push_back({rim_.vertices[i], rim_.vertices[k], rim_.vertices[j]});
    collect(i, k, faces);
    collect(k, j, faces);
  }

  const HoleRim& rim_;
  std::size_t n_;
  const EdgeExists& exists_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Cost> cost_;
  std::vector<std::size_t> split_;
};

/// Position, normal, colour, sigma and wanted edge length of the vertices of a patch.
using Attributes = Eigen::Matrix<double, 11, 1>;

class PatchRefinement {
 public:
  PatchRefinement(Mesh& mesh, const HoleRim& rim, const EdgeExists& exists,
                  std::vector<Face>& patch)
      : mesh_(mesh),
        rim_(rim),
        exists_(exists),
        patch_(patch),
        first_new_(static_cast<std::uint32_t>(mesh.vertices.size())) {
    const std::size_t n = rim.vertices.size();
    for (std::size_t i = 0; i < n; ++i) {
      const auto length = [&](std::size_t a, std::size_t b) {
        return (mesh.vertices.points[rim.vertices[a]] - mesh.vertices.points[rim.vertices[b]])
            .cast<double>()
            .norm();
      };
      attributes_[rim.vertices[i]] =
          read(rim.vertices[i], 0.5 * (length(i, (i + 1) % n) + length((i + n - 1) % n, i)));
    }
  }

  void run() {
    constexpr int kRounds = 12;
    relaxEdges();
    for (int round = 0; round < kRounds && splitFaces(); ++round) relaxEdges();
    relaxVertices();
    for (std::uint32_t v = first_new_; v < next(); ++v) append(attributes_.at(v));
  }

 private:
  std::uint32_t next() const {
    return first_new_ + static_cast<std::uint32_t>(attributes_.size() - rim_.vertices.size());
  }
  Eigen::Vector3d position(std::uint32_t v) const { return attributes_.at(v).head<3>(); }

  Attributes read(std::uint32_t v, double edge_length) const {
    Attributes a = Attributes::Zero();
    a.head<3>() = mesh_.vertices.points[v].cast<double>();
    if (mesh_.vertices.hasNormals()) a.segment<3>(3) = mesh_.vertices.normals[v].cast<double>();
    if (mesh_.vertices.hasColors()) {
      const Rgb8 c = mesh_.vertices.colors[v];
      a.segment<3>(6) = Eigen::Vector3d(c.r, c.g, c.b);
    }
    if (mesh_.vertices.hasSigmas()) a[9] = double{mesh_.vertices.sigmas[v]};
    a[10] = edge_length;
    return a;
  }

  void append(const Attributes& a) {
    // Attributes are asked for before the point makes their vectors "too short".
    const bool normals = mesh_.vertices.hasNormals();
    const bool colors = mesh_.vertices.hasColors();
    const bool sigmas = mesh_.vertices.hasSigmas();
    mesh_.vertices.points.push_back(a.head<3>().cast<float>());
    if (normals) mesh_.vertices.normals.push_back(a.segment<3>(3).normalized().cast<float>());
    if (colors) {
      const auto channel = [](double value) {
        return static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L));
      };
      mesh_.vertices.colors.push_back({channel(a[6]), channel(a[7]), channel(a[8])});
    }
    if (sigmas) mesh_.vertices.sigmas.push_back(static_cast<float>(a[9]));
  }

  bool splitFaces() {
    bool any = false;
    const std::size_t count = patch_.size();
    for (std::size_t f = 0; f < count; ++f) {
      const Face face = patch_[f];
      Attributes center = Attributes::Zero();
      for (const std::uint32_t v : face) center += attributes_.at(v) / 3.0;
      const bool large = std::all_of(face.begin(), face.end(), [&](std::uint32_t v) {
        const double reach = std::sqrt(2.0) * (center.head<3>() - position(v)).norm();
        return reach > center[10] && reach > attributes_.at(v)[10];
      });
      if (!large) continue;
      const std::uint32_t v = next();
      attributes_[v] = center;
      patch_[f] = {face[0], face[1], v};
      patch_.push_back({face[1], face[2], v});
      patch_.push_back({face[2], face[0], v});
      any = true;
    }
    return any;
  }

  static double cosAt(const Eigen::Vector3d& apex, const Eigen::Vector3d& a,
                      const Eigen::Vector3d& b) {
    return (a - apex).normalized().dot((b - apex).normalized());
  }

  /// Flips inner edges whose opposite angles sum to more than 180 degrees.
  void relaxEdges() {
    constexpr int kPasses = 8;
    for (int pass = 0; pass < kPasses; ++pass) {
      std::map<EdgeKey, std::vector<std::size_t>> faces_of;
      for (std::size_t f = 0; f < patch_.size(); ++f) {
        for (std::size_t k = 0; k < 3; ++k) {
          faces_of[keyOf(patch_[f][k], patch_[f][(k + 1) % 3])].push_back(f);
        }
      }
      std::vector<char> touched(patch_.size(), 0);
      bool flipped = false;
      for (const auto& [key, faces] : faces_of) {
        if (faces.size() != 2 || touched[faces[0]] || touched[faces[1]]) continue;
        if (!flip(key, faces[0], faces[1], faces_of)) continue;
        touched[faces[0]] = touched[faces[1]] = 1;
        flipped = true;
      }
      if (!flipped) return;
    }
  }

  template <typename Edges>
  bool flip(const EdgeKey& key, std::size_t f, std::size_t g, const Edges& edges) {
    // In face f the edge runs u -> v.
    std::size_t k = 0;
    while (keyOf(patch_[f][k], patch_[f][(k + 1) % 3]) != key) ++k;
    const std::uint32_t u = patch_[f][k];
    const std::uint32_t v = patch_[f][(k + 1) % 3];
    const std::uint32_t a = patch_[f][(k + 2) % 3];
    const auto other = std::find_if(patch_[g].begin(), patch_[g].end(),
                                    [&](std::uint32_t w) { return w != u && w != v; });
    const std::uint32_t b = *other;
    if (a == b || edges.count(keyOf(a, b)) > 0 || added_.count(keyOf(a, b)) > 0) return false;
    if (a < first_new_ && b < first_new_ && exists_(a, b)) return false;
    const Eigen::Vector3d pu = position(u), pv = position(v), pa = position(a), pb = position(b);
    const double sum = std::acos(std::clamp(cosAt(pa, pu, pv), -1.0, 1.0)) +
                       std::acos(std::clamp(cosAt(pb, pu, pv), -1.0, 1.0));
    if (sum <= 3.14159265358979323846 + 1e-6) return false;
    // Neither new face may fold back on the old ones.
    const Eigen::Vector3d old_normal = (pv - pu).cross(pa - pu) + (pu - pv).cross(pb - pv);
    const Eigen::Vector3d n1 = (pv - pb).cross(pa - pb);
    const Eigen::Vector3d n2 = (pb - pu).cross(pa - pu);
    if (n1.dot(old_normal) <= 0.0 || n2.dot(old_normal) <= 0.0) return false;
    patch_[f] = {b, v, a};
    patch_[g] = {u, b, a};
    added_.insert(keyOf(a, b));
    return true;
  }

  /// Inner vertices and their attributes go to the mean of their neighbours until they rest.
  void relaxVertices() {
    std::map<std::uint32_t, std::vector<std::uint32_t>> neighbors;
    for (const Face& f : patch_) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (f[k] >= first_new_) neighbors[f[k]].push_back(f[(k + 1) % 3]);
      }
    }
    constexpr int kRounds = 200;
    for (int round = 0; round < kRounds; ++round) {
      double moved = 0.0;
      for (const auto& [v, around] : neighbors) {
        Attributes mean = Attributes::Zero();
        for (const std::uint32_t u : around) mean += attributes_.at(u);
        mean /= static_cast<double>(around.size());
        Attributes& own = attributes_.at(v);
        moved = std::max(moved, (mean - own).head<3>().norm() / std::max(1e-12, own[10]));
        own = mean;
      }
      if (moved < 1e-4) return;
    }
  }

  Mesh& mesh_;
  const HoleRim& rim_;
  const EdgeExists& exists_;
  std::vector<Face>& patch_;
  std::uint32_t first_new_;
  std::map<std::uint32_t, Attributes> attributes_;
  std::set<EdgeKey> added_;  ///< edges made by flips; not flipped back to
};

}  // namespace

std::vector<Face> triangulateRim(const Mesh& mesh, const HoleRim& rim, const EdgeExists& exists) {
  return RimTriangulation(mesh, rim, exists).solve();
}

void refinePatch(Mesh& mesh, const HoleRim& rim, const EdgeExists& exists,
                 std::vector<Face>& patch) {
  PatchRefinement(mesh, rim, exists, patch).run();
}

}  // namespace scanner::surface
