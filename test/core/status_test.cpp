#include "scanner/core/status.h"

#include <gtest/gtest.h>

#include <memory>

namespace scanner {
namespace {

TEST(Result, HoldsAValueOrAReason) {
  const Result<int> good = 7;
  EXPECT_TRUE(good.isOk());
  EXPECT_EQ(*good, 7);
  const Result<int> bad = Status(StatusCode::kNoOverlap, "views 3 and 4");
  EXPECT_FALSE(bad.isOk());
  EXPECT_EQ(bad.status().code(), StatusCode::kNoOverlap);
  EXPECT_THROW(bad.value(), std::logic_error);
}

TEST(Result, MovesItsValueOut) {
  Result<std::unique_ptr<int>> result = std::make_unique<int>(3);
  const std::unique_ptr<int> taken = *std::move(result);
  EXPECT_EQ(*taken, 3);
}

TEST(Result, AnOkStatusIsNoValue) { EXPECT_THROW(Result<int>{Status::ok()}, std::logic_error); }

TEST(StatusCode, NamesAreStable) {
  EXPECT_STREQ(toString(StatusCode::kNoConvergence), "no_convergence");
  EXPECT_STREQ(toString(StatusCode::kOk), "ok");
}

}  // namespace
}  // namespace scanner
