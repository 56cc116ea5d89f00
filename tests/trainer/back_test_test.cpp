#include "trainer/evaluation/back_test.h"

#include <gmock/gmock.h>

namespace fdi::trainer {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::int64_t kDay = 86400LL * 1'000'000'000;
constexpr double kHorizonS = 30.0 * 86400.0;

// 200 days of one valve.
PastRecord Record(std::vector<PastEpisode> episodes) {
  PastRecord record;
  record.valve = "A";
  record.last_ns = 200 * kDay;
  record.episodes = std::move(episodes);
  return record;
}
PastEpisode Episode(int from_day, int to_day, std::vector<int> said) {
  return {"A", from_day * kDay, to_day * kDay, std::move(said)};
}
WorkOrder Order(int day, int found) {
  return {"A", day * kDay, found};
}
JudgedOrder JudgeOne(std::vector<PastEpisode> episodes, int found) {
  return JudgeHistory({Record(std::move(episodes))}, {Order(100, found)},
                      kHorizonS)
      .orders.front();
}

TEST(BackTestTest, BestAnswerWithinTheHorizonCounts) {
  const JudgedOrder judged =
      JudgeOne({Episode(60, 65, {6}), Episode(80, 82, {3, 6}),
                Episode(90, 91, {3}), Episode(95, 120, {})},
               6);
  EXPECT_EQ(judged.outcome, OrderOutcome::kContained);
  EXPECT_THAT(judged.said, ElementsAre(3, 6));
  EXPECT_EQ(judged.first_ns, 80 * kDay);
  EXPECT_EQ(judged.lead_s, 20.0 * 86400.0);
  EXPECT_EQ(judged.duration_s, 8.0 * 86400.0);  // 2 + 1 + 5 of 25
}

TEST(BackTestTest, EveryOutcomeHasItsCase) {
  EXPECT_EQ(JudgeOne({Episode(80, 82, {6})}, 6).outcome, OrderOutcome::kExact);
  EXPECT_EQ(JudgeOne({Episode(80, 82, {3})}, 6).outcome, OrderOutcome::kWrong);
  EXPECT_EQ(JudgeOne({Episode(80, 82, {})}, 6).outcome, OrderOutcome::kUnknown);
  EXPECT_EQ(JudgeOne({Episode(60, 65, {6})}, 6).outcome, OrderOutcome::kMissed);
  EXPECT_EQ(JudgeOne({Episode(101, 105, {6})}, 6).outcome,
            OrderOutcome::kMissed);
  EXPECT_EQ(JudgeOne({}, 0).outcome, OrderOutcome::kSilent);
  EXPECT_EQ(JudgeOne({Episode(80, 82, {})}, 0).outcome, OrderOutcome::kFalse);
  EXPECT_EQ(
      JudgeHistory({Record({})}, {Order(300, 6)}, kHorizonS).orders[0].outcome,
      OrderOutcome::kNoData);
  EXPECT_EQ(JudgeHistory({}, {Order(100, 6)}, kHorizonS).orders[0].outcome,
            OrderOutcome::kNoData);
}

TEST(BackTestTest, WhatWasSaidBeforeARepairIsNotSaidOfTheNext) {
  const BackTest test = JudgeHistory({Record({Episode(80, 84, {6})})},
                                     {Order(85, 6), Order(95, 3)}, kHorizonS);
  EXPECT_EQ(test.orders[0].outcome, OrderOutcome::kExact);
  EXPECT_EQ(test.orders[1].outcome, OrderOutcome::kMissed);
  EXPECT_EQ(test.by_fault.at(3).at(OrderOutcome::kMissed), 1);
  EXPECT_EQ(test.by_fault.at(6).at(OrderOutcome::kExact), 1);
}

TEST(BackTestTest, EpisodeIsFalseOnceTheHorizonPassedWithoutAFault) {
  const BackTest test =
      JudgeHistory({Record({Episode(10, 11, {6}), Episode(99, 100, {3}),
                            Episode(140, 141, {3}), Episode(190, 191, {})})},
                   {Order(15, 0), Order(105, 3)}, kHorizonS);
  ASSERT_EQ(test.false_episodes.size(), 2U);
  EXPECT_EQ(test.false_episodes[0].detected_ns, 10 * kDay);
  EXPECT_EQ(test.false_episodes[1].detected_ns, 140 * kDay);
  ASSERT_EQ(test.undecided.size(), 1U);
  EXPECT_EQ(test.undecided[0].detected_ns, 190 * kDay);
}

// The first look may have overlooked it.
TEST(BackTestTest,
     AFaultFoundAtTheSecondOrderWithinTheHorizonProvesTheEpisode) {
  const PastRecord record = Record({Episode(10, 11, {6})});
  EXPECT_THAT(JudgeHistory({record}, {Order(15, 0), Order(40, 6)}, kHorizonS)
                  .false_episodes,
              IsEmpty());
  EXPECT_EQ(JudgeHistory({record}, {Order(15, 0), Order(42, 6)}, kHorizonS)
                .false_episodes.size(),
            1U);
}

TEST(BackTestTest, OrdersOfOtherValvesProveNothing) {
  const BackTest test = JudgeHistory({Record({Episode(80, 82, {6})})},
                                     {{"B", 90 * kDay, 6}}, kHorizonS);
  EXPECT_EQ(test.false_episodes.size(), 1U);
  EXPECT_THAT(test.undecided, IsEmpty());
}

}  // namespace
}  // namespace fdi::trainer
