#include "calibration/bundle.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

namespace scanner::calibration {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr Index kPose = 6;
/// Columns of the Jacobian of cv::projectPoints(): pose, focal lengths, principal point, D.
constexpr int kIntrinsicsColumn = 6;
constexpr int kPinhole = 4;
constexpr double kStartDamping = 1e-4, kMostDamping = 1e9, kConverged = 1e-10;

/// Parameters that all views share: those of the left eye, of the right eye, and the pose between.
struct Shared {
  std::vector<int> coefficients;

  Index perEye() const { return kPinhole + static_cast<Index>(coefficients.size()); }
  Index rig() const { return 2 * perEye(); }
  Index size() const { return rig() + kPose; }
};

/// Jacobian (shared parameters, then the board's pose) and residuals of one view: left eye, then
/// right eye.
struct Linearised {
  MatrixXd J;
  VectorXd residual;
  std::array<std::vector<cv::Point2d>, 2> projected;
};

MatrixXd toEigen(const cv::Mat& matrix) {
  MatrixXd out;
  cv::cv2eigen(matrix, out);
  return out;
}

Matrix6d derivative(const cv::Mat& r_by_r, const cv::Mat& r_by_t, const cv::Mat& t_by_r,
                    const cv::Mat& t_by_t) {
  Matrix6d m;
  m << toEigen(r_by_r), toEigen(r_by_t), toEigen(t_by_r), toEigen(t_by_t);
  return m;
}

void fillResidual(const std::vector<cv::Point2f>& measured, std::size_t eye, Linearised& l) {
  const auto& projected = l.projected[eye];
  auto row = static_cast<Index>(2 * eye * measured.size());
  for (std::size_t i = 0; i < measured.size(); ++i) {
    l.residual[row++] = static_cast<double>(measured[i].x) - projected[i].x;
    l.residual[row++] = static_cast<double>(measured[i].y) - projected[i].y;
  }
}

Linearised linearise(const BoardObservation& view, const std::vector<cv::Point3d>& object,
                     const Bundle& b, const BoardPose& pose, const Shared& shared) {
  const auto rows = static_cast<Index>(2 * object.size());
  Linearised l;
  l.J = MatrixXd::Zero(2 * rows, shared.size() + kPose);
  l.residual.resize(2 * rows);
  cv::Mat r, t, rr1, rt1, rr2, rt2, tr1, tt1, tr2, tt2;
  cv::composeRT(pose.rotation, pose.translation, b.rotation, b.translation, r, t, rr1, rt1, rr2,
                rt2, tr1, tt1, tr2, tt2);
  for (std::size_t eye = 0; eye < 2; ++eye) {
    cv::Mat jacobian;
    if (eye == 0) {
      cv::projectPoints(object, pose.rotation, pose.translation, b.K[0], b.D[0], l.projected[0],
                        jacobian);
    } else {
      cv::projectPoints(object, r, t, b.K[1], b.D[1], l.projected[1], jacobian);
    }
    const MatrixXd J = toEigen(jacobian);
    auto mine = l.J.middleRows(static_cast<Index>(eye) * rows, rows);
    Index column = static_cast<Index>(eye) * shared.perEye();
    mine.middleCols(column, kPinhole) = J.middleCols(kIntrinsicsColumn, kPinhole);
    column += kPinhole;
    for (const int k : shared.coefficients) {
      mine.col(column++) = J.col(kIntrinsicsColumn + kPinhole + k);
    }
    if (eye == 0) {
      mine.rightCols<kPose>() = J.leftCols<kPose>();
    } else {
      mine.rightCols<kPose>() = J.leftCols<kPose>() * derivative(rr1, rt1, tr1, tt1);
      mine.middleCols<kPose>(shared.rig()) = J.leftCols<kPose>() * derivative(rr2, rt2, tr2, tt2);
    }
    fillResidual(corners(view, static_cast<int>(eye)), eye, l);
  }
  return l;
}

/// Normal equations of one view, in blocks.
struct ViewBlocks {
  MatrixXd mixed;  ///< shared x pose
  Matrix6d own;
  Vector6d gradient;
};

struct System {
  MatrixXd shared;
  VectorXd gradient;
  std::vector<ViewBlocks> views;
  double squares = 0.0;
};

System systemOf(const Views& views, const std::vector<cv::Point3d>& object, const Bundle& bundle,
                const Shared& shared) {
  System s;
  s.shared = MatrixXd::Zero(shared.size(), shared.size());
  s.gradient = VectorXd::Zero(shared.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Linearised l = linearise(*views[i], object, bundle, bundle.poses[i], shared);
    const MatrixXd H = l.J.transpose() * l.J;
    const VectorXd g = l.J.transpose() * l.residual;
    s.shared += H.topLeftCorner(shared.size(), shared.size());
    s.gradient += g.head(shared.size());
    s.views.push_back({H.topRightCorner(shared.size(), kPose), H.bottomRightCorner<kPose, kPose>(),
                       g.tail<kPose>()});
    s.squares += l.residual.squaredNorm();
  }
  return s;
}

template <typename Matrix>
Matrix damped(Matrix m, double damping) {
  // The smallest number keeps a parameter that no residual depends on where it is.
  m.diagonal() =
      m.diagonal() * (1.0 + damping) + decltype(m.diagonal().eval())::Constant(m.rows(), 1e-12);
  return m;
}

void step(cv::Vec3d& v, const Eigen::Ref<const VectorXd>& by) {
  for (int k = 0; k < 3; ++k) v[k] += by[k];
}

Bundle stepped(const System& s, const Bundle& from, const Shared& shared, double damping) {
  MatrixXd reduced = damped(s.shared, damping);
  VectorXd gradient = s.gradient;
  std::vector<Eigen::LDLT<Matrix6d>> own;
  for (const ViewBlocks& view : s.views) {
    own.emplace_back(damped(view.own, damping));
    reduced -= view.mixed * own.back().solve(view.mixed.transpose());
    gradient -= view.mixed * own.back().solve(view.gradient);
  }
  const VectorXd by = reduced.ldlt().solve(gradient);
  Bundle to = from;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    to.K[eye] = from.K[eye].clone();
    to.D[eye] = from.D[eye].clone();
    Index at = static_cast<Index>(eye) * shared.perEye();
    for (const auto& [row, column] :
         {std::pair(0, 0), std::pair(1, 1), std::pair(0, 2), std::pair(1, 2)}) {
      to.K[eye].at<double>(row, column) += by[at++];
    }
    for (const int k : shared.coefficients) to.D[eye].at<double>(k) += by[at++];
  }
  step(to.rotation, by.segment<3>(shared.rig()));
  step(to.translation, by.segment<3>(shared.rig() + 3));
  for (std::size_t i = 0; i < to.poses.size(); ++i) {
    const Vector6d pose = own[i].solve(s.views[i].gradient - s.views[i].mixed.transpose() * by);
    step(to.poses[i].rotation, pose.head<3>());
    step(to.poses[i].translation, pose.tail<3>());
  }
  return to;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

cv::Mat guessedCamera(const Views& views, const std::vector<cv::Point3d>& object, int eye,
                      cv::Size size) {
  std::vector<std::vector<cv::Point2f>> image;
  for (const BoardObservation* view : views) image.push_back(corners(*view, eye));
  const std::vector<std::vector<cv::Point3f>> objects(views.size(), {object.begin(), object.end()});
  cv::Mat K = cv::initCameraMatrix2D(objects, image, size, 1.0);
  // Not defined for boards all parallel to the picture, where it gives anything; a usual lens is a
  // better start.
  const double f = K.at<double>(0, 0) / size.width;
  if (!cv::checkRange(K) || f < 0.2 || f > 20.0) {
    K = (cv::Mat_<double>(3, 3) << size.width, 0, 0.5 * (size.width - 1), 0, size.width,
         0.5 * (size.height - 1), 0, 0, 1);
  }
  return K;
}

}  // namespace

std::vector<int> coefficientsOf(Distortion distortion) {
  switch (distortion) {
    case Distortion::kK1:
      return {0};
    case Distortion::kK1K2:
      return {0, 1};
    case Distortion::kK1K2P1P2:
      return {0, 1, 2, 3};
    case Distortion::kRationalP1P2:
      return {0, 1, 2, 3, 5, 6};
    case Distortion::kK1K2P1P2K3:
    case Distortion::kAutomatic:
      break;
  }
  return {0, 1, 2, 3, 4};
}

std::vector<cv::Point3d> boardPoints(const Board& board) {
  std::vector<cv::Point3d> points;
  for (int r = 0; r < board.rows; ++r) {
    for (int c = 0; c < board.columns; ++c) {
      points.emplace_back(c * board.square_m, r * board.squareHeight(), 0.0);
    }
  }
  return points;
}

BoardPose poseOf(const std::vector<cv::Point2f>& corners, const Board& board, const cv::Mat& K,
                 const cv::Mat& D) {
  BoardPose pose;
  cv::solvePnP(boardPoints(board), corners, K, D, pose.rotation, pose.translation);
  return pose;
}

std::optional<Bundle> firstGuess(const Views& views, const Board& board, cv::Size size) {
  const auto object = boardPoints(board);
  Bundle b;
  std::array<std::vector<double>, 6> between;
  try {
    for (std::size_t eye = 0; eye < 2; ++eye) {
      b.K[eye] = guessedCamera(views, object, static_cast<int>(eye), size);
      b.D[eye] = cv::Mat::zeros(1, 5, CV_64F);
    }
    for (const BoardObservation* view : views) {
      const BoardPose left = poseOf(view->left, board, b.K[0], b.D[0]);
      const BoardPose right = poseOf(view->right, board, b.K[1], b.D[1]);
      b.poses.push_back(left);
      cv::Matx33d R_left, R_right;
      cv::Rodrigues(left.rotation, R_left);
      cv::Rodrigues(right.rotation, R_right);
      const cv::Matx33d R = R_right * R_left.t();
      cv::Vec3d rotation;
      cv::Rodrigues(R, rotation);
      const cv::Vec3d translation = right.translation - R * left.translation;
      for (std::size_t k = 0; k < 3; ++k) {
        between[k].push_back(rotation[static_cast<int>(k)]);
        between[k + 3].push_back(translation[static_cast<int>(k)]);
      }
    }
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    b.rotation[static_cast<int>(k)] = median(between[k]);
    b.translation[static_cast<int>(k)] = median(between[k + 3]);
  }
  return b;
}

double adjust(const Views& views, const Board& board, Distortion distortion, Bundle& bundle) {
  constexpr int kIterations = 100;
  const Shared shared{coefficientsOf(distortion)};
  const auto object = boardPoints(board);
  System now = systemOf(views, object, bundle, shared);
  double damping = kStartDamping;
  for (int i = 0; i < kIterations && damping < kMostDamping; ++i) {
    const Bundle to = stepped(now, bundle, shared, damping);
    System next = systemOf(views, object, to, shared);
    if (!(next.squares < now.squares)) {
      damping *= 10.0;
      continue;
    }
    const bool converged = now.squares - next.squares < kConverged * now.squares;
    bundle = to;
    now = std::move(next);
    damping = std::max(1e-12, 0.1 * damping);
    if (converged) break;
  }
  return now.squares;
}

double adjustPose(const BoardObservation& view, const Board& board, const Bundle& bundle,
                  BoardPose& pose, std::array<std::vector<cv::Point2d>, 2>& projected) {
  constexpr int kIterations = 50;
  const Shared shared{{}};
  const auto object = boardPoints(board);
  Linearised now = linearise(view, object, bundle, pose, shared);
  double damping = kStartDamping;
  for (int i = 0; i < kIterations && damping < kMostDamping; ++i) {
    const MatrixXd J = now.J.rightCols<kPose>();
    const Matrix6d H = J.transpose() * J;
    const Vector6d by = damped(H, damping).ldlt().solve(J.transpose() * now.residual);
    BoardPose to = pose;
    step(to.rotation, by.head<3>());
    step(to.translation, by.tail<3>());
    Linearised next = linearise(view, object, bundle, to, shared);
    const double before = now.residual.squaredNorm(), after = next.residual.squaredNorm();
    if (!(after < before)) {
      damping *= 10.0;
      continue;
    }
    pose = to;
    now = std::move(next);
    damping = std::max(1e-12, 0.1 * damping);
    if (before - after < kConverged * before) break;
  }
  projected = now.projected;
  return now.residual.squaredNorm();
}

}  // namespace scanner::calibration
