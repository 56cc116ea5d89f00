#include "storage/history/alarm.h"

#include <gtest/gtest.h>

namespace fdi::storage {
namespace {

Episode On(const std::string& valve, std::optional<std::string> fault = {}) {
  Episode episode;
  episode.valve_id = valve;
  episode.fault = std::move(fault);
  return episode;
}

Shelf ShelfOf(const std::string& valve, std::int64_t from_ns,
              std::int64_t until_ns, std::optional<std::string> fault = {}) {
  Shelf shelf;
  shelf.valve_id = valve;
  shelf.from_ns = from_ns;
  shelf.until_ns = until_ns;
  shelf.fault = std::move(fault);
  return shelf;
}

// The four states of the diagram, and the one that hides them.
TEST(AlarmStateTest, FollowsTheDiagramOfTheStandard) {
  EXPECT_EQ(AlarmStateOf(true, false), AlarmState::kUnacked);
  EXPECT_EQ(AlarmStateOf(true, true), AlarmState::kAcked);
  EXPECT_EQ(AlarmStateOf(false, false), AlarmState::kReturnedUnacked);
  EXPECT_EQ(AlarmStateOf(false, true), AlarmState::kNormal);
  for (const bool active : {false, true}) {
    for (const bool acknowledged : {false, true}) {
      EXPECT_EQ(AlarmStateOf(active, acknowledged, true), AlarmState::kShelved);
    }
  }
}

TEST(AlarmStateTest, AnEpisodeReturnsWhenItIsClearedOrEndsOtherwise) {
  Episode open = On("V");
  Episode cleared = On("V");
  cleared.cleared_ns = 5;
  Episode superseded = On("V");
  superseded.ended_ns = 5;
  superseded.acked_by = "anna";

  EXPECT_EQ(AlarmStateOf(open), AlarmState::kUnacked);
  EXPECT_EQ(AlarmStateOf(cleared), AlarmState::kReturnedUnacked);
  EXPECT_EQ(AlarmStateOf(superseded), AlarmState::kNormal);
  EXPECT_EQ(AlarmStateOf(superseded, true), AlarmState::kShelved);
}

// A clock that was set back may say a time before it.
TEST(ShelfTest, HoldsUntilItsEndWhateverTheClockWasSetTo) {
  Shelf shelf = ShelfOf("V", 10, 20);
  EXPECT_TRUE(IsActive(shelf, 9));
  EXPECT_TRUE(IsActive(shelf, -3600));
  EXPECT_TRUE(IsActive(shelf, 19));
  EXPECT_FALSE(IsActive(shelf, 20));

  shelf.ended_ns = 15;

  EXPECT_FALSE(IsActive(shelf, 14)) << "who ended it has a clock that is ahead";
  EXPECT_FALSE(IsActive(shelf, 15));
}

TEST(ShelfTest, OfAFaultCoversJustThatAnswer) {
  const Shelf any = ShelfOf("V", 0, 9);
  const Shelf f7 = ShelfOf("V", 0, 9, "f7");

  EXPECT_TRUE(Covers(any, On("V")));
  EXPECT_TRUE(Covers(any, On("V", "f1")));
  EXPECT_FALSE(Covers(any, On("W", "f1")));
  EXPECT_TRUE(Covers(f7, On("V", "f7")));
  EXPECT_FALSE(Covers(f7, On("V", "f7|f19")));
  EXPECT_FALSE(Covers(f7, On("V")));
}

TEST(AlarmsTest, CarryTheShelfThatLastsLongestAndKeepTheirOwnState) {
  const std::vector<Shelf> shelves = {ShelfOf("V", 0, 50, "f7"),
                                      ShelfOf("V", 0, 100), ShelfOf("V", 0, 60),
                                      ShelfOf("W", 0, 10)};

  const auto alarms = AsAlarms({On("V", "f7"), On("W"), On("X")}, shelves, 20);

  ASSERT_EQ(alarms.size(), 3U);
  ASSERT_TRUE(alarms[0].shelf);
  EXPECT_EQ(alarms[0].shelf->until_ns, 100);
  EXPECT_EQ(alarms[0].state, AlarmState::kUnacked);
  EXPECT_FALSE(alarms[1].shelf);
  EXPECT_EQ(alarms[2].episode.valve_id, "X");
}

}  // namespace
}  // namespace fdi::storage
