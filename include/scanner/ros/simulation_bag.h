#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "scanner/core/status.h"
#include "scanner/simulation/simulation.h"

namespace scanner::bridge {

/// Pictures of only some views, in their order; the samples of the inertial sensor are kept whole.
struct SimulationBagOptions {
  int first_view = 0;
  int last_view = -1;       ///< -1: the last one of the motion
  bool compressed = false;  ///< bz2, per chunk
};

/// Writes a simulated scan as a bag with the scanner's raw topics, /tf_static and
/// /ground_truth/pose. Same simulation, same bytes. kIoError in one line; `progress(done, total)`
/// is called per view and may return false to stop, which leaves no bag.
Status writeSimulation(const simulation::Simulation& simulation, const std::string& bag_path,
                       const SimulationBagOptions& options = {},
                       const std::function<bool(std::size_t, std::size_t)>& progress = {});

}  // namespace scanner::bridge
