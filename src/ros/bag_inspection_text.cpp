#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "scanner/ros/bag_inspection.h"

namespace scanner::bridge {
namespace {

using Json = nlohmann::ordered_json;

void writeTopic(std::ostream& out, const TopicStatistics& t) {
  out << "  " << std::left << std::setw(30) << t.topic << std::right << std::setw(7) << t.messages
      << " messages " << std::setw(8) << std::setprecision(2) << t.rate_hz << " Hz  gaps " << t.gaps
      << " (longest " << std::setprecision(3) << t.longest_gap_s << " s)  backward " << t.backward
      << "  unusable " << t.unusable << "  delay " << std::setprecision(3) << t.mean_delay_s
      << " s\n";
}

void writeExposure(std::ostream& out, const char* side, const ExposureSummary& e) {
  out << "  " << side << " brightness " << std::setprecision(0) << e.mean << ", saturated "
      << std::setprecision(2) << 100.0 * e.saturated_share << " %, black " << 100.0 * e.black_share
      << " %\n";
}

Json topicJson(const TopicStatistics& t) {
  return {{"topic", t.topic},
          {"messages", t.messages},
          {"rate_hz", t.rate_hz},
          {"gaps", t.gaps},
          {"longest_gap_s", t.longest_gap_s},
          {"backward", t.backward},
          {"unusable", t.unusable},
          {"mean_delay_s", t.mean_delay_s},
          {"max_delay_s", t.max_delay_s},
          {"first_ns", toNanoseconds(t.first)},
          {"last_ns", toNanoseconds(t.last)}};
}

Json exposureJson(const ExposureSummary& e) {
  return {{"mean", e.mean}, {"saturated_share", e.saturated_share}, {"black_share", e.black_share}};
}

}  // namespace

std::string toText(const BagInspection& in) {
  std::ostringstream out;
  out << std::fixed;
  out << in.bag << '\n';
  const BagStatistics& s = in.statistics;
  if (s.left.messages + s.right.messages + s.imu.messages > 0) {
    out << "topics\n";
    for (const TopicStatistics* t : {&s.left, &s.right, &s.imu, &s.ground_truth}) {
      if (t->messages > 0) writeTopic(out, *t);
    }
    out << "pairs\n  " << s.frames << " pairs of equal stamp, unpaired " << s.unpaired_left
        << " left, " << s.unpaired_right << " right; without camera_info " << s.images_without_info
        << "; unreadable messages " << s.unreadable << '\n';
    out << "exposure\n";
    writeExposure(out, "left ", in.left);
    writeExposure(out, "right", in.right);
    out << "inertial\n  mean acceleration " << std::setprecision(2) << in.inertial.mean_acceleration
        << " (m/s^2: 9.81), 95 % of the rates below " << in.inertial.rate_percentile_95
        << ", orientation in " << std::setprecision(0) << 100.0 * in.inertial.oriented_share
        << " % of the samples, " << in.inertial.frames_covered << " of " << s.frames
        << " pairs covered\n";
  }
  if (in.calibration) {
    const StereoCalibration& c = *in.calibration;
    out << "calibration\n  " << c.left.width << "x" << c.left.height << ", f "
        << std::setprecision(2) << c.focalLength() << " px, baseline " << 1e3 * c.baseline()
        << " mm, " << c.left.distortion_model << '\n';
  }
  out << "rig\n  " << (in.rig ? "from /tf_static" : "not in the bag") << '\n';
  if (in.far_m > 0.0) {
    out << "scene\n  depths " << std::setprecision(2) << in.near_m << ".." << in.far_m << " m\n";
    for (const SuitabilitySummary& c : in.suitability) {
      out << "  " << std::left << std::setw(10) << c.config << std::right << std::setprecision(2)
          << c.min_depth_m << ".." << c.max_depth_m << " m holds " << std::setprecision(0)
          << 100.0 * c.share << " % of the disparities\n";
    }
  }
  for (const std::string& line : in.warnings) out << "warning: " << line << '\n';
  for (const std::string& line : in.problems) out << "problem: " << line << '\n';
  out << (in.scannable() ? "can be scanned\n" : "cannot be scanned\n");
  return out.str();
}

std::string toJson(const BagInspection& in) {
  const BagStatistics& s = in.statistics;
  Json out = {{"bag", in.bag},
              {"scannable", in.scannable()},
              {"problems", in.problems},
              {"warnings", in.warnings},
              {"left", topicJson(s.left)},
              {"right", topicJson(s.right)},
              {"imu", topicJson(s.imu)},
              {"ground_truth", topicJson(s.ground_truth)}};
  out["pairs"] = {{"total", s.frames},
                  {"unpaired_left", s.unpaired_left},
                  {"unpaired_right", s.unpaired_right},
                  {"without_camera_info", s.images_without_info},
                  {"calibration_changes", s.calibration_changes},
                  {"unreadable", s.unreadable}};
  out["exposure"] = {{"left", exposureJson(in.left)}, {"right", exposureJson(in.right)}};
  out["inertial"] = {{"mean_acceleration", in.inertial.mean_acceleration},
                     {"rate_percentile_95", in.inertial.rate_percentile_95},
                     {"rate_scale", in.inertial.rate_scale},
                     {"oriented_share", in.inertial.oriented_share},
                     {"pairs_covered", in.inertial.frames_covered}};
  out["calibration"] = nullptr;
  if (in.calibration) {
    out["calibration"] = {{"width", in.calibration->left.width},
                          {"height", in.calibration->left.height},
                          {"focal_length_px", in.calibration->focalLength()},
                          {"baseline_m", in.calibration->baseline()}};
  }
  out["rig_in_bag"] = in.rig.has_value();
  out["scene"] = {{"near_m", in.near_m}, {"far_m", in.far_m}};
  out["configurations"] = Json::array();
  for (const SuitabilitySummary& c : in.suitability) {
    out["configurations"].push_back({{"name", c.config},
                                     {"min_depth_m", c.min_depth_m},
                                     {"max_depth_m", c.max_depth_m},
                                     {"share", c.share}});
  }
  return out.dump(2) + "\n";
}

}  // namespace scanner::bridge
