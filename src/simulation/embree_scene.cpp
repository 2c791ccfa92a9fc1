#include "simulation/embree_scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>
#include <limits>
#include <string>

#include "scanner/core/status.h"

namespace scanner::simulation {
namespace {

void check(const Part& part) {
  const auto refuse = [&](const std::string& what) {
    throw ConfigurationError("scene part '" + part.name + "': " + what);
  };
  if (part.vertices.empty() || part.faces.empty()) refuse("has no triangles");
  if (part.normals.size() != part.vertices.size()) refuse("normals and vertices differ in number");
  if (!part.uvs.empty() && part.uvs.size() != part.vertices.size()) {
    refuse("texture coordinates and vertices differ in number");
  }
  if (!part.colors.empty() && part.colors.size() != part.vertices.size()) {
    refuse("colours and vertices differ in number");
  }
  if (!part.shader) refuse("has no shader");
  for (const auto& face : part.faces) {
    for (const std::uint32_t corner : face) {
      if (corner >= part.vertices.size()) refuse("a face names a vertex that is not there");
    }
  }
  for (const Eigen::Vector3f& vertex : part.vertices) {
    if (!vertex.allFinite()) refuse("a vertex is not finite");
  }
}

/// Normals that are not finite or have no direction get that of a face around the vertex, so that
/// no NaN reaches the light.
void mendNormals(Part& part) {
  constexpr float kTooShort = 1e-12F;
  const auto good = [](const Eigen::Vector3f& n) {
    return n.squaredNorm() > kTooShort;
  };  // not NaN
  for (const auto& face : part.faces) {
    if (good(part.normals[face[0]]) && good(part.normals[face[1]]) && good(part.normals[face[2]])) {
      continue;
    }
    const Eigen::Vector3f& a = part.vertices[face[0]];
    const Eigen::Vector3f across =
        (part.vertices[face[1]] - a).cross(part.vertices[face[2]] - a).normalized();
    for (const std::uint32_t corner : face) {
      if (!good(part.normals[corner]) && good(across)) part.normals[corner] = across;
    }
  }
  for (Eigen::Vector3f& normal : part.normals) {  // of vertices that only zero-area faces use
    if (!good(normal)) normal = Eigen::Vector3f::UnitZ();
  }
}

void addGeometry(RTCDevice device, RTCScene scene, const Part& part, std::uint32_t id) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                               part.vertices.size()));
  auto* faces = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), part.faces.size()));
  if (vertices == nullptr || faces == nullptr) {
    rtcReleaseGeometry(geometry);
    throw ConfigurationError("scene part '" + part.name + "': no memory for its triangles");
  }
  for (const Eigen::Vector3f& vertex : part.vertices) {
    vertices = std::copy(vertex.data(), vertex.data() + 3, vertices);
  }
  std::memcpy(faces, part.faces.data(), part.faces.size() * sizeof(part.faces[0]));
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

RTCIntersectContext coherentContext() {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  return context;
}

}  // namespace

EmbreeScene::EmbreeScene(const Scene& scene)
    : parts_(scene.object), object_parts_(scene.object.size()) {
  parts_.insert(parts_.end(), scene.surroundings.begin(), scene.surroundings.end());
  for (Part& part : parts_) {
    check(part);
    mendNormals(part);
  }
  device_ = rtcNewDevice(nullptr);
  if (device_ == nullptr) throw ConfigurationError("Embree does not start on this processor");
  scene_ = rtcNewScene(device_);
  // Robust: no ray slips through between two triangles.
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    addGeometry(device_, scene_, parts_[i], static_cast<std::uint32_t>(i));
  }
  rtcCommitScene(scene_);
}

EmbreeScene::~EmbreeScene() {
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

void EmbreeScene::intersect(RTCRayHit* rays, std::size_t count, std::size_t stride) const {
  RTCIntersectContext context = coherentContext();
  rtcIntersect1M(scene_, &context, rays, static_cast<unsigned>(count), stride);
}

void EmbreeScene::occluded(std::vector<RTCRay>& rays) const {
  RTCIntersectContext context = coherentContext();
  rtcOccluded1M(scene_, &context, rays.data(), static_cast<unsigned>(rays.size()), sizeof(RTCRay));
}

SurfaceHit EmbreeScene::hitOf(const RTCRayHit& ray) const {
  return {ray.hit.geomID, ray.hit.primID, ray.hit.u, ray.hit.v};
}

Eigen::Vector3f EmbreeScene::geometricNormal(const SurfaceHit& hit) const {
  const Part& part = parts_[hit.part];
  const auto& face = part.faces[hit.face];
  const Eigen::Vector3f& a = part.vertices[face[0]];
  return (part.vertices[face[1]] - a).cross(part.vertices[face[2]] - a).normalized();
}

SurfacePoint EmbreeScene::pointAt(const SurfaceHit& hit) const {
  const Part& part = parts_[hit.part];
  const auto& face = part.faces[hit.face];
  const float w = 1.0F - hit.u - hit.v;
  SurfacePoint point;
  point.position =
      w * part.vertices[face[0]] + hit.u * part.vertices[face[1]] + hit.v * part.vertices[face[2]];
  point.normal =
      w * part.normals[face[0]] + hit.u * part.normals[face[1]] + hit.v * part.normals[face[2]];
  const float length = point.normal.norm();
  constexpr float kTooShort = 1e-6F;  // opposite normals cancel each other
  point.normal = length > kTooShort ? Eigen::Vector3f(point.normal / length) : geometricNormal(hit);
  point.uv.setZero();
  if (!part.uvs.empty()) {
    point.uv = w * part.uvs[face[0]] + hit.u * part.uvs[face[1]] + hit.v * part.uvs[face[2]];
  }
  if (!part.colors.empty()) {
    point.color =
        w * part.colors[face[0]] + hit.u * part.colors[face[1]] + hit.v * part.colors[face[2]];
  }
  return point;
}

float EmbreeScene::interpolate(const SurfaceHit& hit, const std::vector<float>& per_vertex) const {
  const auto& face = parts_[hit.part].faces[hit.face];
  return (1.0F - hit.u - hit.v) * per_vertex[face[0]] + hit.u * per_vertex[face[1]] +
         hit.v * per_vertex[face[2]];
}

RTCRay makeRay(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) {
  RTCRay ray{};
  ray.org_x = origin.x();
  ray.org_y = origin.y();
  ray.org_z = origin.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tfar = std::numeric_limits<float>::infinity();
  ray.mask = 0xffffffffU;
  return ray;
}

RTCRayHit makeRayHit(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) {
  RTCRayHit ray{};
  ray.ray = makeRay(origin, direction);
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return ray;
}

}  // namespace scanner::simulation
