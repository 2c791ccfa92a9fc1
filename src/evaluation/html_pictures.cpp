#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "evaluation/html_parts.h"
#include "evaluation/html_text.h"
#include "scanner/surface/render.h"

namespace scanner::evaluation::html {
namespace {

constexpr Rgb8 kBackground = {246, 247, 249};

struct Size {
  int width, height;
};
constexpr Size kHero = {1200, 800};
constexpr Size kSide = {480, 480};

/// Whether the scan looks at walls around it: seen from above, its normals then point inwards.
/// Floors and ground have no say.
bool isInterior(const Mesh& model, const Eigen::Vector3d& centre) {
  if (!model.vertices.hasNormals()) return false;
  double outwards = 0.0;
  for (std::size_t i = 0; i < model.vertices.size(); ++i) {
    const Eigen::Vector2d from_centre =
        model.vertices.points[i].head<2>().cast<double>() - centre.head<2>();
    const double share =
        model.vertices.normals[i].head<2>().cast<double>().dot(from_centre.normalized());
    if (std::isfinite(share)) outwards += share;
  }
  return outwards < 0.0;
}

/// The model without the faces that turn their back on `eye`: one looks through the near walls of a
/// room into it.
Mesh opened(const Mesh& model, const Eigen::Vector3d& eye) {
  Mesh open;
  open.vertices = model.vertices;
  for (const auto& face : model.faces) {
    const Eigen::Vector3d a = model.vertices.points[face[0]].cast<double>();
    const Eigen::Vector3d b = model.vertices.points[face[1]].cast<double>();
    const Eigen::Vector3d c = model.vertices.points[face[2]].cast<double>();
    if ((b - a).cross(c - a).dot(eye - a) > 0.0) open.faces.push_back(face);
  }
  return open;
}

/// What a picture should show: the model without the few points that lie far from all others, which
/// would make the rest small.
Mesh framed(const Mesh& model) {
  constexpr double kLeftOut = 0.002;  // at either end of each axis
  Eigen::Vector3f low, high;
  const std::size_t n = model.vertices.size();
  const auto skip = static_cast<std::ptrdiff_t>(kLeftOut * static_cast<double>(n));
  std::vector<float> values(n);
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < n; ++i) values[i] = model.vertices.points[i][axis];
    const auto from = values.begin() + skip, to = values.end() - 1 - skip;
    std::nth_element(values.begin(), from, values.end());
    low[axis] = *from;
    std::nth_element(values.begin(), to, values.end());
    high[axis] = *to;
  }
  const Eigen::Vector3f margin = Eigen::Vector3f::Constant(0.03F * (high - low).maxCoeff());
  const Eigen::AlignedBox3f box(low - margin, high + margin);
  Mesh inside;
  for (const Eigen::Vector3f& point : model.vertices.points) {
    if (box.contains(point)) inside.vertices.points.push_back(point);
  }
  return inside;
}

class Studio {
 public:
  explicit Studio(const FolderData& data) : model_(*data.model), framed_(framed(model_)) {
    centre_ = medianPoint(model_.vertices);
    interior_ = isInterior(model_, centre_);
    if (data.trajectory.empty()) return;
    const Eigen::Vector3d stand = data.trajectory.front().T_map_base.translation() - centre_;
    if (stand.head<2>().norm() > 0.0) front_ = std::atan2(stand.y(), stand.x());
  }

  bool interior() const { return interior_; }

  /// From `turn_deg` to the right of where the scan began.
  Picture take(const std::string& caption, double turn_deg, double elevation_deg, Size size) const {
    // Drawn twice as large and averaged: smooth edges.
    constexpr int kFiner = 2;
    const double a = front_ + turn_deg * CV_PI / 180.0, e = elevation_deg * CV_PI / 180.0;
    const Eigen::Vector3d stand(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e));
    const int width = kFiner * size.width, height = kFiner * size.height;
    const surface::ViewPoint view = surface::autoView(framed_, -stand, width, height);
    const auto render = [&](const Mesh& mesh) {
      return surface::renderMesh(mesh, view.T_map_camera, view.K, width, height, kBackground);
    };
    const bool open = interior_ && !model_.faces.empty();
    const cv::Mat fine =
        open ? render(opened(model_, view.T_map_camera.translation())) : render(model_);
    cv::Mat image;
    cv::resize(fine, image, {size.width, size.height}, 0.0, 0.0, cv::INTER_AREA);
    constexpr int kQuality = 88;
    std::vector<unsigned char> bytes;
    cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
    return {caption, dataUri("image/jpeg", std::string(bytes.begin(), bytes.end()))};
  }

 private:
  const Mesh& model_;
  Mesh framed_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  bool interior_ = false;
  double front_ = 0.0;
};

}  // namespace

ModelPictures renderModel(const FolderData& data) {
  ModelPictures pictures;
  if (!data.model || data.model->vertices.empty() || !allFinite(data.model->vertices))
    return pictures;
  const Studio studio(data);
  const double elevation = studio.interior() ? 45.0 : 15.0;
  constexpr double kHeroTurn = 25.0;
  pictures.hero = studio.take("The model, in the colours that the camera saw", kHeroTurn,
                              elevation + 5.0, kHero);
  const std::pair<const char*, double> sides[] = {
      {"from where the scan began", 0.0},
      {"from the right", 90.0},
      {"from behind", 180.0},
      {"from the left", 270.0},
  };
  for (const auto& [caption, turn] : sides) {
    pictures.sides.push_back(studio.take(caption, turn, elevation, kSide));
  }
  return pictures;
}

std::string figure(const Picture& picture) {
  if (picture.uri.empty()) return "";
  const std::string caption = escape(picture.caption);
  return "<figure><img alt=\"" + caption + "\" src=\"" + picture.uri + "\"><figcaption>" + caption +
         "</figcaption></figure>\n";
}

std::string figures(const std::vector<Picture>& pictures) {
  if (pictures.empty()) return "";
  std::string out = "<div class=\"pictures\">\n";
  for (const Picture& picture : pictures) out += figure(picture);
  return out + "</div>\n";
}

}  // namespace scanner::evaluation::html
