#include "scanner/surface/ball_pivot.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "scanner/core/parallel.h"
#include "surface/ball_front.h"
#include "surface/knn.h"
#include "surface/point_grid.h"

namespace scanner::surface {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;
// Points that lie on the ball within this share of the radius neither block it nor lie behind it:
// four points of a regular grid lie on one circle.
constexpr double kTouch = 1e-6;
constexpr double kAngleEpsilon = 1e-4;
constexpr double kTieAngle = 1e-6;
constexpr std::size_t kSeedNeighbors = 20;

using Vertex = std::uint32_t;

class BallPivoting {
 public:
  BallPivoting(const PointCloud& cloud, double cos_cutoff, int threads)
      : cloud_(cloud), cos_cutoff_(cos_cutoff), threads_(threads), front_(cloud.size()) {
    // Coordinates about a point of the cloud: squares of distances keep their digits.
    points_.reserve(cloud.size());
    const Eigen::Vector3d middle = cloud.points[0].cast<double>();
    for (const auto& p : cloud.points) points_.push_back(p.cast<double>() - middle);
  }

  void roll(double radius, BallPivotStatistics& stats) {
    startRadius(radius);
    const std::size_t before = front_.faces().size();
    for (std::size_t e = 0; e < front_.edges().size(); ++e) reopenIfBallFits(e);
    expand();
    for (Vertex v = 0; v < points_.size(); ++v) {
      if (!front_.isOrphan(v) || ignored_[v] || !seedAt(v)) continue;
      ++stats.seeds;
      expand();
    }
    stats.radii_m.push_back(radius);
    stats.faces.push_back(front_.faces().size() - before);
  }

  const std::vector<std::array<std::uint32_t, 3>>& faces() const { return front_.faces(); }

 private:
  struct Ball {
    Eigen::Vector3d center;
    Eigen::Vector3d normal;  ///< of the face
  };
  struct Hit {
    Vertex vertex;
    double angle;
    Ball ball;
  };

  Eigen::Vector3d normalOf(Vertex v) const { return cloud_.normals[v].cast<double>(); }

  void startRadius(double radius) {
    radius_ = radius;
    grid_ = std::make_unique<PointGrid>(cloud_.points, 2.0 * radius);
    const bool first = ignored_.empty();
    if (first) findDuplicates();
    neighbors_.assign(points_.size(), {});
    // The first ball visits nearly every point, later ones only the rim: those look up on demand.
    if (!first) return;
    parallelFor(points_.size(), 4096, threads_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) fillNeighbors(grid_->order()[k]);
    });
  }

  /// Of points at one place that face the same way only the first takes part.
  void findDuplicates() {
    ignored_.assign(points_.size(), 0);
    parallelFor(points_.size(), 4096, threads_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        const std::size_t i = grid_->order()[k];
        grid_->forEachWithin(cloud_.points[i], 0.0, [&](std::size_t j, float) {
          if (j < i && cloud_.normals[j].dot(cloud_.normals[i]) > 0.0F) ignored_[i] = 1;
        });
      }
    });
  }

  void fillNeighbors(std::size_t v) {
    auto& list = neighbors_[v];
    grid_->forEachWithin(cloud_.points[v], 2.0 * radius_, [&](std::size_t j, float) {
      if (j != v && !ignored_[j]) list.push_back(static_cast<Vertex>(j));
    });
  }

  /// Every point that a ball touching v can touch or hold.
  const std::vector<Vertex>& neighborsOf(Vertex v) {
    if (neighbors_[v].empty()) fillNeighbors(v);
    return neighbors_[v];
  }

  /// Ball resting on the outer side of (a, b, c), when their circle is small enough and their
  /// normals agree with the face.
  bool restOn(Vertex a, Vertex b, Vertex c, Ball& ball) const {
    const Eigen::Vector3d ab = points_[b] - points_[a];
    const Eigen::Vector3d ac = points_[c] - points_[a];
    const Eigen::Vector3d n = ab.cross(ac);
    const double n2 = n.squaredNorm();
    if (!(n2 > 1e-12 * ab.squaredNorm() * ac.squaredNorm())) return false;
    const Eigen::Vector3d to_circumcenter =
        (n.cross(ab) * ac.squaredNorm() + ac.cross(n) * ab.squaredNorm()) / (2.0 * n2);
    const double h2 = radius_ * radius_ - to_circumcenter.squaredNorm();
    if (h2 < 0.0) return false;
    ball.normal = n / std::sqrt(n2);
    for (const Vertex v : {a, b, c}) {
      if (ball.normal.dot(normalOf(v)) < cos_cutoff_) return false;
    }
    ball.center = points_[a] + to_circumcenter + std::sqrt(h2) * ball.normal;
    return true;
  }

  /// Nothing but points facing the other way lies in the ball resting on (a, b, c).
  bool isEmpty(const Ball& ball, Vertex a, Vertex b, Vertex c) {
    const double limit = std::pow(radius_ * (1.0 - kTouch), 2);
    for (const Vertex v : neighborsOf(a)) {
      if ((points_[v] - ball.center).squaredNorm() >= limit || v == b || v == c) continue;
      if (normalOf(v).dot(ball.normal) > 0.0) return false;
    }
    return true;
  }

  void reopenIfBallFits(std::size_t e) {
    const BallFront::Edge& edge = front_.edges()[e];
    if (edge.state != BallFront::State::kBoundary) return;
    Ball ball;
    if (restOn(edge.from, edge.to, edge.opposite, ball) &&
        isEmpty(ball, edge.from, edge.to, edge.opposite)) {
      front_.reopen(static_cast<std::uint32_t>(e), ball.center);
    }
  }

  /// The face (to, from, v) beyond an edge may be added without a third face at any edge.
  bool joins(const BallFront::Edge& edge, Vertex v) const {
    return front_.isOpen(v) && front_.accepts(edge.from, v) && front_.accepts(v, edge.to);
  }

  /// Rolls the ball over the edge. The points touched first, several when they lie on one circle.
  void pivot(const BallFront::Edge& edge, std::vector<Hit>& hits) {
    hits.clear();
    const Eigen::Vector3d middle = 0.5 * (points_[edge.from] + points_[edge.to]);
    const Eigen::Vector3d axis = (points_[edge.to] - points_[edge.from]).normalized();
    const Eigen::Vector3d start = edge.center - middle;
    const double reach2 = std::pow(radius_ + start.norm(), 2);
    for (const Vertex v : neighborsOf(edge.from)) {
      if (v == edge.to || v == edge.opposite) continue;
      if ((points_[v] - middle).squaredNorm() > reach2) continue;
      Hit hit{v, 0.0, {}};
      if (!restOn(edge.to, edge.from, v, hit.ball)) continue;
      const Eigen::Vector3d now = hit.ball.center - middle;
      hit.angle = std::atan2(axis.dot(start.cross(now)), start.dot(now));
      if (hit.angle < -kAngleEpsilon) hit.angle += kTwoPi;
      if (!hits.empty() && hit.angle > hits.front().angle + kTieAngle) continue;
      if (!hits.empty() && hit.angle < hits.front().angle - kTieAngle) hits.clear();
      hits.push_back(hit);
    }
  }

  void expand() {
    std::uint32_t e = 0;
    std::vector<Hit> hits;
    while (front_.next(e)) {
      const BallFront::Edge edge = front_.edges()[e];
      pivot(edge, hits);
      // Of points touched together prefer those that close existing edges.
      const auto closed = [&](const Hit& h) {
        return (front_.exists(edge.from, h.vertex) ? 1 : 0) +
               (front_.exists(h.vertex, edge.to) ? 1 : 0);
      };
      std::stable_sort(hits.begin(), hits.end(),
                       [&](const Hit& a, const Hit& b) { return closed(a) > closed(b); });
      const auto found = std::find_if(hits.begin(), hits.end(), [&](const Hit& h) {
        return joins(edge, h.vertex) && isEmpty(h.ball, edge.from, edge.to, h.vertex);
      });
      if (found == hits.end()) {
        front_.markBoundary(e);
      } else {
        front_.addFace(edge.to, edge.from, found->vertex, found->ball.center);
      }
    }
  }

  /// Starts a new piece at an orphan with two orphans near it.
  bool seedAt(Vertex v) {
    std::vector<std::pair<double, Vertex>> near;
    for (const Vertex u : neighborsOf(v)) {
      if (front_.isOrphan(u)) near.emplace_back((points_[u] - points_[v]).squaredNorm(), u);
    }
    const std::size_t n = std::min(kSeedNeighbors, near.size());
    std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(n), near.end());
    for (std::size_t j = 1; j < n; ++j) {
      for (std::size_t i = 0; i < j; ++i) {
        for (const bool flip : {false, true}) {
          const Vertex b = near[flip ? j : i].second;
          const Vertex c = near[flip ? i : j].second;
          Ball ball;
          if (!restOn(v, b, c, ball) || !isEmpty(ball, v, b, c)) continue;
          front_.addFace(v, b, c, ball.center);
          return true;
        }
      }
    }
    return false;
  }

  const PointCloud& cloud_;
  double cos_cutoff_;
  int threads_;
  double radius_ = 0.0;
  std::vector<Eigen::Vector3d> points_;
  std::vector<char> ignored_;
  std::unique_ptr<PointGrid> grid_;
  std::vector<std::vector<Vertex>> neighbors_;
  BallFront front_;
};

Status checkCloud(const PointCloud& cloud) {
  if (cloud.size() < 3) {
    return {StatusCode::kNotEnoughData,
            "ballPivot: " + std::to_string(cloud.size()) + " points, at least 3 are needed"};
  }
  if (!cloud.hasNormals()) {
    return {StatusCode::kInvalidInput, "ballPivot: the cloud has no normals"};
  }
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!cloud.points[i].allFinite() || !cloud.normals[i].allFinite()) {
      return {StatusCode::kInvalidInput,
              "ballPivot: position or normal of point " + std::to_string(i) + " is not finite"};
    }
  }
  return Status::ok();
}

bool inOnePlace(const PointCloud& cloud) {
  return std::all_of(cloud.points.begin(), cloud.points.end(),
                     [&](const Eigen::Vector3f& p) { return p == cloud.points.front(); });
}

}  // namespace

double meanSpacing(const PointCloud& cloud) {
  constexpr std::size_t kSamples = 20000;
  constexpr std::size_t kNeighbors = 7;  // the point itself is the first
  if (cloud.size() < 2) return 0.0;
  const KdTree tree(cloud.points);
  const std::size_t step = std::max<std::size_t>(1, cloud.size() / kSamples);
  std::vector<double> means;
  std::vector<std::size_t> indices;
  std::vector<float> d2;
  for (std::size_t i = 0; i < cloud.size(); i += step) {
    tree.nearest(cloud.points[i], kNeighbors, indices, d2);
    double sum = 0.0;
    int apart = 0;
    for (const float d : d2) {
      sum += std::sqrt(double{d});
      apart += d > 0.0F ? 1 : 0;
    }
    if (apart > 0) means.push_back(sum / apart);
  }
  if (means.empty()) return 0.0;
  const auto middle = means.begin() + static_cast<std::ptrdiff_t>(means.size() / 2);
  std::nth_element(means.begin(), middle, means.end());
  return *middle;
}

Result<Mesh> ballPivotWithRadii(const PointCloud& cloud, const std::vector<double>& radii_m,
                                const BallPivotOptions& options, int threads,
                                BallPivotStatistics* statistics) {
  bool usable = !radii_m.empty();
  double least = 0.0;
  for (const double radius : radii_m) {
    usable = usable && std::isfinite(radius) && radius > least;
    least = radius;
  }
  if (!usable) {
    throw ConfigurationError("ballPivot: radii must be positive, finite and ascending");
  }
  Status status = checkCloud(cloud);
  if (!status) return status;
  if (inOnePlace(cloud)) {
    return Status(StatusCode::kInvalidInput, "ballPivot: all points are in one place");
  }
  BallPivotStatistics stats;
  stats.spacing_m = statistics != nullptr ? meanSpacing(cloud) : 0.0;
  BallPivoting pivoting(cloud, std::cos(options.normal_cutoff_deg * kTwoPi / 360.0), threads);
  for (const double radius : radii_m) pivoting.roll(radius, stats);
  if (statistics != nullptr) *statistics = stats;
  if (pivoting.faces().empty()) {
    return Status(StatusCode::kNotEnoughData,
                  "ballPivot: no three of " + std::to_string(cloud.size()) +
                      " points hold a ball of radius " + std::to_string(radii_m.back()) +
                      " m with normals that agree");
  }
  Mesh mesh;
  mesh.vertices = cloud;
  mesh.faces = pivoting.faces();
  return mesh;
}

Result<Mesh> ballPivot(const PointCloud& cloud, const BallPivotOptions& options, int threads,
                       BallPivotStatistics* statistics) {
  Status status = checkCloud(cloud);
  if (!status) return status;
  double radius = options.radius_m;
  if (radius <= 0.0) radius = options.radius_factor * meanSpacing(cloud);
  if (radius <= 0.0) {
    return Status(StatusCode::kInvalidInput, "ballPivot: all points are in one place");
  }
  std::vector<double> radii_m;
  radii_m.reserve(static_cast<std::size_t>(options.radius_count));
  for (int i = 0; i < options.radius_count; ++i) {
    radii_m.push_back(radius * std::pow(options.radius_growth, i));
  }
  return ballPivotWithRadii(cloud, radii_m, options, threads, statistics);
}

}  // namespace scanner::surface
