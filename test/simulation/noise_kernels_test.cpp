#include "simulation/noise_kernels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "scanner/simulation/random.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

/// Places of all sizes, on both sides of zero, some of them on lattice planes.
std::vector<Vector3f> places() {
  Random random(7);
  std::vector<Vector3f> places;
  for (int i = 0; i < 100000; ++i) {
    const double size = i % 3 == 0 ? 1000.0 : i % 3 == 1 ? 3.0 : 0.01;
    Vector3f p;
    for (int k = 0; k < 3; ++k) p[k] = static_cast<float>(random.uniform(-size, size));
    if (i % 10 == 0) p.z() = 0.0F;
    if (i % 17 == 0) p.x() = std::round(p.x());
    places.push_back(p);
  }
  return places;
}

TEST(NoiseKernels, VectorizedIsBitForBitThePlainOne) {
  if (!avx2::available()) GTEST_SKIP() << "this processor has no AVX2";
  std::uint32_t seed = 0;
  for (const Vector3f& p : places()) {
    ++seed;
    ASSERT_EQ(plain::gradientNoise(p, seed), avx2::gradientNoise(p, seed)) << p.transpose();
    Vector3f a, b;
    ASSERT_EQ(plain::gradientNoise(p, seed, &a), avx2::gradientNoise(p, seed, &b));
    ASSERT_EQ(a, b) << p.transpose();
    const Cell c = plain::cellularNoise(p, 0.3F, seed), d = avx2::cellularNoise(p, 0.3F, seed);
    ASSERT_EQ(c.nearest, d.nearest) << p.transpose();
    ASSERT_EQ(c.second, d.second) << p.transpose();
    ASSERT_EQ(c.id, d.id) << p.transpose();
  }
}

}  // namespace
}  // namespace scanner::simulation
