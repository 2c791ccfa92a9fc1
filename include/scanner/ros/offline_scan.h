#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "scanner/evaluation/report.h"

namespace scanner::bridge {

/// What `scan_bag` was asked to do.
struct OfflineScanRequest {
  std::string bag;
  std::string config = "field";  ///< a name in config/, or a file
  std::string rig;               ///< a rig file; empty: the bag's /tf_static
  std::string out;               ///< scan folder
  int threads = 1;
};

/// Called after every frame: frames done, frames expected, views registered.
using OfflineScanProgress = std::function<void(std::size_t, std::size_t, std::size_t)>;

/// Runs the whole pipeline on a recording and fills the scan folder; the same bytes for every
/// thread count. Throws ConfigurationError, with one line that names the thing, for a bag, rig,
/// calibration or configuration that cannot be scanned with, and for an output folder that cannot
/// be written. When `stop` becomes true the recording ends there: what was read is registered and
/// meshed.
evaluation::ScanReport scanBag(const OfflineScanRequest& request,
                               const OfflineScanProgress& progress, const std::atomic<bool>& stop);

}  // namespace scanner::bridge
