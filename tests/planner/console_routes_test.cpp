// The planner's part of the console over real HTTP.
#include "planner/page/console_routes.h"

#include <fstream>

#include <gmock/gmock.h>
#include <httplib.h>

#include "base/time_text.h"
#include "console/console.h"
#include "tests/html_check.h"
#include "tests/storage/history_fixture.h"

namespace fdi::console {
namespace {

using testing::HasSubstr;

class PlannerRoutesTest : public storage::HistoryFixture {
 protected:
  PlannerRoutesTest() : writer_(path_) {
    std::ofstream(directory_.path() / "index.html") << "page";
    ConsoleOptions options;
    options.address.host = "127.0.0.1";
    options.files = directory_.path();
    options.routes = planner::ConsoleRoutes({{"air west", {"V/*"}}});
    std::string listening;
    console_.emplace(options, report::GlobalOptions{},
                     [&listening](LogLevel, std::string_view line) {
                       if (line.starts_with("console_listening")) {
                         listening = line;
                       }
                     });
    RecordEpisode(writer_, 4, "V/1 a");  // f19
    AddHealth(40);
    console_->Start({path_, directory_.path() / "models.db", "0.0", kDetected,
                     [] {
                       return MonitorFacts{"OK", {}, 0};
                     },
                     [] { return kDetected + 3600 * kSecond; }});
    client_.emplace("127.0.0.1",
                    std::stoi(listening.substr(listening.find(':') + 1)));
  }

  void AddHealth(int days) {
    std::vector<HealthHour> hours;
    for (int i = 0; i < 24 * days; ++i) {
      HealthHour hour;
      hour.valve_id = "V/1 a";
      hour.hour = kDetected / (3600 * kSecond) - 24 * days + i;
      hour.model_hash = 1;
      hour.seen_ms = hour.live_ms = 3'600'000;
      hour.channels = {{Signal::kX, -7}, {Signal::kF, -7}};
      hour.bins[5] = {{3600, 0, 0, 3600 * 9000},
                      {3600, 3600 * (i % 7), 3600 * 64, 3600 * 5000}};
      hours.push_back(hour);
    }
    Checkpoint checkpoint;
    checkpoint.health = hours;
    writer_.CommitCheckpoint(checkpoint);
  }
  Json Get(const std::string& path, int status = 200) {
    const httplib::Result answer = client_->Get(path);
    EXPECT_TRUE(answer && answer->status == status) << path;
    return answer ? Json::parse(answer->body) : Json();
  }

  storage::HistoryWriter writer_;
  std::optional<Console> console_;
  std::optional<httplib::Client> client_;
};

TEST_F(PlannerRoutesTest, HealthHasTheFiguresAndTheStatusOfEachDay) {
  const Json health = Get("/api/v1/valves/V%2F1%20a/health");
  const std::size_t days = health["t_ms"].size();
  for (const char* key : {"dead_band", "error_band", "t63", "exceeded"}) {
    EXPECT_EQ(health[key].size(), days) << key;
  }
  EXPECT_EQ(health["status"].back(), "good");
}

TEST_F(PlannerRoutesTest, WorkListNamesValveAndReason) {
  const Json list = Get("/api/v1/worklist");
  EXPECT_EQ(list["as_of_utc"], FormatTime(kDetected + 3600 * kSecond, true));
  const Json& rows = list["rows"];
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0]["valve_id"], "V/1 a");
  EXPECT_EQ(rows[0]["fault"], "f19");
  EXPECT_THAT(rows[0]["why"].get<std::string>(),
              HasSubstr("Flow transmitter wrong"));
  EXPECT_TRUE(Get("/api/v1/worklist?discipline=air")["rows"].empty());
}

TEST_F(PlannerRoutesTest, WhatCannotBeIsRefused) {
  Get("/api/v1/worklist?since_ms=soon", 400);
  Get("/api/v1/worklist?discipline=plumber", 400);
  Get("/api/v1/worklist?limit=Q%3D1", 400);
}

TEST_F(PlannerRoutesTest, GroupsOfTheFileAreThoseOfThePage) {
  EXPECT_EQ(Get("/api/v1/groups")["groups"],
            Json::parse(R"([{"name": "air west", "valves": ["V/*"]}])"));
}

TEST_F(PlannerRoutesTest, WorkListIsAFileToo) {
  const httplib::Result answer = client_->Get("/api/v1/worklist.csv");
  ASSERT_TRUE(answer);
  EXPECT_THAT(answer->get_header_value("Content-Type"), HasSubstr("text/csv"));
  EXPECT_THAT(answer->body, HasSubstr("\n1,V/1 a,"));
}

TEST_F(PlannerRoutesTest, AlarmsHaveTheScoreOfTheWorkList) {
  EXPECT_DOUBLE_EQ(Get("/api/v1/alarms")["alarms"][0]["score"],
                   Get("/api/v1/worklist")["rows"][0]["score"]);
}

TEST_F(PlannerRoutesTest, WorkListIsAPageToo) {
  const std::string later = std::to_string(kDetected / 1'000'000 + 3000'000);
  EXPECT_TRUE(Get("/api/v1/worklist?since_ms=" + later)["rows"].empty());

  const httplib::Result page = client_->Get("/api/v1/worklist.html");
  ASSERT_TRUE(page && page->status == 200);
  EXPECT_THAT(page->get_header_value("Content-Type"), HasSubstr("text/html"));
  // Its style is in it, and nothing else may run or load.
  EXPECT_EQ(page->get_header_value_count("Content-Security-Policy"), 1u);
  EXPECT_THAT(page->get_header_value("Content-Security-Policy"),
              HasSubstr("default-src 'none'; style-src 'unsafe-inline'"));
  EXPECT_THAT(page->body, HasSubstr("Flow transmitter wrong"));
  EXPECT_THAT(MalformedTags(page->body), testing::IsEmpty());
}

TEST_F(PlannerRoutesTest, MonthsOfAValveAreColumnsOfOneLength) {
  const Json months = Get("/api/v1/valves/V%2F1%20a/health");
  EXPECT_EQ(months["step"], "day");
  const std::size_t days = months["t_ms"].size();
  EXPECT_GE(days, 40u);
  EXPECT_EQ(months["d0"].size(), days);
  ASSERT_EQ(months["channels"].size(), 2u);
  for (const Json& channel : months["channels"]) {
    EXPECT_EQ(channel["mean"].size(), days);
  }
  EXPECT_EQ(months["trends"].size(), 2u);
  EXPECT_EQ(Get("/api/v1/valves/V%2F1%20a/health?hourly=1")["t_ms"].size(),
            24u * 40u);
  EXPECT_TRUE(Get("/api/v1/valves/none/health")["t_ms"].empty());
}

}  // namespace
}  // namespace fdi::console
