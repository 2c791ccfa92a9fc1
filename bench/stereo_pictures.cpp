// A contact sheet of what the stereo stage makes of picture files: for each pair the rectified left
// picture, its disparity, and the coloured cloud from a second viewpoint, where streaks, thick rims
// and flying pixels show that the first one hides.
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "scanner/core/camera.h"
#include "scanner/core/options.h"
#include "scanner/stereo/stereo_processor.h"
#include "scanner/stereo/suitability.h"
#include "tools/run.h"

namespace scanner {
namespace {

/// Height of a picture on the sheet, px.
constexpr int kPictureHeight = 360;
/// Side of the square that a point of the middle depth is drawn as, px.
constexpr double kPointSize = 2.0;

struct Request {
  std::string rig, config, out = "stereo.png", method = "semi_global";
  std::vector<std::string> images;
  double yaw_deg = 20.0, pitch_deg = 10.0;
  int threads = 2;
};

StereoFrame readPair(const std::string& left, const std::string& right) {
  const auto read = [](const std::string& path) {
    const cv::Mat image = cv::imread(path, cv::IMREAD_COLOR);
    if (image.empty()) throw std::runtime_error("cannot read " + path);
    return Image{image, PixelFormat::kBgr8};
  };
  StereoFrame frame;
  frame.left = read(left);
  frame.right = read(right);
  return frame;
}

/// The settings for a scene of which nothing is known: the range that the pair shows.
stereo::StereoOptions settings(const stereo::RectifiedPair& pair, const Request& request) {
  stereo::StereoOptions options;
  if (!request.config.empty()) {
    const ParameterTree tree = readYaml(request.config);
    if (tree.is_object() && tree.contains("stereo")) {
      loadOptions(tree["stereo"], "stereo", options);
    }
  }
  options.matcher.method =
      request.method == "block" ? stereo::MatchMethod::kBlock : stereo::MatchMethod::kSemiGlobal;
  const auto range = stereo::measureDisparities(pair, request.threads);
  if (!range) throw std::runtime_error(range.status().message());
  constexpr double kMargin = 8.0;
  options.matcher.min_disparity_px = static_cast<int>(std::max(0.0, range->min_px - kMargin));
  options.matcher.max_disparity_px =
      static_cast<int>(std::min(pair.left_gray.cols - 1.0, range->max_px + kMargin));
  return options;
}

cv::Mat disparityPicture(const DisparityImage& image) {
  cv::Mat scaled(image.disparity_px.size(), CV_8UC1), colored;
  const double low = image.min_disparity_px, high = image.max_disparity_px;
  image.disparity_px.convertTo(scaled, CV_8U, 255.0 / (high - low), -255.0 * low / (high - low));
  cv::applyColorMap(scaled, colored, cv::COLORMAP_TURBO);
  colored.setTo(cv::Scalar::all(0), ~(image.disparity_px == image.disparity_px));
  return colored;
}

float middleDepth(const PointCloud& cloud) {
  std::vector<float> depths;
  for (const Eigen::Vector3f& p : cloud.points) {
    if (!std::isnan(p.z())) depths.push_back(p.z());
  }
  if (depths.empty()) throw std::runtime_error("no pixel has a disparity");
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

/// The cloud as a camera of the same focal length sees it that has gone round the middle depth.
cv::Mat obliquePicture(const OrganizedCloud& organized, const StereoCalibration& calibration,
                       const Request& request) {
  const PointCloud& cloud = organized.cloud;
  const Eigen::Vector3f centre(0.0F, 0.0F, middleDepth(cloud));
  constexpr double kDegree = M_PI / 180.0;
  const Eigen::Matrix3f turn =
      (Eigen::AngleAxisd(-request.pitch_deg * kDegree, Eigen::Vector3d::UnitX()) *
       Eigen::AngleAxisd(request.yaw_deg * kDegree, Eigen::Vector3d::UnitY()))
          .toRotationMatrix()
          .cast<float>();
  const auto f = static_cast<float>(calibration.focalLength());
  const auto cx = static_cast<float>(calibration.left.P(0, 2));
  const auto cy = static_cast<float>(calibration.left.P(1, 2));
  const int width = static_cast<int>(organized.width), height = static_cast<int>(organized.height);
  cv::Mat picture(height, width, CV_8UC3, cv::Scalar::all(255));
  cv::Mat nearest(height, width, CV_32FC1, cv::Scalar(std::numeric_limits<float>::infinity()));
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (std::isnan(cloud.points[i].z())) continue;
    const Eigen::Vector3f p = turn * (cloud.points[i] - centre) + centre;
    if (p.z() <= 0.1F * centre.z()) continue;
    const int side =
        std::clamp(static_cast<int>(std::lround(kPointSize * centre.z() / p.z())), 1, 6);
    const int x = static_cast<int>(std::lround(f * p.x() / p.z() + cx)) - side / 2;
    const int y = static_cast<int>(std::lround(f * p.y() / p.z() + cy)) - side / 2;
    const cv::Rect square = cv::Rect(x, y, side, side) & cv::Rect(0, 0, width, height);
    const Rgb8 color = cloud.colors[i];
    for (int v = square.y; v < square.y + square.height; ++v) {
      for (int u = square.x; u < square.x + square.width; ++u) {
        if (nearest.at<float>(v, u) <= p.z()) continue;
        nearest.at<float>(v, u) = p.z();
        picture.at<cv::Vec3b>(v, u) = cv::Vec3b(color.b, color.g, color.r);
      }
    }
  }
  return picture;
}

cv::Mat row(const StereoCalibration& calibration, const Request& request, const std::string& left,
            const std::string& right) {
  const StereoFrame frame = readPair(left, right);
  const auto pair = stereo::Rectifier(calibration).rectify(frame, request.threads);
  if (!pair) throw std::runtime_error(pair.status().message());
  const stereo::StereoProcessor processor(calibration, settings(*pair, request), request.threads);
  const auto out = processor.process(frame);
  if (!out) throw std::runtime_error(out.status().message());
  const stereo::Trouble trouble = stereo::inspectPair(*pair, request.threads);
  std::printf("%s: %d to %d px, %.1f %% valid%s%s\n", left.c_str(),
              processor.options().matcher.min_disparity_px,
              processor.options().matcher.max_disparity_px, 100.0 * out->statistics.density,
              trouble ? "; " : "", trouble.line.c_str());
  const stereo::MatchStatistics& match = out->statistics.match;
  const auto percent = [&](std::size_t n) {
    return 100.0 * static_cast<double>(n) / static_cast<double>(match.pixels);
  };
  std::printf(
      "  %% removed as: untextured %.1f, ambiguous %.1f, outside %.1f, back and forth %.1f, "
      "residual %.1f, precision %.1f, small surface %.1f\n",
      percent(match.untextured), percent(match.ambiguous), percent(match.outside),
      percent(match.back_and_forth), percent(match.refinement), percent(match.precision),
      percent(match.surface));
  std::vector<cv::Mat> pictures{pair->left_color, disparityPicture(out->disparity),
                                obliquePicture(out->cloud, calibration, request)};
  for (cv::Mat& picture : pictures) {
    const double scale = static_cast<double>(kPictureHeight) / picture.rows;
    cv::resize(picture, picture, cv::Size(), scale, scale, cv::INTER_AREA);
  }
  cv::Mat line;
  cv::hconcat(pictures, line);
  return line;
}

int writeSheet(const Request& request) {
  if (request.images.empty() || request.images.size() % 2 != 0) {
    throw std::runtime_error("give pairs of images: left right left right ...");
  }
  const Rig rig = loadRig(request.rig);
  if (!rig.cameras) throw std::runtime_error(request.rig + ": carries no cameras");
  std::vector<cv::Mat> rows;
  for (std::size_t i = 0; i < request.images.size(); i += 2) {
    rows.push_back(row(*rig.cameras, request, request.images[i], request.images[i + 1]));
  }
  cv::Mat sheet;
  cv::vconcat(rows, sheet);
  if (!cv::imwrite(request.out, sheet)) throw std::runtime_error("cannot write " + request.out);
  return tools::kOk;
}

}  // namespace
}  // namespace scanner

int main(int argc, char** argv) {
  scanner::Request request;
  CLI::App app("Contact sheet of disparities and clouds of pairs of picture files.",
               "stereo_pictures");
  app.add_option("RIG", request.rig, "rig file with cameras (calibrate_stereo)")->required();
  app.add_option("IMAGES", request.images, "left right left right ...")->required();
  app.add_option("--out", request.out, "picture to write")->capture_default_str();
  app.add_option("--config", request.config,
                 "YAML file with a block `stereo`; its method and range are not used");
  app.add_option("--method", request.method, "how to match")
      ->check(CLI::IsMember({"block", "semi_global"}))
      ->capture_default_str();
  app.add_option("--yaw", request.yaw_deg, "degrees that the second viewpoint is to the side")
      ->capture_default_str();
  app.add_option("--pitch", request.pitch_deg, "degrees that it is above")->capture_default_str();
  app.add_option("--threads", request.threads, "threads to use")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  return scanner::tools::run(app, argc, argv, [&] { return scanner::writeSheet(request); });
}
