#include "scanner/registration/icp.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <string>

namespace scanner::registration {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegrees = 180.0 / kPi;
constexpr std::size_t kMinPairs = 6;  // as many as unknowns
constexpr double kIndependentPairs = 100.0;
constexpr double kPriorRotationSigma = 3.0 / kDegrees;  // published attitude error, table 5.3

double medianOf(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::string millimetres(double metres) {
  std::string text = std::to_string(metres * 1e3);
  return text.substr(0, text.find('.') + 3) + " mm";
}

std::vector<double> pairWeights(const std::vector<Correspondence>& pairs,
                                const std::vector<double>& residuals, const IcpOptions& options) {
  std::vector<double> weights(pairs.size(), 1.0);
  if (options.sigma_weights) {
    std::vector<double> sigmas;
    sigmas.reserve(pairs.size());
    for (const Correspondence& pair : pairs) sigmas.push_back(pair.sigma);
    const double typical = medianOf(sigmas);
    // Between 0 and 2, so that no single pair can take over.
    for (std::size_t i = 0; typical > 0.0 && i < pairs.size(); ++i) {
      const double ratio = pairs[i].sigma / typical;
      weights[i] = 2.0 / (1.0 + ratio * ratio);
    }
  }
  if (options.kernel == RobustKernel::kNone) return weights;
  std::vector<double> sizes;
  sizes.reserve(residuals.size());
  for (double r : residuals) sizes.push_back(std::abs(r));
  const double width = options.kernel_scale * std::max(1.4826 * medianOf(sizes), 1e-9);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double u = std::abs(residuals[i]) / width;
    if (options.kernel == RobustKernel::kHuber) {
      weights[i] *= u <= 1.0 ? 1.0 : 1.0 / u;
    } else {
      weights[i] *= u < 1.0 ? (1.0 - u * u) * (1.0 - u * u) : 0.0;
    }
  }
  return weights;
}

std::vector<Eigen::Vector3d> place(const std::vector<Correspondence>& pairs, const Moving& moving,
                                   const Eigen::Isometry3d& T_ref_mov) {
  std::vector<Eigen::Vector3d> placed;
  placed.reserve(pairs.size());
  for (const Correspondence& pair : pairs) {
    placed.push_back(T_ref_mov * moving.samples.points[pair.moving].cast<double>());
  }
  return placed;
}

Eigen::Isometry3d stepPointToPoint(const std::vector<Correspondence>& pairs,
                                   const std::vector<Eigen::Vector3d>& placed, Variant variant) {
  if (variant == Variant::kTranslational) {
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < pairs.size(); ++i) shift += pairs[i].reference - placed[i];
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() = shift / static_cast<double>(pairs.size());
    return T;
  }
  std::vector<Eigen::Vector3d> to;
  to.reserve(pairs.size());
  for (const Correspondence& pair : pairs) to.push_back(pair.reference);
  return alignPointToPoint(placed, to).value();  // kMinPairs was checked
}

// State of one run, so that matching, measuring and judging share what they need.
class Run {
 public:
  Run(const Reference& reference, const Moving& moving, const Eigen::Isometry3d& T_prior,
      const IcpOptions& options, const CorrespondenceOptions& correspondence, int threads)
      : reference_(reference),
        moving_(moving),
        T_prior_(T_prior),
        options_(options),
        correspondence_(correspondence),
        threads_(threads),
        spacing_(spacingOf(reference)) {
    result_.accept_mean_m = options.accept_mean_m > 0.0 ? options.accept_mean_m : automaticAccept();
    overlap_distance_ =
        options.overlap_distance_m > 0.0 ? options.overlap_distance_m : 2.0 * result_.accept_mean_m;
    for (const Eigen::Vector3f& p : moving.samples.points) centre_ += p.cast<double>();
    centre_ /= static_cast<double>(std::max<std::size_t>(1, moving.samples.size()));
  }

  IcpResult run(const Eigen::Isometry3d& T_start, Variant variant) {
    result_.T_ref_mov = T_start;
    if (reference_.empty() || moving_.samples.size() < kMinPairs || !isFinite(T_start)) {
      return fail(StatusCode::kNotEnoughData, "too few samples to register");
    }
    for (int i = 0; i < options_.max_iterations; ++i) {
      if (!match(i)) return fail(StatusCode::kNoOverlap, "fewer than 6 compatible pairs");
      const Eigen::Isometry3d motion = step(variant);
      const Eigen::Isometry3d before = result_.T_ref_mov;
      result_.T_ref_mov = orthonormal(motion * before);
      ++result_.iterations;
      if (options_.stop == StopRule::kAtThreshold) {
        measure();
        if (judge()) break;
      } else if (settled(before)) {
        break;
      }
    }
    if (options_.stop == StopRule::kAtConvergence) {
      if (!match(options_.max_iterations)) {
        return fail(StatusCode::kNoOverlap, "fewer than 6 compatible pairs");
      }
      measure();
    }
    result_.status = judge();
    result_.accepted = result_.status.isOk();
    describeGeometry(variant);
    return result_;
  }

 private:
  double automaticAccept() const {
    std::vector<double> sigmas(moving_.samples.sigmas.begin(), moving_.samples.sigmas.end());
    return 1.5 * spacing_ + medianOf(sigmas);
  }

  IcpResult fail(StatusCode code, const char* why) {
    result_.accepted = false;
    result_.mean_distance_m = 0.0;
    result_.status = Status(code, why);
    return result_;
  }

  bool match(int iteration) {
    double bound = 0.0;
    if (options_.distance_start_m > 0.0) {
      const double floor =
          options_.distance_floor_m > 0.0 ? options_.distance_floor_m : 3.0 * spacing_;
      bound =
          std::max(floor, options_.distance_start_m * std::pow(options_.distance_decay, iteration));
    }
    pairs_ = findCorrespondences(reference_, moving_, result_.T_ref_mov, correspondence_, bound,
                                 threads_);
    kept_ = rejectDistant(pairs_, correspondence_.rejection_factor);
    result_.pairs = pairs_.size();
    result_.inliers = kept_.size();
    return kept_.size() >= kMinPairs;
  }

  Eigen::Isometry3d step(Variant variant) const {
    const auto placed = place(kept_, moving_, result_.T_ref_mov);
    if (options_.metric == Metric::kPointToPoint) return stepPointToPoint(kept_, placed, variant);
    return solvePointToPlane(kept_, placed, variant, options_).motion;
  }

  // Products of rotations drift off SO(3) by rounding only; 10 to 100 of them stay near 1e-14.
  static Eigen::Isometry3d orthonormal(const Eigen::Isometry3d& T) {
    return makePose(T.translation(), Eigen::Quaterniond(T.linear()).normalized());
  }

  bool settled(const Eigen::Isometry3d& before) const {
    const double moved = (result_.T_ref_mov * centre_ - before * centre_).norm();
    const double turned = rotationAngle(before.inverse() * result_.T_ref_mov);
    return moved <= options_.converged_translation_m &&
           turned * kDegrees <= options_.converged_rotation_deg;
  }

  void measure() {
    double sum = 0.0;
    double plane = 0.0;
    const auto placed = place(kept_, moving_, result_.T_ref_mov);
    for (std::size_t i = 0; i < kept_.size(); ++i) {
      sum += (placed[i] - kept_[i].reference).norm();
      plane += std::abs(kept_[i].normal.dot(placed[i] - kept_[i].reference));
    }
    result_.mean_distance_m = sum / static_cast<double>(kept_.size());
    result_.mean_plane_distance_m = plane / static_cast<double>(kept_.size());
    std::size_t near = 0;
    for (const Correspondence& pair : pairs_) {
      const Eigen::Vector3d p =
          result_.T_ref_mov * moving_.samples.points[pair.moving].cast<double>();
      near += (p - pair.reference).norm() <= overlap_distance_ ? 1 : 0;
    }
    result_.overlap = static_cast<double>(near) / static_cast<double>(moving_.samples.size());
  }

  Status judge() const {
    const double mean = result_.mean_distance_m;
    if (!isFinite(result_.T_ref_mov) || !(mean <= result_.accept_mean_m)) {
      return {StatusCode::kNoConvergence, "mean distance " + millimetres(mean) + " is above " +
                                              millimetres(result_.accept_mean_m)};
    }
    if (options_.accept_plane_m > 0.0 && result_.mean_plane_distance_m > options_.accept_plane_m) {
      return {StatusCode::kNoConvergence, "mean plane distance " +
                                              millimetres(result_.mean_plane_distance_m) +
                                              " is above " + millimetres(options_.accept_plane_m)};
    }
    if (result_.overlap < options_.min_overlap) {
      return {StatusCode::kNoOverlap, "overlap " + std::to_string(result_.overlap) + " is below " +
                                          std::to_string(options_.min_overlap)};
    }
    const double turned = rotationAngle(T_prior_.inverse() * result_.T_ref_mov) * kDegrees;
    if (options_.max_rotation_deg > 0.0 && turned > options_.max_rotation_deg) {
      return {StatusCode::kOutOfRange,
              "turned " + std::to_string(turned) + " deg away from the prior"};
    }
    const double moved = (result_.T_ref_mov * centre_ - T_prior_ * centre_).norm();
    if (options_.max_translation_m > 0.0 && moved > options_.max_translation_m) {
      return {StatusCode::kOutOfRange, "moved " + millimetres(moved) + " away from the prior"};
    }
    return Status::ok();
  }

  // What the kept pairs say about T_ref_mov, whatever metric found it.
  void describeGeometry(Variant variant) {
    IcpOptions plain = options_;
    plain.kernel = RobustKernel::kNone;
    plain.sigma_weights = false;
    const auto placed = place(kept_, moving_, result_.T_ref_mov);
    const PlaneStep geometry = solvePointToPlane(kept_, placed, Variant::kFull, plain);
    result_.min_eigenvalue = geometry.min_eigenvalue;
    result_.degenerate_directions = geometry.degenerate_directions;
    double radius = 0.0;
    for (const Eigen::Vector3d& p : placed) radius += (p - geometry.centre).squaredNorm();
    radius = std::sqrt(std::max(1e-12, radius / static_cast<double>(placed.size())));

    Twist scale;
    scale << 1.0, 1.0, 1.0, 1.0 / radius, 1.0 / radius, 1.0 / radius;
    const Matrix6 scaled =
        scale.asDiagonal() * (geometry.normal_matrix / geometry.weight) * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Matrix6> solver(scaled);
    const Twist values = solver.eigenvalues().cwiseMax(std::max(1e-6, options_.degenerate_below));
    // Stopped at the threshold, the result is known to about the threshold and no better, however
    // many pairs there are; and what was only shifted has the rotation of the prior.
    const bool early = options_.stop == StopRule::kAtThreshold;
    const double sigma = std::max({result_.mean_plane_distance_m, 0.02 * spacing_, 1e-6,
                                   early ? result_.accept_mean_m : 0.0});
    const double variance = sigma * sigma / (early ? 1.0 : kIndependentPairs);
    Matrix6 covariance = variance * (scale.asDiagonal() * solver.eigenvectors() *
                                     values.cwiseInverse().asDiagonal() *
                                     solver.eigenvectors().transpose() * scale.asDiagonal());
    if (variant == Variant::kTranslational) {
      covariance.bottomRightCorner<3, 3>() +=
          Eigen::Matrix3d::Identity() * kPriorRotationSigma * kPriorRotationSigma;
    }
    // d e / d [t; w], see pose_graph.h; w turns about the centre of the pairs.
    const Eigen::Matrix3d R = result_.T_ref_mov.linear();
    Matrix6 A = Matrix6::Identity();
    A.topRightCorner<3, 3>() = -skew(result_.T_ref_mov.translation() - geometry.centre);
    A.bottomRightCorner<3, 3>() = R.transpose();
    const Matrix6 information = (A * covariance * A.transpose()).inverse();
    result_.information = 0.5 * (information + information.transpose());
  }

  const Reference& reference_;
  const Moving& moving_;
  const Eigen::Isometry3d T_prior_;
  const IcpOptions& options_;
  const CorrespondenceOptions& correspondence_;
  const int threads_;
  const double spacing_;
  double overlap_distance_ = 0.0;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  std::vector<Correspondence> pairs_;
  std::vector<Correspondence> kept_;
  IcpResult result_;
};

}  // namespace

Result<Eigen::Isometry3d> alignPointToPoint(const std::vector<Eigen::Vector3d>& from,
                                            const std::vector<Eigen::Vector3d>& to) {
  if (from.size() != to.size() || from.size() < 3) {
    return Status(StatusCode::kNotEnoughData, "a rigid motion needs at least 3 pairs of points");
  }
  const double n = static_cast<double>(from.size());
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    from_mean += from[i];
    to_mean += to[i];
  }
  from_mean /= n;
  to_mean /= n;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    covariance += (to[i] - to_mean) * (from[i] - from_mean).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) sign.z() = -1.0;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  T.translation() = to_mean - T.linear() * from_mean;
  if (!isFinite(T)) return Status(StatusCode::kInvalidInput, "a point is not finite");
  return T;
}

PlaneStep solvePointToPlane(const std::vector<Correspondence>& pairs,
                            const std::vector<Eigen::Vector3d>& placed, Variant variant,
                            const IcpOptions& options) {
  PlaneStep step;
  if (pairs.empty()) return step;
  std::vector<double> residuals(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    residuals[i] = pairs[i].normal.dot(placed[i] - pairs[i].reference);
    step.centre += placed[i];
  }
  step.centre /= static_cast<double>(pairs.size());
  double radius = 0.0;
  for (const Eigen::Vector3d& p : placed) radius += (p - step.centre).squaredNorm();
  radius = std::sqrt(std::max(1e-12, radius / static_cast<double>(placed.size())));

  const std::vector<double> weights = pairWeights(pairs, residuals, options);
  Twist gradient = Twist::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    Twist J;
    J << pairs[i].normal, (placed[i] - step.centre).cross(pairs[i].normal);
    step.normal_matrix += weights[i] * J * J.transpose();
    gradient += weights[i] * residuals[i] * J;
    step.weight += weights[i];
  }
  if (!(step.weight > 0.0)) return step;

  // Rotations as arcs at the radius of the data, so that all six eigenvalues compare.
  Twist scale;
  scale << 1.0, 1.0, 1.0, 1.0 / radius, 1.0 / radius, 1.0 / radius;
  const Matrix6 H = scale.asDiagonal() * step.normal_matrix * scale.asDiagonal() / step.weight;
  const Twist g = scale.asDiagonal() * gradient / step.weight;
  const int unknowns = variant == Variant::kFull ? 6 : 3;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(H.topLeftCorner(unknowns, unknowns));
  step.min_eigenvalue = solver.eigenvalues()(0);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(unknowns);
  for (int k = 0; k < unknowns; ++k) {
    const double value = solver.eigenvalues()(k);
    if (value < options.degenerate_below || value <= 1e-12) {
      ++step.degenerate_directions;
      continue;
    }
    const Eigen::VectorXd v = solver.eigenvectors().col(k);
    x -= v * (v.dot(g.head(unknowns)) / value);
  }
  const Eigen::Vector3d w =
      variant == Variant::kFull ? Eigen::Vector3d(x.tail(3) / radius) : Eigen::Vector3d::Zero();
  const Eigen::Quaterniond rotation = expSo3(w);
  step.motion = makePose(step.centre - rotation * step.centre + x.head(3), rotation);
  return step;
}

IcpResult icp(const Reference& reference, const Moving& moving, const Eigen::Isometry3d& T_start,
              const Eigen::Isometry3d& T_prior, Variant variant, const IcpOptions& options,
              const CorrespondenceOptions& correspondence, int threads) {
  return Run(reference, moving, T_prior, options, correspondence, threads).run(T_start, variant);
}

}  // namespace scanner::registration
