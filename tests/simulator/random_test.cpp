#include "simulator/random.h"

#include <cmath>
#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

namespace fdi::simulator {
namespace {

constexpr std::size_t kCount = 200000;

TEST(RandomTest, NormalNumbersHaveTheMomentsOfTheNormalDistribution) {
  NormalSource normal(1, 2);
  double moments[5] = {};
  for (std::size_t i = 0; i < kCount; ++i) {
    const double x = normal();
    for (int m = 1; m <= 4; ++m) {
      moments[m] += std::pow(x, m) / static_cast<double>(kCount);
    }
  }
  EXPECT_NEAR(moments[1], 0.0, 0.01);
  EXPECT_NEAR(moments[2], 1.0, 0.015);
  EXPECT_NEAR(moments[3], 0.0, 0.04);
  EXPECT_NEAR(moments[4], 3.0, 0.1);
}

TEST(RandomTest, SeedsAndStreamsDiffer) {
  EXPECT_EQ(NormalSource(1, 1)(), NormalSource(1, 1)());
  EXPECT_NE(NormalSource(1, 1)(), NormalSource(1, 2)());
  EXPECT_NE(NormalSource(1, 1)(), NormalSource(2, 1)());
}

TEST(RandomTest, DisturbanceHasItsDeviationAndCorrelationFromTheStart) {
  double first_square = 0.0;
  for (std::uint64_t seed = 0; seed < 20000; ++seed) {
    DisturbanceProcess process({0.5, 0.95}, NormalSource(seed, 3));
    first_square += std::pow(process.Next(), 2) / 20000.0;
  }
  EXPECT_NEAR(std::sqrt(first_square), 0.5, 0.01);

  DisturbanceProcess process({0.5, 0.95}, NormalSource(7, 3));
  double square = 0.0;
  double product = 0.0;
  double before = process.Next();
  for (std::size_t i = 0; i < kCount; ++i) {
    const double x = process.Next();
    square += x * x;
    product += x * before;
    before = x;
  }
  EXPECT_NEAR(std::sqrt(square / static_cast<double>(kCount)), 0.5, 0.02);
  EXPECT_NEAR(product / square, 0.95, 0.01);
}

}  // namespace
}  // namespace fdi::simulator
