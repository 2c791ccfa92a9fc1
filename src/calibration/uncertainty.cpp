#include "calibration/uncertainty.h"

#include <opencv2/calib3d.hpp>

namespace scanner::calibration {
namespace {

constexpr double kDegrees = 180.0 / 3.14159265358979323846;

std::vector<Parameter> valuesOf(const StereoFit& fit) {
  static const char* const kNames[] = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  std::vector<Parameter> values;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    const std::string side = eye == 0 ? "left " : "right ";
    const cv::Mat& K = fit.K[eye];
    values.push_back({side + "fx", K.at<double>(0, 0), 0.0, "px"});
    values.push_back({side + "fy", K.at<double>(1, 1), 0.0, "px"});
    values.push_back({side + "cx", K.at<double>(0, 2), 0.0, "px"});
    values.push_back({side + "cy", K.at<double>(1, 2), 0.0, "px"});
    for (const int i : coefficientsOf(fit.distortion)) {
      values.push_back({side + kNames[i], fit.D[eye].at<double>(i), 0.0, ""});
    }
  }
  cv::Mat rotation;
  cv::Rodrigues(fit.R, rotation);
  values.push_back({"baseline", 1e3 * cv::norm(fit.t), 0.0, "mm"});
  values.push_back({"rotation x", kDegrees * rotation.at<double>(0), 0.0, "deg"});
  values.push_back({"rotation y", kDegrees * rotation.at<double>(1), 0.0, "deg"});
  values.push_back({"rotation z", kDegrees * rotation.at<double>(2), 0.0, "deg"});
  return values;
}

}  // namespace

std::vector<Parameter> parametersOf(const Candidate& candidate) {
  std::vector<Parameter> parameters = valuesOf(candidate.fit);
  std::vector<std::vector<Parameter>> without;
  without.reserve(candidate.without.size());
  for (const StereoFit& fit : candidate.without) without.push_back(valuesOf(fit));
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    std::vector<double> values;
    values.reserve(without.size());
    for (const auto& group : without) values.push_back(group[i].value);
    parameters[i].sigma = jackknifeSigma(values);
  }
  return parameters;
}

}  // namespace scanner::calibration
