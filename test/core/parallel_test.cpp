#include "scanner/core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace scanner {
namespace {

TEST(ParallelFor, VisitsEveryIndexOnce) {
  for (const int threads : {1, 2, 5}) {
    std::vector<int> visits(1003, 0);
    parallelFor(visits.size(), 10, threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) ++visits[i];
    });
    EXPECT_EQ(std::accumulate(visits.begin(), visits.end(), 0), 1003);
    EXPECT_EQ(*std::min_element(visits.begin(), visits.end()), 1);
  }
}

TEST(ParallelFor, ChunkedSumIsTheSameForEveryThreadCount) {
  const std::size_t n = 10007;
  const std::size_t grain = 64;
  const auto sum = [&](int threads) {
    std::vector<double> partial(chunkCount(n, grain), 0.0);
    parallelFor(n, grain, threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        partial[begin / grain] += std::sin(static_cast<double>(i)) * 1e-3;
      }
    });
    return std::accumulate(partial.begin(), partial.end(), 0.0);
  };
  EXPECT_EQ(sum(1), sum(2));
  EXPECT_EQ(sum(1), sum(7));
}

TEST(ParallelFor, NothingToDo) {
  std::atomic<int> calls{0};
  parallelFor(0, 8, 2, [&](std::size_t, std::size_t) { ++calls; });
  EXPECT_EQ(calls, 0);
}

TEST(ParallelFor, RethrowsAndRefusesBadArguments) {
  EXPECT_THROW(parallelFor(100, 1, 2,
                           [](std::size_t begin, std::size_t) {
                             if (begin == 50) throw std::runtime_error("broken");
                           }),
               std::runtime_error);
  EXPECT_THROW(parallelFor(1, 1, 0, [](std::size_t, std::size_t) {}), std::invalid_argument);
  EXPECT_THROW(parallelFor(1, 0, 1, [](std::size_t, std::size_t) {}), std::invalid_argument);
}

}  // namespace
}  // namespace scanner
