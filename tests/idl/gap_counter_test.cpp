#include "idl/gap_counter.h"

#include <gtest/gtest.h>

namespace fdi::idl {
namespace {

TEST(GapCounterTest, CountsTheNumbersThatAWriterSkipped) {
  GapCounter gaps(0);

  EXPECT_EQ(gaps.Missing(1, 5, 100), 0U);  // Joined late: no loss.
  EXPECT_EQ(gaps.Missing(1, 6, 101), 0U);
  EXPECT_EQ(gaps.Missing(1, 10, 102), 3U);
  EXPECT_EQ(gaps.Missing(1, 10, 102), 0U);
}

TEST(GapCounterTest, WritersAreCountedApart) {
  GapCounter gaps(0);

  EXPECT_EQ(gaps.Missing(1, 1, 100), 0U);
  EXPECT_EQ(gaps.Missing(2, 7, 100), 0U);
  EXPECT_EQ(gaps.Missing(1, 2, 100), 0U);
  EXPECT_EQ(gaps.Missing(2, 9, 100), 1U);
}

// A late joiner gets the last decision of each valve, with gaps between.
TEST(GapCounterTest, WhatWasWrittenBeforeJoiningIsNoLoss) {
  GapCounter gaps(1000);

  EXPECT_EQ(gaps.Missing(1, 10, 900), 0U);
  EXPECT_EQ(gaps.Missing(1, 20, 950), 0U);
  EXPECT_EQ(gaps.Missing(1, 21, 1001), 0U);
  EXPECT_EQ(gaps.Missing(1, 23, 1002), 1U);
}

}  // namespace
}  // namespace fdi::idl
