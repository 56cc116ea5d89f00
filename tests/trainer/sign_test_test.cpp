#include <limits>

#include <gtest/gtest.h>

#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

TEST(SignTestTest, ValuesOfTheBinomialDistribution) {
  EXPECT_DOUBLE_EQ(PValue({0, 0, 7}), 1.0);
  EXPECT_NEAR(PValue({5, 0, 0}), 0.0625, 1e-12);
  EXPECT_NEAR(PValue({0, 6, 3}), 0.03125, 1e-12);
  EXPECT_NEAR(PValue({9, 1, 0}), 2.0 * 11.0 / 1024.0, 1e-12);
  EXPECT_DOUBLE_EQ(PValue({4, 4, 0}), 1.0);
}

TEST(SignTestTest, FewestPairsThatCanTellAreSix) {
  EXPECT_GT(PValue({kMinDecidedPairs - 1, 0, 0}), 0.05);
  EXPECT_LE(PValue({kMinDecidedPairs, 0, 0}), 0.05);
}

// Twice the sum of comb(2000, i) for i up to 900 over 2 ** 2000 in integers.
TEST(SignTestTest, ManyPairsDoNotUnderflow) {
  EXPECT_NEAR(PValue({1100, 900, 0}), 8.457089535503927e-06, 1e-12);
}

TEST(SignTestTest, SignsAreCountedWithoutWhatIsNoPair) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  const SignTest test = CountSigns({1.0, -2.0, 0.0, none, 3.0});
  EXPECT_EQ(test.positive, 2);
  EXPECT_EQ(test.negative, 1);
  EXPECT_EQ(test.ties, 1);
}

}  // namespace
}  // namespace fdi::trainer
