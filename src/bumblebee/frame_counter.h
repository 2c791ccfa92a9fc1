#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

namespace scanner::bumblebee {

/// Steps of a camera's frame counter that wraps from `last` to `first`.
class FrameCounter {
 public:
  void restart() { previous_.reset(); }

  /// Frames since the call before: 1 when none is missing; nothing for the same number again. A
  /// step of more than `largest` cannot be (the counter was reset, or a bit flipped) and counts
  /// as 1.
  std::optional<std::uint64_t> step(std::uint64_t counter, std::uint64_t first, std::uint64_t last,
                                    std::uint64_t largest) {
    const std::optional<std::uint64_t> previous = previous_;
    previous_ = counter;
    if (!previous) return 1;
    if (counter == *previous) return std::nullopt;
    std::uint64_t advance = counter - *previous;
    if (counter < *previous) {
      if (last == 0 || *previous > last || counter < first) return 1;
      advance = (last - *previous) + (counter - first) + 1;
    }
    return advance <= std::max<std::uint64_t>(largest, 1) ? advance : 1;
  }

 private:
  std::optional<std::uint64_t> previous_;
};

}  // namespace scanner::bumblebee
