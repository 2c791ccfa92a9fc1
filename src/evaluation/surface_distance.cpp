#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "evaluation/pseudonormals.h"
#include "scanner/evaluation/deviation.h"

namespace scanner::evaluation {
namespace {

struct ReleaseDevice {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};

void requireUsable(const Mesh& mesh) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices.points[i].allFinite()) {
      throw ConfigurationError("reference: vertex " + std::to_string(i) + " is not finite");
    }
  }
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (const std::uint32_t corner : mesh.faces[f]) {
      if (corner >= mesh.vertices.size()) {
        throw ConfigurationError("reference: face " + std::to_string(f) + " names vertex " +
                                 std::to_string(corner) + " of " +
                                 std::to_string(mesh.vertices.size()));
      }
    }
  }
  if (mesh.faces.empty()) throw ConfigurationError("reference: the mesh has no faces");
}

/// For every vertex the lowest one at the same place.
std::vector<std::uint32_t> weldedIndices(const std::vector<Eigen::Vector3f>& points) {
  const auto key = [&](std::uint32_t i) {
    return std::make_tuple(points[i].x(), points[i].y(), points[i].z());
  };
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return key(a) != key(b) ? key(a) < key(b) : a < b;
  });
  std::vector<std::uint32_t> welded(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && key(order[i]) == key(order[i - 1]);
    welded[order[i]] = same ? welded[order[i - 1]] : order[i];
  }
  return welded;
}

}  // namespace

/// Coordinates are relative to `center`: Embree computes in float, and so do its boxes.
struct SurfaceDistance::Impl {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 0.0;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;      ///< those with an area
  std::vector<std::uint32_t> original;  ///< their numbers in the mesh
  Pseudonormals normals;
  std::unique_ptr<RTCDeviceTy, ReleaseDevice> device;
  std::unique_ptr<RTCSceneTy, ReleaseScene> scene;

  void takeMesh(const Mesh& mesh);
  void buildScene();

  /// Of a query: what has been found so far.
  struct Search {
    const Impl* impl;
    Eigen::Vector3d point;
    double slack_m;
    double squared_m = std::numeric_limits<double>::infinity();
    TrianglePoint at{};
    std::uint32_t triangle = 0;
  };
  static bool visit(RTCPointQueryFunctionArguments* arguments);
  Search search(const Eigen::Vector3d& centered, double within_m) const;
  static float reach(double distance_m, double slack_m);
};

void SurfaceDistance::Impl::takeMesh(const Mesh& mesh) {
  Eigen::Vector3d low = mesh.vertices.points.front().cast<double>(), high = low;
  for (const auto& p : mesh.vertices.points) {
    low = low.cwiseMin(p.cast<double>());
    high = high.cwiseMax(p.cast<double>());
  }
  center = 0.5 * (low + high);
  radius = 0.5 * (high - low).norm();
  vertices.reserve(mesh.vertices.size());
  for (const auto& p : mesh.vertices.points) vertices.emplace_back(p.cast<double>() - center);
  const std::vector<std::uint32_t> welded = weldedIndices(mesh.vertices.points);
  for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& face = mesh.faces[f];
    const Triangle t{welded[face[0]], welded[face[1]], welded[face[2]]};
    const Eigen::Vector3d& a = vertices[t[0]];
    if (!((vertices[t[1]] - a).cross(vertices[t[2]] - a).squaredNorm() > 0.0)) continue;
    triangles.push_back(t);
    original.push_back(f);
  }
  if (triangles.empty()) throw ConfigurationError("reference: no face of the mesh has an area");
  normals = Pseudonormals(vertices, triangles);
}

void SurfaceDistance::Impl::buildScene() {
  device.reset(rtcNewDevice(nullptr));
  if (!device) throw ConfigurationError("Embree: cannot make a device");
  scene.reset(rtcNewScene(device.get()));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  const RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* v = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertices.size()));
  auto* t = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(Triangle), triangles.size()));
  if (v != nullptr && t != nullptr) {
    for (const Eigen::Vector3d& p : vertices) {
      for (int i = 0; i < 3; ++i) *v++ = static_cast<float>(p[i]);
    }
    for (const Triangle& triangle : triangles) t = std::copy(triangle.begin(), triangle.end(), t);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene.get(), geometry);
    rtcCommitScene(scene.get());
  }
  rtcReleaseGeometry(geometry);
  if (rtcGetDeviceError(device.get()) != RTC_ERROR_NONE) {
    throw ConfigurationError("Embree: cannot build a tree of " + std::to_string(triangles.size()) +
                             " faces");
  }
}

/// Radius for Embree that surely contains everything at `distance_m`, rounding of coordinates and
/// boxes to float included. Equally near triangles are all visited, so that the tree's shape does
/// not decide between them.
float SurfaceDistance::Impl::reach(double distance_m, double slack_m) {
  return static_cast<float>(distance_m * (1.0 + 1e-5) + slack_m);
}

bool SurfaceDistance::Impl::visit(RTCPointQueryFunctionArguments* arguments) {
  auto& search = *static_cast<Search*>(arguments->userPtr);
  const Triangle& t = search.impl->triangles[arguments->primID];
  const auto& v = search.impl->vertices;
  const TrianglePoint at = nearestOnTriangle(search.point, v[t[0]], v[t[1]], v[t[2]]);
  const double squared_m = (search.point - at.point).squaredNorm();
  if (squared_m > search.squared_m ||
      (squared_m == search.squared_m && arguments->primID > search.triangle)) {
    return false;
  }
  search.squared_m = squared_m;
  search.at = at;
  search.triangle = arguments->primID;
  const float radius = reach(std::sqrt(squared_m), search.slack_m);
  if (!(radius < arguments->query->radius)) return false;
  arguments->query->radius = radius;
  return true;
}

SurfaceDistance::Impl::Search SurfaceDistance::Impl::search(const Eigen::Vector3d& centered,
                                                            double within_m) const {
  Search search{this, centered, 1e-6 * (radius + centered.norm())};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  RTCPointQuery query{};
  query.x = static_cast<float>(centered.x());
  query.y = static_cast<float>(centered.y());
  query.z = static_cast<float>(centered.z());
  query.time = 0.0F;
  query.radius = reach(within_m, search.slack_m);
  rtcPointQuery(scene.get(), &query, &context, visit, &search);
  return search;
}

SurfaceDistance::SurfaceDistance(const Mesh& reference) : impl_(std::make_unique<Impl>()) {
  requireUsable(reference);
  impl_->takeMesh(reference);
  impl_->buildScene();
}

SurfaceDistance::~SurfaceDistance() = default;
SurfaceDistance::SurfaceDistance(SurfaceDistance&&) noexcept = default;

SurfaceDistance::Nearest SurfaceDistance::nearest(const Eigen::Vector3d& point,
                                                  double within_m) const {
  Nearest out;
  if (!point.allFinite()) return out;
  const Eigen::Vector3d centered = point - impl_->center;
  Impl::Search found = impl_->search(centered, within_m);
  // Past a bound that was too small nothing is sure but that the nearest is no further than this.
  if (!(found.squared_m <= within_m * within_m)) {
    found = impl_->search(centered, std::sqrt(found.squared_m));
  }
  const Triangle& corners = impl_->triangles[found.triangle];
  const Eigen::Vector3d& pseudonormal =
      impl_->normals.of(found.triangle, corners, found.at.feature);
  const double distance_m = std::sqrt(found.squared_m);
  out.signed_m = pseudonormal.dot(centered - found.at.point) < 0.0 ? -distance_m : distance_m;
  out.point = found.at.point + impl_->center;
  out.face = impl_->original[found.triangle];
  out.normal = impl_->normals.ofFace(found.triangle);
  out.on_boundary = impl_->normals.onBoundary(found.triangle, corners, found.at.feature);
  return out;
}

bool SurfaceDistance::isWithin(const Eigen::Vector3d& point, double distance_m) const {
  if (!point.allFinite()) return false;
  return impl_->search(point - impl_->center, distance_m).squared_m <= distance_m * distance_m;
}

double SurfaceDistance::radius() const { return impl_->radius; }
Eigen::Vector3d SurfaceDistance::center() const { return impl_->center; }

}  // namespace scanner::evaluation
