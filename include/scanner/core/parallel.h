#pragma once

#include <cstddef>
#include <functional>

namespace scanner {

/// Calls `body(begin, end)` on consecutive chunks of [0, n) with at most `threads` threads
/// (>= 1). The chunks depend on n and `grain` only, never on `threads`, so whatever a body computes
/// per chunk is the same for every thread count. Bodies must not write to shared state but their
/// own range. Exceptions of a body are rethrown.
void parallelFor(std::size_t n, std::size_t grain, int threads,
                 const std::function<void(std::size_t begin, std::size_t end)>& body);

/// Number of chunks that parallelFor(n, grain, ...) makes; chunk c covers [c*grain, ...). Use it to
/// reduce in order: one partial result per chunk, summed from the first to the last.
std::size_t chunkCount(std::size_t n, std::size_t grain);

}  // namespace scanner
