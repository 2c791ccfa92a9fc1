#include "scanner/core/trajectory_io.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "scanner/core/ply.h"

namespace scanner {
namespace {

constexpr double kUnitTolerance = 1e-3;

/// "1731500000.25" to nanoseconds without passing through a double, which keeps 0.2 us only.
bool parseStamp(const std::string& text, Time* stamp) {
  const std::size_t dot = text.find('.');
  const std::string whole = text.substr(0, dot);
  std::string fraction = dot == std::string::npos ? "" : text.substr(dot + 1);
  const auto digits = [](const std::string& s) {
    return !s.empty() &&
           std::all_of(s.begin(), s.end(), [](char c) { return c >= '0' && c <= '9'; });
  };
  if (!digits(whole) || whole.size() > 10 || (!fraction.empty() && !digits(fraction))) return false;
  fraction.resize(9, '0');
  *stamp = fromNanoseconds(std::stoll(whole) * 1000000000LL + std::stoll(fraction));
  return true;
}

Status parseLine(const std::string& line, StampedPose* pose) {
  std::istringstream in(line);
  std::string stamp;
  double v[7];
  in >> stamp;
  for (double& value : v) in >> value;
  std::string rest;
  if (in.fail() || (in >> rest)) {
    return {StatusCode::kInvalidInput, "expected 'stamp tx ty tz qx qy qz qw'"};
  }
  if (!parseStamp(stamp, &pose->stamp)) {
    return {StatusCode::kInvalidInput, "bad stamp '" + stamp + "'"};
  }
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  const bool unit = std::abs(q.norm() - 1.0) <= kUnitTolerance;
  if (!unit ||
      !std::all_of(std::begin(v), std::end(v), [](double x) { return std::isfinite(x); })) {
    return {StatusCode::kInvalidInput, "the quaternion is not a unit quaternion or a value is NaN"};
  }
  pose->T_map_base = makePose({v[0], v[1], v[2]}, q);
  return Status::ok();
}

}  // namespace

Status writeTum(const std::string& path, const Trajectory& trajectory) {
  std::string text = "# stamp tx ty tz qx qy qz qw\n";
  for (const StampedPose& pose : trajectory) {
    const std::int64_t ns = toNanoseconds(pose.stamp);
    const Eigen::Vector3d t = pose.T_map_base.translation();
    Eigen::Quaterniond q(pose.T_map_base.linear());
    if (q.w() < 0.0) q.coeffs() = -q.coeffs();  // one text per rotation
    char line[256];
    std::snprintf(line, sizeof line,
                  "%" PRId64 ".%09" PRId64 " %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", ns / 1000000000,
                  ns % 1000000000, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    text += line;
  }
  return writeFileAtomically(path, text);
}

Result<Trajectory> readTum(const std::string& path) {
  std::ifstream in(path);
  if (!in) return Status(StatusCode::kIoError, "cannot read " + path);
  Trajectory trajectory;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos || line[0] == '#') continue;
    const std::string where = path + ":" + std::to_string(number) + ": ";
    StampedPose pose;
    const Status status = parseLine(line, &pose);
    if (!status) return Status(status.code(), where + status.message());
    if (!trajectory.empty() && pose.stamp <= trajectory.back().stamp) {
      return Status(StatusCode::kInvalidInput, where + "time does not increase");
    }
    trajectory.push_back(pose);
  }
  return trajectory;
}

Result<Eigen::Isometry3d> poseAt(const Trajectory& trajectory, Time stamp, Duration max_gap) {
  const auto after =
      std::lower_bound(trajectory.begin(), trajectory.end(), stamp,
                       [](const StampedPose& pose, Time t) { return pose.stamp < t; });
  if (after != trajectory.end() && after->stamp == stamp) return after->T_map_base;
  if (after == trajectory.begin() || after == trajectory.end()) {
    return Status(StatusCode::kOutOfRange, "no pose: the time lies outside the trajectory");
  }
  const auto before = after - 1;
  if (after->stamp - before->stamp > max_gap) {
    return Status(StatusCode::kOutOfRange,
                  "no pose: the time lies in a gap of " +
                      std::to_string(toSeconds(after->stamp - before->stamp)) + " s");
  }
  const double s = toSeconds(stamp - before->stamp) / toSeconds(after->stamp - before->stamp);
  return interpolate(before->T_map_base, after->T_map_base, s);
}

}  // namespace scanner
