#include "bench/study/wilson_interval.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace fdi::trainer::study {
namespace {

// p = 81/263, the example of Newcombe (1998), Stat. Med. 17, p. 861.
TEST(WilsonIntervalTest, MatchesAPublishedExample) {
  const Interval interval = WilsonInterval(81, 263);
  EXPECT_NEAR(interval.low, 0.2553, 5e-5);
  EXPECT_NEAR(interval.high, 0.3662, 5e-5);
}

TEST(WilsonIntervalTest, HasAWidthWhereEveryTrialWentTheSameWay) {
  EXPECT_NEAR(WilsonInterval(0, 10).high, 0.2775, 5e-5);
  EXPECT_EQ(WilsonInterval(0, 10).low, 0.0);
  EXPECT_NEAR(WilsonInterval(10, 10).low, 0.7225, 5e-5);
  EXPECT_DOUBLE_EQ(WilsonInterval(10, 10).high, 1.0);
}

TEST(WilsonIntervalTest, NoTrialsSayNothing) {
  EXPECT_EQ(WilsonInterval(0, 0).low, 0.0);
  EXPECT_EQ(WilsonInterval(0, 0).high, 1.0);
  EXPECT_THROW(WilsonInterval(3, 2), std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer::study
