#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/simulation/imu_model.h"

namespace scanner::simulation {

/// What an emulated MTi does wrong on request. Rates are shares of 0..1.
struct MtiFaults {
  double corrupt_bytes = 0.0;  ///< bytes sent with a flipped bit
  double drop_bytes = 0.0;     ///< bytes not sent
  bool answer_errors = false;  ///< every request gets an Error message
  bool mute = false;           ///< answers nothing and sends nothing
};

/// An MTi behind a pseudo-terminal that speaks the legacy MT protocol as the device does: wake-up,
/// configuration and measurement states, acknowledgements and errors, output mode, settings, period
/// and skip factor, the resets and their effects, baud rate (src/simulation/mti_state.h says what
/// exactly). It is a serial port with nothing behind it but a wire: what is sent while nobody has
/// it open is lost, so is what a host does not read in time, a host at another baud rate than the
/// device sends and gets garbage, and when the line is too slow for the samples, samples are left
/// out. Thread-safe. The thread that speaks belongs to the object.
class EmulatedMti {
 public:
  struct Options {
    std::uint32_t device_id = 0x00300123;
    std::string link;          ///< symbolic link kept on the terminal; empty: none
    double burst_s = 0.0;      ///< bytes arrive in bursts of this period, as from a USB adapter
    double still_end_s = 0.0;  ///< the last so many seconds are repeated to and fro at the end
    double clock_ppm = 0.0;    ///< the device's clock against the host's
    int seed = 1;              ///< of the faults
  };
  /// `samples` are at a fixed rate; each is sent at its time after start(), at the rate that was
  /// configured (in between: src/simulation/mti_track.h). Powered on at once. Throws
  /// ConfigurationError when no terminal can be made, or for samples without orientation or out of
  /// order.
  EmulatedMti(const Options& options, std::vector<MtiSample> samples);
  ~EmulatedMti();

  /// Path of the terminal (or the link to it) that a driver opens. Empty while unplugged without a
  /// link.
  std::string path() const;
  /// The time 0 of the samples is now (steady clock, `delay_s` from now). Before it the device
  /// stands still: it sends its samples from before time 0 to and fro, its first one if there are
  /// none; after the last one, the last, or the last `still_end_s` to and fro.
  void start(double delay_s = 0.0);
  /// Throws ConfigurationError for shares outside of 0..1.
  void setFaults(const MtiFaults& faults);
  /// Power off and the cable out: the terminal hangs up and the link disappears. plug() makes a new
  /// terminal; settings that were stored survive, others go back to the stored ones.
  void unplug();
  void plug();

  struct Statistics {
    std::uint64_t messages_sent = 0;  ///< MTData, to somebody who has the terminal open
    std::uint64_t bytes_corrupted = 0;
    std::uint64_t bytes_dropped = 0;     ///< on request
    std::uint64_t bytes_overrun = 0;     ///< lost because the host did not read
    std::uint64_t messages_skipped = 0;  ///< MTData left out because the line was too slow
    std::uint64_t requests = 0;
    std::uint64_t bad_requests = 0;  ///< wrong checksum, unknown, or not allowed in this state
  };
  Statistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::simulation
