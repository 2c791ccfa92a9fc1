#pragma once

#include <string>
#include <vector>

#include "scanner/evaluation/pose_error.h"
#include "scanner/simulation/motion.h"

namespace scanner::simulation {

/// Motion of base_link from picture to picture, in the columns of thesis table 5.2.
struct MotionStatistics {
  std::vector<evaluation::MotionRow> rows;
  evaluation::MotionSummary summary;
};

/// For the pictures that the motion was made for: firstViewTime() and every 1 / view_rate_hz.
MotionStatistics motionStatistics(const Motion& motion, const MotionOptions& options);

/// Median, mean and sigma of every column beside those of table 5.2, as text for people.
std::string motionTable(const std::string& name, const MotionStatistics& statistics);

}  // namespace scanner::simulation
