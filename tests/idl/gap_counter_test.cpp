#include "idl/gap_counter.h"

#include <gtest/gtest.h>

namespace fdi::idl {
namespace {

TEST(GapCounterTest, CountsTheNumbersThatAWriterSkipped) {
  GapCounter gaps(0);
  gaps.Count(1, 5, 100);  // Joined late: 1 to 4 are no loss.
  gaps.Count(1, 6, 101);
  EXPECT_EQ(gaps.missing(), 0U);

  gaps.Count(1, 10, 102);

  EXPECT_EQ(gaps.missing(), 3U);
}

// A backlog leaves the library valve by valve.
TEST(GapCounterTest, TheOrderDoesNotMatter) {
  GapCounter gaps(0);
  for (const std::uint64_t number : {1, 3, 5, 8, 2, 4, 6}) {
    gaps.Count(1, number, 100);
  }

  EXPECT_EQ(gaps.missing(), 1U);
}

TEST(GapCounterTest, WritersAreCountedApart) {
  GapCounter gaps(0);
  gaps.Count(1, 1, 100);
  gaps.Count(2, 7, 100);
  gaps.Count(1, 2, 100);
  EXPECT_EQ(gaps.missing(), 0U);

  gaps.Count(2, 9, 100);

  EXPECT_EQ(gaps.missing(), 1U);
}

// A late joiner gets the last decision of each valve, with gaps between.
TEST(GapCounterTest, WhatWasWrittenBeforeJoiningIsNoLoss) {
  GapCounter gaps(1000);
  gaps.Count(1, 10, 900);
  gaps.Count(1, 20, 950);
  gaps.Count(1, 22, 1001);
  EXPECT_EQ(gaps.missing(), 0U);

  gaps.Count(1, 24, 1002);

  EXPECT_EQ(gaps.missing(), 1U);
}

}  // namespace
}  // namespace fdi::idl
