#include "calibration/selection.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "scanner/core/parallel.h"

namespace scanner::calibration {
namespace {

constexpr std::size_t kMostGroups = 12;
/// Gains below this are rounding of the optimiser, not evidence.
constexpr double kSmallestGainPx = 0.002;
constexpr double kRationalGainFactor = 5.0;
constexpr double kRationalSigmaFactor = 2.0;

Views withoutGroup(const Views& views, std::size_t group, std::size_t groups) {
  Views kept;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (i % groups != group) kept.push_back(views[i]);
  }
  return kept;
}

double cornerSigma(const std::vector<StereoFit>& fits, cv::Size size) {
  std::vector<std::vector<cv::Point2d>> rays;
  rays.reserve(fits.size());
  for (const StereoFit& fit : fits) rays.push_back(cornerRays(fit, size));
  double largest = 0.0;
  for (std::size_t corner = 0; corner < rays.front().size(); ++corner) {
    std::vector<double> x, y;
    for (const auto& r : rays) {
      x.push_back(r[corner].x);
      y.push_back(r[corner].y);
    }
    largest = std::max(largest, std::hypot(jackknifeSigma(x), jackknifeSigma(y)));
  }
  return largest;
}

/// What a richer model gains on held-out views.
struct Gain {
  double share = 0.0;   ///< of the error's RMS
  double px = 0.0;      ///< likewise, absolute
  double sigmas = 0.0;  ///< mean of the views' paired log ratios by its standard error
};

Gain gainOf(const Candidate& simple, const Candidate& rich) {
  // Ratios, not differences: where one view near the edge gains most, it would widen the standard
  // error of the differences so far that no gain of all views could ever count.
  constexpr double kFloor = 1e-12;
  const double n = static_cast<double>(simple.held_out.size());
  std::vector<double> ratios;
  for (std::size_t i = 0; i < simple.held_out.size(); ++i) {
    ratios.push_back(std::log((simple.held_out[i] + kFloor) / (rich.held_out[i] + kFloor)));
  }
  const double mean = std::accumulate(ratios.begin(), ratios.end(), 0.0) / n;
  double squares = 0.0;
  for (const double r : ratios) squares += (r - mean) * (r - mean);
  const double error = std::sqrt(squares / (n * (n - 1.0)));
  Gain gain;
  gain.px = simple.heldOutPx() - rich.heldOutPx();
  gain.share = gain.px / std::max(1e-12, simple.heldOutPx());
  gain.sigmas = mean / std::max(1e-12, error);
  return gain;
}

bool convincing(const Gain& gain, Distortion rich, const StereoCalibrationOptions& options) {
  const bool rational = rich == Distortion::kRationalP1P2;
  return gain.px > kSmallestGainPx &&
         gain.share >= options.min_gain * (rational ? kRationalGainFactor : 1.0) &&
         gain.sigmas >= options.min_gain_sigmas * (rational ? kRationalSigmaFactor : 1.0);
}

std::string gainText(const Gain& gain) {
  char text[96];
  std::snprintf(text, sizeof text, "held-out error %+.1f %% (%.1f sigma)", -100.0 * gain.share,
                gain.sigmas);
  return text;
}

/// Adds the score of one model; the candidate only if it can be taken.
std::optional<Candidate> tryModel(const Views& views, const Board& board, cv::Size size,
                                  Distortion distortion, int threads,
                                  std::vector<ModelScore>& scores) {
  ModelScore& score = scores.emplace_back();
  score.distortion = distortion;
  score.verdict = "does not converge";
  const auto fit = fitStereo(views, board, size, distortion, nullptr);
  if (!fit) return std::nullopt;
  score.rms_px = fit->rms_px;
  score.verdict = "turns back inside the picture";
  if (!oneToOne(*fit, size)) return std::nullopt;
  auto candidate = crossValidate(views, board, size, *fit, threads);
  if (!candidate) {
    score.verdict = "does not converge without some views";
    return std::nullopt;
  }
  score.held_out_px = candidate->heldOutPx();
  score.corner_sigma_px = candidate->corner_sigma_px;
  if (!std::all_of(candidate->without.begin(), candidate->without.end(),
                   [&](const StereoFit& without) { return oneToOne(without, size); })) {
    score.verdict = "turns back inside the picture without some views";
    return std::nullopt;
  }
  score.verdict.clear();
  return candidate;
}

std::vector<Distortion> modelsToTry(Distortion wanted) {
  if (wanted != Distortion::kAutomatic) return {wanted};
  return {Distortion::kK1, Distortion::kK1K2, Distortion::kK1K2P1P2, Distortion::kK1K2P1P2K3,
          Distortion::kRationalP1P2};
}

}  // namespace

double Candidate::heldOutPx() const {
  return std::sqrt(std::accumulate(held_out.begin(), held_out.end(), 0.0) /
                   static_cast<double>(held_out.size()));
}

double jackknifeSigma(const std::vector<double>& values) {
  const double n = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double squares = 0.0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return std::sqrt((n - 1.0) / n * squares);
}

std::optional<Candidate> crossValidate(const Views& views, const Board& board, cv::Size size,
                                       const StereoFit& fit, int threads) {
  const std::size_t groups = std::min(views.size(), kMostGroups);
  std::vector<std::optional<StereoFit>> fits(groups);
  Candidate candidate;
  candidate.fit = fit;
  candidate.held_out.resize(views.size());
  parallelFor(groups, 1, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      fits[g] = fitStereo(withoutGroup(views, g, groups), board, size, fit.distortion, &fit);
      if (!fits[g]) continue;
      for (std::size_t i = g; i < views.size(); i += groups) {
        candidate.held_out[i] = fitBoard(*views[i], board, *fits[g]).meanSquare();
      }
    }
  });
  for (const auto& without : fits) {
    if (!without) return std::nullopt;
    candidate.without.push_back(*without);
  }
  candidate.corner_sigma_px = cornerSigma(candidate.without, size);
  return candidate;
}

Result<Choice> chooseModel(const Views& views, const Board& board, cv::Size size,
                           const StereoCalibrationOptions& options, int threads) {
  Choice choice;
  std::optional<Candidate> best;
  std::size_t best_score = 0;
  for (const Distortion distortion : modelsToTry(options.distortion)) {
    const auto candidate = tryModel(views, board, size, distortion, threads, choice.scores);
    if (!candidate) continue;
    ModelScore& score = choice.scores.back();
    if (best) {
      const Gain gain = gainOf(*best, *candidate);
      score.verdict = gainText(gain) + ": no evidence";
      if (!convincing(gain, distortion, options)) continue;
      choice.scores[best_score].verdict = std::string(toString(distortion)) + ": " + gainText(gain);
    }
    best = candidate;
    best_score = choice.scores.size() - 1;
  }
  if (!best) {
    return Status(StatusCode::kNoConvergence,
                  std::string("no distortion model can be taken (") +
                      toString(choice.scores.back().distortion) + " " +
                      choice.scores.back().verdict +
                      "): take pictures with the board near the edges and corners too");
  }
  choice.scores[best_score].verdict = "chosen";
  choice.chosen = *best;
  return choice;
}

std::optional<LeftOut> findOutlier(const Views& views, const Board& board, cv::Size size,
                                   const StereoFit& fit, const StereoCalibrationOptions& options,
                                   int threads) {
  // A bad view bends the fit of all, so it need not be the worst of them: of the worst few, take
  // the one without which the others fit best.
  constexpr std::size_t kSuspects = 6;
  if (views.size() < 4) return std::nullopt;
  std::vector<std::pair<double, std::size_t>> errors;
  for (std::size_t i = 0; i < views.size(); ++i) {
    errors.emplace_back(-fitBoard(*views[i], board, fit).meanSquare(), i);
  }
  std::sort(errors.begin(), errors.end());
  const std::size_t suspects = std::min(kSuspects, errors.size());
  std::vector<std::optional<LeftOut>> trials(suspects);
  parallelFor(suspects, 1, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      Views others = views;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(errors[s].second));
      const auto without = fitStereo(others, board, size, fit.distortion, nullptr);
      if (!without) continue;
      const double miss = fitBoard(*views[errors[s].second], board, *without).meanSquare();
      trials[s] = LeftOut{errors[s].second, std::sqrt(miss), without->rms_px};
    }
  });
  std::optional<LeftOut> best;
  for (const auto& trial : trials) {
    if (trial && (!best || trial->others_px < best->others_px)) best = trial;
  }
  if (!best || best->miss_px < options.outlier_min_px ||
      best->miss_px < options.outlier_factor * best->others_px) {
    return std::nullopt;
  }
  return best;
}

}  // namespace scanner::calibration
