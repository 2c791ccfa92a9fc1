#include "scanner/core/parallel.h"

#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <stdexcept>

namespace scanner {

std::size_t chunkCount(std::size_t n, std::size_t grain) {
  if (grain == 0) throw std::invalid_argument("chunkCount: grain must be at least 1");
  return (n + grain - 1) / grain;
}

void parallelFor(std::size_t n, std::size_t grain, int threads,
                 const std::function<void(std::size_t, std::size_t)>& body) {
  if (threads < 1) throw std::invalid_argument("parallelFor: threads must be at least 1");
  const std::size_t chunks = chunkCount(n, grain);
  const auto run_chunk = [&](std::size_t chunk) {
    body(chunk * grain, std::min(n, (chunk + 1) * grain));
  };
  if (threads == 1 || chunks <= 1) {
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) run_chunk(chunk);
    return;
  }
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, chunks, std::size_t{1}, run_chunk, tbb::simple_partitioner());
  });
}

}  // namespace scanner
