#include "scanner/simulation/motion_statistics.h"

#include <array>
#include <cstdio>

namespace scanner::simulation {
namespace {

using evaluation::MotionSummary;
using evaluation::Statistics;

/// One column of the table: what the thesis printed under it (table 5.2).
struct Column {
  const char* name;
  Statistics MotionSummary::*ours;
  int decimals;
  double median;
  double mean;
  double sigma;
};

const std::array<Column, 8>& columns() {
  static const std::array<Column, 8> kColumns = {{
      {"arc (deg)", &MotionSummary::arc_deg, 2, 8.6054, 8.7313, 4.4186},
      {"roll (deg)", &MotionSummary::roll_deg, 2, 0.0028, -0.0561, 1.0970},
      {"pitch (deg)", &MotionSummary::pitch_deg, 2, 8.5741, 8.1333, 4.3835},
      {"yaw (deg)", &MotionSummary::yaw_deg, 2, 1.7563, 1.9479, 1.7852},
      {"rho (m)", &MotionSummary::rho_m, 4, 0.1031, 0.0993, 0.0311},
      {"x (m)", &MotionSummary::x_m, 4, 0.0970, 0.0961, 0.0313},
      {"y (m)", &MotionSummary::y_m, 4, 0.0027, 0.0040, 0.0167},
      {"z (m)", &MotionSummary::z_m, 4, 0.0115, 0.0097, 0.0146},
  }};
  return kColumns;
}

}  // namespace

MotionStatistics motionStatistics(const Motion& motion, const MotionOptions& options) {
  Trajectory trajectory;
  for (int view = 0; view < options.views; ++view) {
    const double time_s = firstViewTime(options) + view / options.view_rate_hz;
    trajectory.push_back({Time(fromSeconds(time_s)), motion.at(time_s).T_map_base});
  }
  MotionStatistics statistics;
  statistics.rows = evaluation::motionsBetweenNeighbours(trajectory);
  statistics.summary = evaluation::summarize(statistics.rows);
  return statistics;
}

std::string motionTable(const std::string& name, const MotionStatistics& statistics) {
  std::array<char, 160> line{};
  const auto text = [&](int length) {
    return std::string(line.data(), static_cast<std::size_t>(length));
  };
  std::string table = text(std::snprintf(line.data(), line.size(), "%-12s%30s%30s\n", name.c_str(),
                                         "median      mean     sigma", "table 5.2"));
  for (const Column& column : columns()) {
    const Statistics& ours = statistics.summary.*column.ours;
    const int d = column.decimals;
    table +=
        text(std::snprintf(line.data(), line.size(), "%-12s%10.*f%10.*f%10.*f%10.*f%10.*f%10.*f\n",
                           column.name, d, ours.median, d, ours.mean, d, ours.sigma, d,
                           column.median, d, column.mean, d, column.sigma));
  }
  return table +
         "Arc and rho compare; the other columns depend on the frame: here the map, whose x and y\n"
         "change sign on the way round, in the table one that turns with the camera.\n";
}

}  // namespace scanner::simulation
