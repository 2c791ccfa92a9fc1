#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>

#include "bumblebee/aravis_support.h"

namespace scanner::bumblebee::aravis {

/// The end of Aravis' receive thread: takes each buffer out of the stream when it is done, notes
/// the time, and keeps the newest ones until somebody waits for them. Shared by the stream, the
/// device's signal and the camera, so that none of them finds it gone. Thread-safe.
class Receiver {
 public:
  /// Frame id of a buffer whose leader never came; Aravis leaves there what was before.
  static constexpr std::uint64_t kUnknownId = ~std::uint64_t{0};

  struct Arrival {
    Object<ArvBuffer> buffer;
    Time time;                  ///< wall clock when it was done
    std::uint64_t missing = 0;  ///< packets, where the bus counts them
    std::uint64_t packets = 0;  ///< of a whole frame; 0: unknown
  };
  enum class Wake { kFrame, kTime, kStopped, kGone };

  /// Of a GigE Vision stream, `packets_per_frame` as far as it is known before the first frame; 0
  /// on another bus. At most `most_waiting` frames are kept. `stream` lives until end().
  void begin(ArvStream* stream, std::uint64_t packets_per_frame, std::size_t most_waiting);
  /// Takes nothing more, forgets what waits, wakes waitFor().
  void end();
  /// Lets Aravis fill the buffer again; frees it after end().
  void recycle(Object<ArvBuffer> buffer);

  /// The oldest frame; frames come before the news that the camera is gone.
  Wake waitFor(std::chrono::steady_clock::time_point deadline, Arrival& arrival);

  /// The camera is gone, for good. The first reason stays.
  void lose(const std::string& reason);
  bool gone() const;
  std::string reason() const;

  /// Since begin().
  std::uint64_t overruns() const;
  std::uint64_t lostPackets() const;

  /// ArvStreamCallback; `shared` is a std::shared_ptr<Receiver>*.
  static void onStream(void* shared, ArvStreamCallbackType type, ArvBuffer* buffer);
  /// Of the signal "control-lost".
  static void onControlLost(ArvDevice* device, void* shared);

 private:
  void take();
  void countPackets(Arrival& arrival);
  void recycleLocked(Object<ArvBuffer> buffer);

  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::deque<Arrival> waiting_;
  ArvStream* stream_ = nullptr;  ///< null: not streaming
  std::size_t most_waiting_ = 0;
  bool gone_ = false;
  std::string reason_;
  std::uint64_t overruns_ = 0, lost_packets_ = 0;
  std::uint64_t frame_packets_ = 0;    ///< of a whole frame
  bool frame_packets_sure_ = false;    ///< a whole frame has come
  std::uint64_t counted_packets_ = 0;  ///< of all frames until now
};

}  // namespace scanner::bumblebee::aravis
