#include <stdexcept>

#include <gtest/gtest.h>

#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

// Exact one-sided 95 % bounds of a Poisson mean: 2.996, 4.744, 16.962.
TEST(EventRateTest, MatchesTheTableOfPoissonBounds) {
  EXPECT_NEAR(RateOf(0, kHoursPerYear).upper, 2.996, 0.001);
  EXPECT_NEAR(RateOf(1, kHoursPerYear).upper, 4.744, 0.001);
  EXPECT_NEAR(RateOf(10, kHoursPerYear).upper, 16.962, 0.001);
  EXPECT_NEAR(RateOf(10, 2.0 * kHoursPerYear).per_year, 5.0, 1e-12);
  EXPECT_THROW(RateOf(1, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
