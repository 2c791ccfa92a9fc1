#include <nlohmann/json.hpp>

#include "calibration/text.h"
#include "scanner/calibration/calibration_files.h"

namespace scanner::calibration {
namespace {

std::string viewTable(const StereoCalibrationReport& report) {
  std::string text =
      "\nview                        left  right    max  held out  distance  (residuals, px; mm)\n";
  for (const ViewReport& view : report.views) {
    text += format("%-26.26s %5.3f  %5.3f  %5.2f     %5.3f  %8.0f  %s\n", view.name.c_str(),
                   view.left_rms_px, view.right_rms_px, view.max_px, view.held_out_px,
                   1e3 * view.T_camera_board.translation().norm(), view.note.c_str());
  }
  return text;
}

std::string modelTable(const StereoCalibrationReport& report) {
  std::string text = "\ndistortion       residual  held out  corner sigma  (px)\n";
  for (const ModelScore& m : report.models) {
    text += format("%-16s    %5.3f", toString(m.distortion), m.rms_px);
    text += m.held_out_px > 0.0 ? format("     %5.3f  %12.2f", m.held_out_px, m.corner_sigma_px)
                                : std::string("         -             -");
    text += "  " + m.verdict + "\n";
  }
  return text;
}

std::string parameterTable(const StereoCalibrationReport& report) {
  std::string text = "\nparameter            value     sigma\n";
  for (const Parameter& p : report.parameters) {
    text += format("%-14s %11.4f  %8.4f %s\n", p.name.c_str(), p.value, p.sigma, p.unit.c_str());
  }
  return text;
}

nlohmann::json vectors(const std::vector<cv::Point2f>& points) {
  nlohmann::json list = nlohmann::json::array();
  for (const cv::Point2f& p : points) list.push_back({p.x, p.y});
  return list;
}

nlohmann::json viewJson(const ViewReport& view) {
  return {{"name", view.name},
          {"used", view.used},
          {"note", view.note},
          {"left_rms_px", view.left_rms_px},
          {"right_rms_px", view.right_rms_px},
          {"max_px", view.max_px},
          {"held_out_px", view.held_out_px},
          {"left", vectors(view.left)},
          {"right", vectors(view.right)},
          {"left_residual", vectors(view.left_residual)},
          {"right_residual", vectors(view.right_residual)}};
}

}  // namespace

std::string reportText(const StereoCalibrationReport& report) {
  const ViewDiversity& d = report.diversity;
  const Parameter& baseline = report.parameter("baseline");
  std::string text;
  text += format(
      "views       %zu of %zu used; %d distinct, tilted by up to %.0f deg, covering %.0f "
      "%% (left) and %.0f %% (right)\n",
      report.usedViews(), report.views.size(), d.distinct, d.tilt_deg, 100.0 * d.left_coverage,
      100.0 * d.right_coverage);
  text += format("residuals   %.3f px RMS of the fit, %.3f px on held-out views\n", report.rms_px,
                 report.held_out_px);
  text += format("epipolar    %.3f px mean, %.3f px 95 %%, %.3f px max\n", report.epipolar.mean_px,
                 report.epipolar.p95_px, report.epipolar.max_px);
  text += format("baseline    %.3f +- %.3f mm (if a square is %g mm)\n", baseline.value,
                 baseline.sigma, 1e3 * report.board.square_m);
  text += format("distortion  %s\n", toString(report.distortion));
  text += format(
      "rectified   focal length %.1f px (original %.1f), alpha %.2f, keeps %.0f %% and "
      "%.0f %% of the pictures\n",
      report.calibration.focalLength(), report.calibration.left.K(0, 0), report.rectified_alpha,
      100.0 * report.left_kept_share, 100.0 * report.right_kept_share);
  for (const std::string& warning : report.warnings) text += "warning     " + warning + "\n";
  return text + viewTable(report) + modelTable(report) + parameterTable(report);
}

std::string reportJson(const StereoCalibrationReport& report) {
  nlohmann::json json;
  json["rms_px"] = report.rms_px;
  json["held_out_px"] = report.held_out_px;
  json["epipolar"] = {{"mean_px", report.epipolar.mean_px},
                      {"p95_px", report.epipolar.p95_px},
                      {"max_px", report.epipolar.max_px}};
  json["distortion"] = toString(report.distortion);
  json["baseline_m"] = report.calibration.baseline();
  json["focal_length_px"] = {{"original", report.calibration.left.K(0, 0)},
                             {"rectified", report.calibration.focalLength()}};
  json["alpha"] = report.rectified_alpha;
  json["kept_share"] = {{"left", report.left_kept_share}, {"right", report.right_kept_share}};
  json["diversity"] = {{"distinct", report.diversity.distinct},
                       {"tilt_deg", report.diversity.tilt_deg},
                       {"left_coverage", report.diversity.left_coverage},
                       {"right_coverage", report.diversity.right_coverage}};
  json["board"] = {{"columns", report.board.columns},
                   {"rows", report.board.rows},
                   {"square_m", report.board.square_m},
                   {"square_height_m", report.board.squareHeight()}};
  json["warnings"] = report.warnings;
  for (const ViewReport& view : report.views) json["views"].push_back(viewJson(view));
  for (const ModelScore& m : report.models) {
    json["models"].push_back({{"distortion", toString(m.distortion)},
                              {"rms_px", m.rms_px},
                              {"held_out_px", m.held_out_px},
                              {"corner_sigma_px", m.corner_sigma_px},
                              {"verdict", m.verdict}});
  }
  for (const Parameter& p : report.parameters) {
    json["parameters"][p.name] = {{"value", p.value}, {"sigma", p.sigma}, {"unit", p.unit}};
  }
  return json.dump(2) + "\n";
}

}  // namespace scanner::calibration
