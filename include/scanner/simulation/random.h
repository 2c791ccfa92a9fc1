#pragma once

#include <cmath>
#include <cstdint>
#include <random>

/// Random numbers whose bits do not depend on the standard library (the distributions of <random>
/// do): the raw output of std::mt19937_64, which the standard fixes, and transforms of our own.
namespace scanner::simulation {

/// One step of splitmix64 (Steele, Lea and Flood, OOPSLA 2014): a bijection that scatters bits.
inline std::uint64_t splitMix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

/// Seed of an independent stream: per view, per sensor ... `mixSeed(mixSeed(seed, a), b)` nests.
inline std::uint64_t mixSeed(std::uint64_t seed, std::uint64_t stream) {
  return splitMix(splitMix(seed) ^ splitMix(stream + 0x632be59bd9b4e019ULL));
}

/// A stream of random numbers. Not thread-safe: one per task, seeded by mixSeed().
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  std::uint64_t bits() { return engine_(); }

  /// [0, 1), multiples of 2^-53.
  double uniform() { return static_cast<double>(engine_() >> 11U) * 0x1.0p-53; }
  double uniform(double lo, double hi) { return lo + (hi - lo) * uniform(); }

  /// Standard normal (Box and Muller 1958); every second number comes from the pair before.
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));  // 1 - u is never 0
    const double angle = 6.283185307179586 * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }

 private:
  std::mt19937_64 engine_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace scanner::simulation
