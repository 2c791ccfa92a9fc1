#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "scanner/simulation/simulation.h"

namespace scanner::simulation {

/// Renders the views of a simulation in the background, in order, and keeps them (as half floats,
/// about 10 MB for a view of 1024x768), so that they can be shown when their time comes.
/// Thread-safe. `simulation` must outlive it.
class FrameStore {
 public:
  explicit FrameStore(const Simulation& simulation);
  /// Stops after the view that is being rendered.
  ~FrameStore();
  FrameStore(const FrameStore&) = delete;
  FrameStore& operator=(const FrameStore&) = delete;

  int rendered() const;  ///< how many views are there
  bool has(int view) const;
  /// Waits until all views have been rendered or `patience` has passed; true when they are there.
  bool waitForAll(std::chrono::milliseconds patience) const;
  /// The frame as the sensor gives it with these settings; nothing when the view is not there
  /// (yet).
  std::optional<StereoFrame> frame(int view, const Exposure& exposure) const;
  /// Views before this one need not be rendered any more: their time has passed.
  void skipBefore(int view);

 private:
  void work();

  const Simulation& simulation_;
  mutable std::mutex mutex_;
  mutable std::condition_variable news_;
  std::vector<StereoRadiance> views_;  ///< CV_16FC3; empty where skipped or not there yet
  int rendered_ = 0;
  int next_ = 0;  ///< to be rendered
  bool stop_ = false;
  std::thread worker_;
};

}  // namespace scanner::simulation
