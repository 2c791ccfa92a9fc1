#include "scanner/surface/render.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "scanner/core/status.h"
#include "surface/mesh_edges.h"

namespace scanner::surface {
namespace {

constexpr double kAmbient = 0.25;

/// A vertex as the rasteriser needs it.
struct Corner {
  Eigen::Vector3d camera;  ///< position in the camera frame, metres
  Eigen::Vector2d pixel;
  Eigen::Vector3d normal;  ///< camera frame, or zero
  Eigen::Vector3d color;   ///< b g r, 0..255
};

class Rasterizer {
 public:
  Rasterizer(int width, int height, Rgb8 background)
      : width_(width),
        height_(height),
        image_(height, width, CV_8UC3),
        depth_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
               std::numeric_limits<double>::infinity()) {
    image_.setTo(cv::Scalar(background.b, background.g, background.r));
  }

  void triangle(const Corner& a, const Corner& b, const Corner& c) {
    const double area = cross(b.pixel - a.pixel, c.pixel - a.pixel);
    if (std::abs(area) < 1e-12) return;
    const auto [x0, x1] = range(a.pixel.x(), b.pixel.x(), c.pixel.x(), width_);
    const auto [y0, y1] = range(a.pixel.y(), b.pixel.y(), c.pixel.y(), height_);
    const Eigen::Vector3d face_normal =
        (b.camera - a.camera).cross(c.camera - a.camera).normalized();
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Eigen::Vector2d p(x, y);
        // Barycentric in the image, then perspective-correct.
        Eigen::Vector3d w(cross(b.pixel - p, c.pixel - p), cross(c.pixel - p, a.pixel - p),
                          cross(a.pixel - p, b.pixel - p));
        w /= area;
        if (w.minCoeff() < -1e-9) continue;
        w = w.cwiseQuotient(Eigen::Vector3d(a.camera.z(), b.camera.z(), c.camera.z()));
        w /= w.sum();
        const Eigen::Vector3d at = w[0] * a.camera + w[1] * b.camera + w[2] * c.camera;
        const Eigen::Vector3d color = w[0] * a.color + w[1] * b.color + w[2] * c.color;
        Eigen::Vector3d normal = w[0] * a.normal + w[1] * b.normal + w[2] * c.normal;
        // The face decides which side is seen, the vertices how it is lit.
        const bool behind = face_normal.dot(at) > 0.0;
        if (!(normal.norm() > 1e-6) || normal.dot(face_normal) < 0.0) normal = face_normal;
        put(x, y, at, normal.normalized(), color, behind);
      }
    }
  }

  void point(const Corner& c) {
    const auto x = static_cast<int>(std::lround(c.pixel.x()));
    const auto y = static_cast<int>(std::lround(c.pixel.y()));
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return;
    const Eigen::Vector3d normal =
        c.normal.norm() > 0.0 ? c.normal : Eigen::Vector3d(-c.camera.normalized());
    put(x, y, c.camera, normal, c.color, normal.dot(c.camera) > 0.0);
  }

  cv::Mat image() const { return image_; }

 private:
  static double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() * b.y() - a.y() * b.x();
  }

  /// Pixels from the smallest to the largest of three coordinates, within the image.
  static std::pair<int, int> range(double a, double b, double c, int size) {
    const double low = std::clamp(std::ceil(std::min({a, b, c})), 0.0, double(size));
    const double high = std::clamp(std::floor(std::max({a, b, c})), -1.0, double(size - 1));
    return {static_cast<int>(low), static_cast<int>(high)};
  }

  void put(int x, int y, const Eigen::Vector3d& at, const Eigen::Vector3d& normal,
           const Eigen::Vector3d& color, bool behind) {
    double& depth = depth_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                           static_cast<std::size_t>(x)];
    if (at.z() >= depth) return;
    depth = at.z();
    // A lamp above the camera's left shoulder models relief better than one in the lens.
    const Eigen::Vector3d lamp = Eigen::Vector3d(-0.35, -0.45, -1.0).normalized();
    const double lit = std::max(0.0, behind ? -normal.dot(lamp) : normal.dot(lamp));
    Eigen::Vector3d shaded = color * (kAmbient + (1.0 - kAmbient) * lit);
    if (behind) shaded = 0.5 * shaded + Eigen::Vector3d(60.0, 20.0, 10.0);
    const auto channel = [&](int i) {
      return static_cast<std::uint8_t>(std::clamp(std::lround(shaded[i]), 0L, 255L));
    };
    image_.at<cv::Vec3b>(y, x) = cv::Vec3b(channel(0), channel(1), channel(2));
  }

  int width_;
  int height_;
  cv::Mat image_;
  std::vector<double> depth_;
};

void requireSize(int width, int height) {
  if (width < 1 || height < 1) {
    throw ConfigurationError("render: size " + std::to_string(width) + "x" +
                             std::to_string(height) + " must be at least 1x1");
  }
}

}  // namespace

ViewPoint autoView(const Mesh& mesh, const Eigen::Vector3d& direction, int width, int height,
                   const Eigen::Vector3d& up) {
  requireSize(width, height);
  if (!(direction.norm() > 0.0)) throw ConfigurationError("render: the viewing direction is zero");
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector3d high = -low;
  for (const auto& p : mesh.vertices.points) {
    if (!p.allFinite()) continue;
    low = low.cwiseMin(p.cast<double>());
    high = high.cwiseMax(p.cast<double>());
  }
  if (low.x() > high.x()) low = high = Eigen::Vector3d::Zero();
  const Eigen::Vector3d z = direction.normalized();
  Eigen::Vector3d x = z.cross(up);
  x = x.norm() > 1e-9 * up.norm() ? Eigen::Vector3d(x.normalized()) : z.unitOrthogonal();
  ViewPoint view;
  view.T_map_camera.linear() << x, z.cross(x), z;
  const double f = 1.6 * std::min(width, height);  // about 35 degrees across the shorter side
  view.K << f, 0.0, 0.5 * (width - 1), 0.0, f, 0.5 * (height - 1), 0.0, 0.0, 1.0;
  // Back off until every corner of the mesh is inside the picture with a small margin.
  const Eigen::Vector3d center = 0.5 * (low + high);
  double distance = 1e-3;
  for (const auto& p : mesh.vertices.points) {
    if (!p.allFinite()) continue;
    const Eigen::Vector3d q = view.T_map_camera.linear().transpose() * (p.cast<double>() - center);
    distance = std::max({distance, 1.05 * std::abs(q.x()) * f / (0.5 * width) - q.z(),
                         1.05 * std::abs(q.y()) * f / (0.5 * height) - q.z()});
  }
  view.T_map_camera.translation() = center - distance * z;
  return view;
}

cv::Mat renderMesh(const Mesh& mesh, const Eigen::Isometry3d& T_map_camera,
                   const Eigen::Matrix3d& K, int width, int height, Rgb8 background) {
  requireSize(width, height);
  const Eigen::Isometry3d T_camera_map = T_map_camera.inverse();
  const PointCloud& v = mesh.vertices;
  std::vector<Corner> corners(v.size());
  for (std::size_t i = 0; i < v.size(); ++i) {
    Corner& c = corners[i];
    c.camera = T_camera_map * v.points[i].cast<double>();
    const Eigen::Vector3d image = K * c.camera;
    c.pixel = image.head<2>() / image.z();
    c.normal.setZero();
    if (v.hasNormals() && v.normals[i].allFinite()) {
      c.normal = T_camera_map.linear() * v.normals[i].cast<double>();
    }
    const Rgb8 rgb = v.hasColors() ? v.colors[i] : Rgb8{200, 200, 200};
    c.color = Eigen::Vector3d(rgb.b, rgb.g, rgb.r);
  }
  const auto visible = [&](std::uint32_t i) {
    return i < corners.size() && corners[i].camera.z() > 1e-6 && corners[i].pixel.allFinite();
  };
  Rasterizer raster(width, height, background);
  for (const Face& f : mesh.faces) {
    if (!visible(f[0]) || !visible(f[1]) || !visible(f[2])) continue;
    raster.triangle(corners[f[0]], corners[f[1]], corners[f[2]]);
  }
  if (mesh.faces.empty()) {
    for (std::uint32_t i = 0; i < corners.size(); ++i) {
      if (visible(i)) raster.point(corners[i]);
    }
  }
  return raster.image();
}

}  // namespace scanner::surface
