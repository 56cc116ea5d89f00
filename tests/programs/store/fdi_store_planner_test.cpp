// What a planner asks fdi-store.
#include <gmock/gmock.h>

#include "tests/programs/store/store_program_fixture.h"

namespace fdi::storage {
namespace {

using testing::HasSubstr;

class FdiStorePlannerTest : public FdiStoreTest {
 protected:
  // 40 days in which X leaves the model by 0.05 % a day.
  void KeepHealth() {
    HistoryWriter writer(path_);
    std::vector<HealthHour> hours;
    for (int i = 0; i < 24 * 40; ++i) {
      HealthHour hour;
      hour.valve_id = "V1";
      hour.hour = 480'000 + i;
      hour.model_hash = 1;
      hour.seen_ms = hour.live_ms = 3'600'000;
      hour.channels = {{Signal::kX, -10}};
      const std::int64_t residual = 51LL * (i / 24) + (i * 37) % 41;
      hour.bins[7] = {{3600, 3600 * residual, 0, 3600 * 71'000}};
      hours.push_back(hour);
    }
    Checkpoint checkpoint;
    checkpoint.health = hours;
    writer.CommitCheckpoint(checkpoint);
  }
};

TEST_F(FdiStorePlannerTest, TrendGivesTimeAndInterval) {
  KeepHealth();
  const json trend = StoreJson("health trend --valve V1 --limit X=3")["trends"];
  ASSERT_EQ(trend.size(), 1u);
  EXPECT_EQ(trend[0]["answer"], "time");
  EXPECT_NEAR(trend[0]["days"].get<double>(), (3.0 - 1.97) / 0.05, 1.0);
  EXPECT_LE(trend[0]["lower_days"], trend[0]["days"]);
  EXPECT_GE(trend[0]["upper_days"], trend[0]["days"]);
  EXPECT_EQ(Store("health trend --valve V1 --limit Q=3").code, 2);
  EXPECT_EQ(Store("health trend --valve none --limit X=3").code, 5);
}

TEST_F(FdiStorePlannerTest, HealthIsShownByDayByHourAndAsCsv) {
  KeepHealth();
  EXPECT_GE(StoreJson("health show --valve V1")["hours"].size(), 40u);
  const json hours = StoreJson("health show --valve V1 --hourly")["hours"];
  ASSERT_EQ(hours.size(), 24u * 40u);
  EXPECT_NEAR(hours[0]["channels"][0]["mean"].get<double>(), 0.0, 0.05);
  EXPECT_THAT(Store("health show --valve V1 --csv").out,
              HasSubstr("hour_utc,epoch,model_hash"));
}

TEST_F(FdiStorePlannerTest, WorkListAndCausesOfAnEmptyHistoryAreEmpty) {
  { const HistoryWriter writer(path_); }
  EXPECT_TRUE(StoreJson("worklist")["rows"].empty());
  EXPECT_TRUE(StoreJson("history causes")["causes"].empty());
  EXPECT_EQ(Store("worklist").out, "Nothing to do.\n");
  EXPECT_EQ(Store("worklist --discipline plumber").code, 2);
}

}  // namespace
}  // namespace fdi::storage
