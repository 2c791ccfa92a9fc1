#include "scanner/calibration/stereo_calibration.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "calibration/rectification.h"
#include "calibration/selection.h"
#include "calibration/text.h"
#include "calibration/uncertainty.h"
#include "calibration/views.h"

namespace scanner::calibration {
namespace {

Status checkObservations(const std::vector<BoardObservation>& observations, const Board& board) {
  const auto wanted =
      static_cast<std::size_t>(board.columns) * static_cast<std::size_t>(board.rows);
  for (const BoardObservation& o : observations) {
    if (o.left.size() != wanted || o.right.size() != wanted) {
      return {StatusCode::kInvalidInput, o.name + ": " + std::to_string(o.left.size()) + " and " +
                                             std::to_string(o.right.size()) +
                                             " corners, the board has " + std::to_string(wanted)};
    }
    for (const auto* corners : {&o.left, &o.right}) {
      for (const cv::Point2f& p : *corners) {
        if (!std::isfinite(p.x) || !std::isfinite(p.y)) {
          return {StatusCode::kInvalidInput, o.name + ": a corner is not finite"};
        }
      }
    }
  }
  return Status::ok();
}

ViewReport viewReport(const BoardObservation& observation, const Board& board,
                      const StereoFit& fit) {
  const BoardFit fitted = fitBoard(observation, board, fit);
  ViewReport view;
  view.name = observation.name;
  view.left_rms_px = std::sqrt(fitted.mean_square[0]);
  view.right_rms_px = std::sqrt(fitted.mean_square[1]);
  view.held_out_px = std::sqrt(fitted.meanSquare());
  for (const auto& residuals : fitted.residual) {
    for (const cv::Point2f& r : residuals) view.max_px = std::max(view.max_px, cv::norm(r));
  }
  view.T_camera_board = pose(fitted.pose);
  view.left = observation.left;
  view.right = observation.right;
  view.left_residual = fitted.residual[0];
  view.right_residual = fitted.residual[1];
  return view;
}

void reportViews(const std::vector<BoardObservation>& observations, const Screening& screening,
                 const Candidate& chosen, StereoCalibrationReport& report) {
  std::size_t used = 0;
  double squares = 0.0;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    ViewReport view = viewReport(observations[i], report.board, chosen.fit);
    view.note = screening.notes[i];
    view.used = view.note.empty();
    if (view.used) {
      squares +=
          0.5 * (view.left_rms_px * view.left_rms_px + view.right_rms_px * view.right_rms_px);
      view.held_out_px = std::sqrt(chosen.held_out[used++]);
      if (view.held_out_px > 2.0 * chosen.heldOutPx()) view.note = "much worse than the others";
    }
    report.views.push_back(std::move(view));
  }
  report.rms_px = std::sqrt(squares / static_cast<double>(used));
  report.held_out_px = chosen.heldOutPx();
}

EpipolarError epipolar(std::vector<double> errors) {
  std::sort(errors.begin(), errors.end());
  EpipolarError e;
  e.mean_px =
      std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
  e.p95_px = errors[static_cast<std::size_t>(0.95 * static_cast<double>(errors.size() - 1))];
  e.max_px = errors.back();
  return e;
}

/// The pixels of a sensor are square; when both eyes say otherwise, the board is not.
void warnOfStretchedBoard(StereoCalibrationReport& report) {
  constexpr double kSmallest = 0.002;  // 0.4 mm on 0.2 m: a ruler shows it
  const auto ratio = [&](const std::string& side) {
    return report.parameter(side + " fy").value / report.parameter(side + " fx").value - 1.0;
  };
  const double left = ratio("left"), right = ratio("right");
  if (left * right < 0.0 || std::min(std::abs(left), std::abs(right)) < kSmallest) return;
  report.warnings.push_back(format(
      "fy / fx is %.4f and %.4f, as if squares were %.2f %% %s along the columns than given: "
      "measure the board both ways (--square, --square-height)",
      1.0 + left, 1.0 + right, 50.0 * std::abs(left + right), left > 0.0 ? "longer" : "shorter"));
}

void addWarnings(const Candidate& chosen, const Rectification& r,
                 const StereoCalibrationOptions& options, StereoCalibrationReport& report) {
  const std::size_t left_out = report.views.size() - report.usedViews();
  if (left_out > 0) report.warnings.push_back(format("%zu view(s) left out, see below", left_out));
  const double covered = std::min(report.diversity.left_coverage, report.diversity.right_coverage);
  if (covered < 0.5) {
    report.warnings.push_back(
        format("the boards cover %.0f %% of the picture only; outside, distortion is extrapolated "
               "(+-%.1f px at the corners)",
               100.0 * covered, chosen.corner_sigma_px));
  }
  if (report.rms_px > 0.5) {
    report.warnings.push_back(
        format("residuals of %.2f px are large: is the board flat, are the "
               "pictures sharp, were the eyes exposed together?",
               report.rms_px));
  }
  warnOfStretchedBoard(report);
  if (std::abs(r.focal_change) > options.max_focal_change) {
    report.warnings.push_back(
        format("the rectified focal length is %+.0f %% off the original", 100.0 * r.focal_change));
  }
  if (std::min(r.kept_share[0], r.kept_share[1]) < options.kept_share) {
    report.warnings.push_back(format("only %.0f %% of the picture stay in the rectified one",
                                     100.0 * std::min(r.kept_share[0], r.kept_share[1])));
  }
}

Result<StereoCalibrationReport> makeReport(const std::vector<BoardObservation>& observations,
                                           const Screening& screening, const Choice& choice,
                                           const Board& board, cv::Size size,
                                           const StereoCalibrationOptions& options) {
  const StereoFit& fit = choice.chosen.fit;
  StereoCalibrationReport report;
  report.board = board;
  report.distortion = fit.distortion;
  report.models = choice.scores;
  report.diversity = diversity(screening.used, board, size, fit);
  if (const Status status = checkDiversity(report.diversity, options); !status) return status;
  const Rectification r = rectification(fit, size, options);
  report.calibration = r.calibration;
  if (const Status status = scanner::validate(report.calibration); !status) return status;
  report.rectified_alpha = r.alpha;
  report.left_kept_share = r.kept_share[0];
  report.right_kept_share = r.kept_share[1];
  report.T_right_left = pose(fit.R, fit.t);
  report.epipolar = epipolar(epipolarErrors(screening.used, report.calibration));
  report.parameters = parametersOf(choice.chosen);
  reportViews(observations, screening, choice.chosen, report);
  addWarnings(choice.chosen, r, options, report);
  return report;
}

Result<StereoCalibrationReport> calibrate(const std::vector<BoardObservation>& observations,
                                          const Board& board, cv::Size size,
                                          const StereoCalibrationOptions& options, int threads) {
  Views all;
  for (const BoardObservation& o : observations) all.push_back(&o);
  // A stiff model first: it converges on views that determine nothing else, and tells why.
  const auto first = fitStereo(all, board, size, Distortion::kK1, nullptr);
  if (!first) {
    return Status(StatusCode::kNoConvergence,
                  "the views do not determine the cameras: " + std::string(kTakeMore));
  }
  if (const Status status = checkDiversity(diversity(all, board, size, *first), options); !status) {
    return status;
  }
  if (const Status status = checkEyes(*first); !status) return status;
  const auto screening = screen(observations, board, size, options, threads);
  if (!screening) return screening.status();
  const auto choice = chooseModel(screening->used, board, size, options, threads);
  if (!choice) return choice.status();
  if (const Status status = checkEyes(choice->chosen.fit); !status) return status;
  return makeReport(observations, *screening, *choice, board, size, options);
}

}  // namespace

const Parameter& StereoCalibrationReport::parameter(const std::string& name) const {
  for (const Parameter& p : parameters) {
    if (p.name == name) return p;
  }
  throw std::out_of_range("no parameter '" + name + "'");
}

std::size_t StereoCalibrationReport::usedViews() const {
  return static_cast<std::size_t>(
      std::count_if(views.begin(), views.end(), [](const ViewReport& v) { return v.used; }));
}

Result<StereoCalibrationReport> calibrateStereo(const std::vector<BoardObservation>& observations,
                                                const Board& board, cv::Size image_size,
                                                const StereoCalibrationOptions& options,
                                                int threads) {
  validate(board);
  if (image_size.width < 16 || image_size.height < 16) {
    throw ConfigurationError("pictures of " + std::to_string(image_size.width) + "x" +
                             std::to_string(image_size.height) + " are too small to calibrate");
  }
  if (threads < 1) throw ConfigurationError("threads = " + std::to_string(threads));
  if (static_cast<int>(observations.size()) < options.min_views) {
    return Status(StatusCode::kNotEnoughData,
                  format("too few views: the whole board is seen by both eyes in %zu, at least %d "
                         "are needed; %s",
                         observations.size(), options.min_views, kTakeMore));
  }
  if (const Status status = checkObservations(observations, board); !status) return status;
  try {
    return calibrate(observations, board, image_size, options, threads);
  } catch (const cv::Exception& error) {
    return Status(StatusCode::kNoConvergence, "calibration broke down: " + error.err);
  }
}

}  // namespace scanner::calibration
