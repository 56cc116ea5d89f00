#include <gmock/gmock.h>

#include "storage/history/history_reader.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

using testing::HasSubstr;
using testing::Not;

class HistoryQueryTest : public HistoryFixture {
 protected:
  HistoryQueryTest() { RecordEpisode(writer_, 0b101, "LV-1"); }

  std::string PlanOf(const std::string& sql) {
    Database database(path_, HistorySchema(), Access::kReader);
    Statement row = database.Prepare("EXPLAIN QUERY PLAN " + sql);
    std::string plan;
    while (row.Step()) {
      plan += row.Text(3) + '\n';
    }
    return plan;
  }

  static std::vector<EpisodeFilter> AllFilters() {
    std::vector<EpisodeFilter> filters;
    for (const char* valve : {"*", "LV-1", "LV-*"}) {
      for (const char* fault : {"", "unknown", "f7"}) {
        for (int state = 0;
             state <= static_cast<int>(EpisodeState::kAlarmShelved); ++state) {
          EpisodeFilter filter;
          filter.valve_glob = valve;
          filter.fault = fault;
          filter.state = static_cast<EpisodeState>(state);
          filter.limit = 200;
          filters.push_back(filter);
        }
      }
    }
    return filters;
  }

  HistoryWriter writer_{path_};
};

TEST_F(HistoryQueryTest, EveryFilterWalksAnIndex) {
  for (const EpisodeFilter& filter : AllFilters()) {
    std::string plan = PlanOf(ListQuery(filter));
    // The table of thirty names is read whole, for names and descriptions.
    const std::string names = "SCAN n\n";
    for (auto at = plan.find(names); at != std::string::npos;
         at = plan.find(names)) {
      plan.erase(at, names.size());
    }
    EXPECT_THAT(plan, Not(HasSubstr("SCAN")))
        << filter.valve_glob << ' ' << filter.fault << ' '
        << static_cast<int>(filter.state);
  }
}

// An event that comes now counts as of now, though its publisher stamps it 1970
// or 2049.
TEST_F(HistoryQueryTest, WhatArrivedInTheTimeIsListedWhereThatIsAskedFor) {
  constexpr std::int64_t kYears = 20LL * 365 * 86400 * kSecond;
  for (const std::int64_t off_ns : {-kYears, kYears, 60 * kSecond}) {
    FaultEvent event = Event(TransitionKind::kDetected, 0, 0, 0.3,
                             EndReason::kNone, "V" + std::to_string(off_ns));
    event.transition.stamp_ns += off_ns;
    event.transition.detection_stamp_ns += off_ns;
    writer_.Record(event, kDetected + 100 * kSecond);
  }
  EpisodeFilter filter;
  filter.since_ns = kDetected + 80 * kSecond;
  filter.until_ns = kDetected + 180 * kSecond;
  EXPECT_TRUE(HistoryReader(path_).List(filter).empty());
  filter.until_ns = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(HistoryReader(path_).List(filter).size(), 2U);
  filter.fault = "unknown";
  EXPECT_TRUE(HistoryReader(path_).List(filter).empty());
  for (EpisodeFilter each : AllFilters()) {
    each.since_ns = kDetected;
    EXPECT_THAT(PlanOf(ListQuery(each)), Not(HasSubstr("SCAN e\n")));
  }
}

// By other programs, through the view.
TEST_F(HistoryQueryTest, TheViewUsesTheIndexesOfItsColumns) {
  const std::string view = "SELECT * FROM fault_history WHERE ";
  EXPECT_THAT(PlanOf(view + "valve_id = 'V1'"), HasSubstr("episode_by_valve"));
  EXPECT_THAT(PlanOf(view + "fault = 'f7'"), HasSubstr("episode_by_fault"));
  EXPECT_THAT(PlanOf(view + "label = 'true'"), HasSubstr("episode_labelled"));
  EXPECT_THAT(PlanOf(view + "detected_utc >= '2026-11-01'"),
              HasSubstr("episode_by_utc"));
}

TEST_F(HistoryQueryTest, AlarmsAndTheirFiguresWalkIndexes) {
  EXPECT_THAT(PlanOf(AlarmSpanQuery({})),
              HasSubstr("COVERING INDEX episode_statistics"));
  const std::string plan = PlanOf(AlarmListQuery());
  EXPECT_THAT(plan, HasSubstr("episode_active"));
  EXPECT_THAT(plan, HasSubstr("episode_returned"));
  // Notices, which nobody acknowledges, are not in them.
  EXPECT_EQ(Sql("SELECT count(*) FROM sqlite_schema WHERE name IN "
                "('episode_returned', 'episode_unacked') "
                "AND sql LIKE '%AND notice = 0'"),
            "2");
  EXPECT_THAT(plan, Not(HasSubstr("SCAN e\n")));
}

}  // namespace
}  // namespace fdi::storage
