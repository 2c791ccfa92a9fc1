#include "scanner/ros/euroc_import.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>

#include "ros/euroc_folder.h"
#include "ros/recording_writer.h"

namespace scanner::bridge {
namespace {

struct Pair {
  Time stamp;
  std::string left, right;
};

std::vector<Pair> pairsOf(const EurocFolder& euroc, std::size_t* unpaired) {
  std::vector<Pair> pairs;
  auto right = euroc.right.images.begin();
  for (const auto& [stamp, path] : euroc.left.images) {
    while (right != euroc.right.images.end() && right->first < stamp) ++right;
    if (right == euroc.right.images.end() || right->first != stamp) continue;
    pairs.push_back({stamp, path, right->second});
  }
  *unpaired = euroc.left.images.size() + euroc.right.images.size() - 2 * pairs.size();
  return pairs;
}

cv::Mat toCv(const Eigen::MatrixXd& m) {
  cv::Mat out(static_cast<int>(m.rows()), static_cast<int>(m.cols()), CV_64F);
  for (int r = 0; r < out.rows; ++r) {
    for (int c = 0; c < out.cols; ++c) out.at<double>(r, c) = m(r, c);
  }
  return out;
}

Eigen::MatrixXd toEigen(const cv::Mat& m) {
  Eigen::MatrixXd out(m.rows, m.cols);
  for (int r = 0; r < m.rows; ++r) {
    for (int c = 0; c < m.cols; ++c) out(r, c) = m.at<double>(r, c);
  }
  return out;
}

/// Fills R and P of both cameras.
StereoCalibration rectified(const EurocFolder& euroc) {
  const Eigen::Isometry3d T_right_left =
      euroc.right.T_body_camera.inverse() * euroc.left.T_body_camera;
  StereoCalibration out{euroc.left.model, euroc.right.model};
  cv::Mat R1, R2, P1, P2, Q;
  cv::stereoRectify(toCv(out.left.K), out.left.D, toCv(out.right.K), out.right.D,
                    cv::Size(out.left.width, out.left.height), toCv(T_right_left.linear()),
                    toCv(T_right_left.translation()), R1, R2, P1, P2, Q, cv::CALIB_ZERO_DISPARITY,
                    0.0);
  out.left.R = toEigen(R1);
  out.right.R = toEigen(R2);
  out.left.P = toEigen(P1);
  out.right.P = toEigen(P2);
  return out;
}

Result<Image> readImage(const std::string& file, const CameraModel& camera) {
  Image image;
  image.data = cv::imread(file, cv::IMREAD_GRAYSCALE);
  if (image.data.empty()) return Status(StatusCode::kIoError, file + ": no readable picture");
  if (image.data.cols != camera.width || image.data.rows != camera.height) {
    return Status(StatusCode::kInvalidInput, file + ": the size differs from sensor.yaml's");
  }
  return image;
}

Status writePair(const Pair& pair, const StereoCalibration& calibration, RecordingWriter& writer) {
  Result<Image> left = readImage(pair.left, calibration.left);
  if (!left) return left.status();
  Result<Image> right = readImage(pair.right, calibration.right);
  if (!right) return right.status();
  writer.writeFrame({pair.stamp, *left, *right}, calibration);
  return Status::ok();
}

/// What is kept of the samples and the truth.
struct Span {
  Time first = Time();
  Time last = Time::max();
};

/// Samples are written in step with the pairs, so that the bag is in the order of time.
Status writeAll(const EurocFolder& euroc, const std::vector<Pair>& pairs,
                const StereoCalibration& calibration, const Span& span,
                const std::function<bool(std::size_t, std::size_t)>& progress,
                RecordingWriter& writer, EurocSummary& summary) {
  writer.writeTransforms(std::min(pairs.front().stamp, euroc.samples.front().stamp),
                         euroc.T_body_imu.inverse() * euroc.left.T_body_camera,
                         euroc.left.T_body_camera.inverse() * euroc.right.T_body_camera);
  for (const StampedPose& pose : euroc.truth) {
    if (pose.stamp < span.first || pose.stamp > span.last) continue;
    writer.writeTruth(pose);
    ++summary.truth_poses;
  }
  const auto writeImuUpTo = [&](Time stamp) {
    std::size_t& next = summary.imu_samples;
    for (; next < euroc.samples.size() && euroc.samples[next].stamp <= stamp; ++next) {
      writer.writeImu(euroc.samples[next]);
    }
  };
  for (const Pair& pair : pairs) {
    writeImuUpTo(pair.stamp);
    if (Status status = writePair(pair, calibration, writer); !status) return status;
    if (progress && !progress(++summary.pairs, pairs.size())) {
      return Status(StatusCode::kIoError, "interrupted, nothing was written");
    }
  }
  summary.pairs = pairs.size();
  writeImuUpTo(span.last);
  return Status::ok();
}

}  // namespace

Result<EurocSummary> importEuroc(const std::string& directory, const std::string& bag_path,
                                 const EurocOptions& options,
                                 const std::function<bool(std::size_t, std::size_t)>& progress) {
  Result<EurocFolder> folder = readEuroc(directory);
  if (!folder) return folder.status();
  EurocFolder& euroc = *folder;
  EurocSummary summary;
  const std::vector<Pair> pairs = pairsOf(euroc, &summary.unpaired);
  if (pairs.empty()) {
    return Status(StatusCode::kNotEnoughData,
                  directory + ": no images with equal stamps in cam0 and cam1");
  }
  if (euroc.samples.empty()) {
    return Status(StatusCode::kNotEnoughData, directory + "/imu0/data.csv: no samples");
  }
  const StereoCalibration calibration = rectified(euroc);
  if (Status status = validate(calibration); !status) {
    return Status(status.code(), directory + ": " + status.message());
  }
  Span span;
  if (options.limit_to_images) {
    const Duration margin = fromSeconds(options.margin_s);
    span = {pairs.front().stamp - margin, pairs.back().stamp + margin};
  }
  const Status status = writeRecording(bag_path, false, [&](RecordingWriter& writer) {
    return writeAll(euroc, pairs, calibration, span, progress, writer, summary);
  });
  if (!status) return status;
  summary.focal_length_px = calibration.focalLength();
  summary.baseline_m = calibration.baseline();
  return summary;
}

}  // namespace scanner::bridge
