#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>

#include "ros/static_broadcast.h"
#include "scanner/ros/bag_reader.h"
#include "scanner/simulation/emulated_mti.h"
#include "scanner/simulation/frame_store.h"
#include "scanner/simulation/simulation.h"

namespace scanner::bridge {

/// How far a rig in real time has come.
struct SimulatedRigStatistics {
  int rendered = 0;
  int shown = 0;
  int missed = 0;  ///< not rendered when their time came
};

/// What the simulated rig shows in real time, whichever way. The motion runs against the wall clock
/// from the moment that begin() is told. Thread-safe.
class SimulatedRig {
 public:
  virtual ~SimulatedRig() = default;
  /// Shows everything; returns when the motion has ended, or at once after stop().
  virtual void run() = 0;
  virtual void stop() = 0;
  virtual SimulatedRigStatistics statistics() const = 0;
};

/// Truth of the simulation on its topic, and the rig's transforms.
class TruthPublisher {
 public:
  TruthPublisher(const ros::NodeHandle& nh, const simulation::Simulation& simulation);
  /// Pose at `time_s` of the motion, stamped `stamp`.
  void publish(double time_s, Time stamp);

 private:
  const simulation::Simulation& simulation_;
  ros::Publisher publisher_;
  std::shared_ptr<StaticBroadcast> static_tf_;
};

/// Waits for a moment of the wall clock, but no longer than until stop() is called.
class Pacer {
 public:
  /// Time 0 of the motion is `delay` from now, in wall clock and in ROS time.
  void begin(Duration delay);
  /// False when stopped.
  bool waitUntil(double time_s);
  void stop();
  Time stampAt(double time_s) const { return start_stamp_ + fromSeconds(time_s); }
  double now() const;  ///< on the motion's clock

 private:
  std::mutex mutex_;
  std::condition_variable stopped_;
  bool stop_ = false;
  std::chrono::steady_clock::time_point start_;
  Time start_stamp_;
};

/// Publishes what the two drivers would publish.
std::unique_ptr<SimulatedRig> makeSimulatedTopics(const ros::NodeHandle& nh,
                                                  const simulation::Simulation& simulation,
                                                  simulation::FrameStore& frames);

/// What can go wrong with the emulated devices, and the cables.
struct DeviceFaults {
  double lost_packets = 0.0;
  simulation::MtiFaults mti;
};

/// The two devices themselves, for the drivers to open. The rig stands still until both have been
/// read for a while and the motion is allowed; it begins with a picture.
class SimulatedDevices : public SimulatedRig {
 public:
  struct Options {
    std::string mti_link;
    std::string camera_interface;
    std::string camera_serial;
  };
  /// Throws ConfigurationError when a device cannot be emulated.
  SimulatedDevices(const ros::NodeHandle& nh, const simulation::Simulation& simulation,
                   simulation::FrameStore& frames, const Options& options);
  ~SimulatedDevices() override;

  void run() override;
  void stop() override;
  SimulatedRigStatistics statistics() const override;
  bool settled() const;  ///< both drivers have read their device for some seconds
  void allowMotion();
  void plugCamera(bool in);
  void plugMti(bool in);
  void setFaults(const DeviceFaults& faults);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bridge
