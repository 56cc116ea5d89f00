#include <gtest/gtest.h>

#include "diagnosis/observers/intake.h"

namespace fdi {
namespace {

Sample At(std::uint64_t seq, double time_s, std::uint64_t source = 1) {
  Sample sample;
  sample.seq = seq;
  sample.source_id = source;
  sample.stamp_ns = static_cast<std::int64_t>(time_s * 1e9);
  return sample;
}

TEST(SourceOrderTest, ConsecutiveSamplesAreAcceptedWithoutGap) {
  SourceOrder order(1.0);
  EXPECT_TRUE(order.Place(At(1, 1)).new_source);
  const auto next = order.Place(At(2, 2));
  EXPECT_EQ(next.intake, Intake::kAccepted);
  EXPECT_FALSE(next.gap);
  EXPECT_FALSE(next.new_source);
}

TEST(SourceOrderTest, LostSampleIsAGapButNoOtherPeriod) {
  SourceOrder order(1.0);
  order.Place(At(1, 1));
  for (std::uint64_t k = 1; k < 10; ++k) {
    const auto placed =
        order.Place(At(1 + 2 * k, 1.0 + 2.0 * static_cast<double>(k)));
    EXPECT_EQ(placed.intake, Intake::kAccepted);
    EXPECT_TRUE(placed.gap);
  }
}

TEST(SourceOrderTest, AnotherPeriodIsRefusedAfterThreeIntervals) {
  SourceOrder order(1.0);
  order.Place(At(1, 2));
  EXPECT_EQ(order.Place(At(2, 4)).intake, Intake::kAccepted);
  EXPECT_EQ(order.Place(At(3, 6)).intake, Intake::kAccepted);
  EXPECT_EQ(order.Place(At(4, 8)).intake, Intake::kPeriod);
  EXPECT_EQ(order.Place(At(5, 10)).intake, Intake::kPeriod);
  EXPECT_EQ(order.Place(At(6, 11)).intake, Intake::kAccepted);
}

// The distances of these differ by more than 63 bits hold: UBSan tells.
TEST(SourceOrderTest, StampsCenturiesApartAreGaps) {
  SourceOrder order(1.0);
  for (std::uint64_t seq = 1; seq < 6; ++seq) {
    const double stamp_s = seq % 2 == 0 ? 4.1e9 : -2.2e9;
    const auto placed = order.Place(At(seq, stamp_s));
    EXPECT_EQ(placed.intake, Intake::kAccepted);
    EXPECT_EQ(placed.gap, seq > 1);
  }
}

TEST(SourceOrderTest, ClockThatStepsBackIsAGapNotAnEndlessDelay) {
  SourceOrder order(1.0);
  order.Place(At(1, 10000));
  const auto back = order.Place(At(2, 6400));
  EXPECT_EQ(back.intake, Intake::kAccepted);
  EXPECT_TRUE(back.gap);
  EXPECT_FALSE(order.Place(At(3, 6401)).gap);
}

TEST(SourceOrderTest, OldSourcesStaySuperseded) {
  SourceOrder order(1.0);
  order.Place(At(1, 1, 1));
  EXPECT_TRUE(order.Place(At(1, 2, 2)).new_source);
  EXPECT_EQ(order.Place(At(2, 3, 1)).intake, Intake::kSuperseded);
  EXPECT_EQ(order.Place(At(2, 3, 2)).intake, Intake::kAccepted);
}

}  // namespace
}  // namespace fdi
