#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "scanner/core/time.h"
#include "scanner/mti/message.h"
#include "scanner/mti/mt_data.h"

namespace scanner::mti {

/// A decoded measurement and when its last byte arrived.
struct Reading {
  MtData data;
  Time arrival;
  double rotation_defect = 0.0;  ///< rotationDefect() of the message
};

/// Stands between decoder and user and keeps back what a damaged line made up.
///
/// Why: the checksum of the MT protocol has eight bits and is a plain sum. Of the messages with two
/// flipped bits 7% pass it (the same bit, once set and once cleared). At 1% of bytes hit, of the
/// messages of 79 bytes that still decode, one in ninety is wrong. So:
///
/// - While the line is sound nothing is held and nothing is rejected, however violent the motion.
/// - From a checksum error or a byte outside of messages on, and until `watch_messages` whole
///   messages came without, every message is held until two more (at times three) have come, and
///   is judged against both sides:
///     counter   it must agree with its place in the stream of bytes, as its neighbours' do;
///     rotation  a matrix must be orthonormal and a quaternion of length one to the precision that
///               the device has shown so far;
///     jump      acceleration, rate, magnetic field, orientation and temperature must lie where the
///               neighbours put them, within some times the scatter that is usual now.
///   What fails was hit, and is counted; what passes is given on, late by the messages it waited.
///
/// What cannot be done: the low bits of calibrated values are noise and nothing repeats them, so a
/// pair of flips in them stays. At 1% of bytes, over 100000 hand-held samples in matrix mode: 522
/// wrong ones pass checksum and decoder, 186 of them this filter, two thirds of those by less than
/// the sensor's noise; 16 of 44993 samples that were not hit are lost. One must not hope for more
/// from this protocol without asking for every sample twice. Not thread-safe.
class PlausibilityFilter {
 public:
  struct Options {
    int watch_messages = 100;     ///< the line counts as damaged for so long after damage
    double jump_threshold = 7.0;  ///< times the usual scatter (mean deviation)
  };
  struct Statistics {
    std::uint64_t accepted = 0;
    std::uint64_t held = 0;  ///< of them, those that had to wait
    std::uint64_t rejected_counter = 0;
    std::uint64_t rejected_rotation = 0;
    std::uint64_t rejected_jump = 0;
    std::uint64_t rejected() const { return rejected_counter + rejected_rotation + rejected_jump; }
  };

  PlausibilityFilter() : PlausibilityFilter(Options{}) {}
  explicit PlausibilityFilter(const Options& options) : options_(options) {}

  /// Every whole message in the order of the stream (their lengths tell the place in it), with what
  /// was decoded from it, or nothing when it is no data or does not decode. `line`: the parser's
  /// statistics right after it gave that message.
  void push(const Message& message, std::optional<Reading> reading,
            const MessageParser::Statistics& line);
  /// What is known to be right by now, in order; nothing until more messages come.
  std::optional<Reading> next();
  /// The stream ended or paused: what is held is judged by what there is. Take it with next().
  void flush();
  /// A new stream: forgets everything but the counts.
  void restart();

  bool lineIsSound() const { return watch_left_ == 0; }
  const Statistics& statistics() const { return statistics_; }

 private:
  struct Entry {
    Reading reading;
    std::int64_t position = 0;  ///< in the stream of bytes, of its end
    std::int64_t bytes = 0;     ///< of the message
  };
  enum class Verdict { kAccept, kWait, kCounter, kRotation, kJump };
  static constexpr std::size_t kChannels = 5;
  using Scores = std::array<double, kChannels>;

  void noteDamage(const MessageParser::Statistics& line);
  void judgePending(bool all);
  Verdict judge(bool last_word) const;
  bool counterFits(const Entry& entry) const;
  bool fitsNeighbours(const Entry& entry, const std::vector<const Entry*>& neighbours) const;
  std::vector<const Entry*> neighboursOf(const Entry& entry, std::size_t left_out) const;
  void accept(Entry entry);
  void learn();

  Options options_;
  Statistics statistics_;
  std::optional<MessageParser::Statistics> line_;
  std::int64_t framed_bytes_ = 0;
  int watch_left_ = 0;
  std::deque<Entry> pending_;   ///< not judged yet
  std::deque<Entry> accepted_;  ///< the last ones that were accepted
  std::deque<Reading> ready_;   ///< accepted, not yet taken
  Scores scatter_{};            ///< mean deviation from what neighbours predict, per channel
  double usual_defect_ = 0.0;   ///< mean rotation defect
};

}  // namespace scanner::mti
