// Answers of the console over HTTP, and who gets them.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include <gmock/gmock.h>

#include "base/error.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/plot/gnuplot.h"
#include "storage/models/plant_loops.h"
#include "tests/console/http_fixture.h"
#include "tests/storage/message_of.h"

namespace fdi::console {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

TEST_F(ConsoleRoutesTest, EveryAnswerForbidsWhatThePageDoesNotNeed) {
  Start();
  for (const char* path : {"/", "/api/v1/status", "/api/v1/none", "/none"}) {
    const httplib::Result answer = client_->Get(path);
    EXPECT_THAT(answer->get_header_value("Content-Security-Policy"),
                StartsWith("default-src 'self';"));
    EXPECT_EQ(answer->get_header_value("X-Content-Type-Options"), "nosniff");
    EXPECT_FALSE(answer->has_header("Access-Control-Allow-Origin"));
  }
  EXPECT_EQ(client_->Get("/")->body, "<title>page</title>");
  EXPECT_EQ(client_->Get("/../secret.txt")->status, 404);
  EXPECT_EQ(client_->Get("/%2e%2e/secret.txt")->status, 404);
  EXPECT_THAT(std::string(Get("/api/v1/none", 404)["error"]),
              HasSubstr("/api/v1/none"));
}

TEST_F(ConsoleRoutesTest, AForeignHostNameIsRefused) {
  Start(WriteSecret());
  httplib::Headers headers{{"Host", "evil.example:80"}};
  EXPECT_EQ(client_->Get("/api/v1/valves", headers)->status, 403);
  EXPECT_EQ(client_->Get("/", headers)->status, 403);
  EXPECT_EQ(
      client_->Get("/api/v1/valves", {{"Host", "localhost:9000"}})->status,
      200);
  // A proxy has names of its own.
  headers.merge(ProxyHeaders("anna", "view"));
  EXPECT_EQ(client_->Get("/api/v1/valves", headers)->status, 200);
}

TEST_F(ConsoleRoutesTest, ValvesAndTrendsOfAnyId) {
  Start();
  const std::string id = "area 1/FV\"1%?";
  ShowValve(id, 80, monitor::kF7Offset);

  const Json tile = Get("/api/v1/valves")["valves"][0];
  EXPECT_EQ(tile["id"], id);
  EXPECT_EQ(tile["state"], "ISOLATED");
  EXPECT_EQ(tile["faults"], Json::array({"f7"}));
  EXPECT_EQ(tile["spark"].size(), 60U);
  const Json trend =
      Get("/api/v1/valves/area%201%2FFV%221%25%3F/trend?seconds=9");
  EXPECT_EQ(trend["valve"], id);
  EXPECT_EQ(trend["t_ms"].size(), 10U);
  EXPECT_EQ(trend["x"], Json(std::vector<double>(10, 30.0)));
  EXPECT_EQ(trend["residuals"][0][9], -20.0);
  EXPECT_EQ(trend["d"].size(), 2U);
  EXPECT_FALSE(trend.contains("p1"));
  EXPECT_THAT(std::string(trend["words"]),
              StartsWith("rod position 20 % below what the normal model "
                         "expects; fits: "));
  EXPECT_EQ(Get("/api/v1/status")["model_sets"][0]["T"], 0.7);
}

TEST_F(ConsoleRoutesTest, APvAndItsSetPointHaveSevenDigitsInAnyUnit) {
  Start();
  const auto models = monitor::SharedLinearModels();
  Verdict verdict;
  verdict.quality = Quality::kLive;
  Sample sample = monitor::PlantSample(0);
  sample.Set(Signal::kPv, 1234567.891);
  sample.Set(Signal::kSp, 0.000123456789);
  console_->live().OnVerdict("V1", sample, {verdict, models.get(), false});
  const Json trend = Get("/api/v1/valves/V1/trend?seconds=9");
  EXPECT_EQ(trend["pv"], Json::array({1234568.0}));
  EXPECT_EQ(trend["sp"], Json::array({0.0001234568}));
}

TEST_F(ConsoleRoutesTest, AValveThatIsNotJudgedIsNotCalledNormal) {
  Start();
  const auto models = monitor::SharedLinearModels();
  Verdict verdict;
  verdict.quality = Quality::kBadInput;
  console_->live().OnVerdict(
      "V1", monitor::PlantSample(0),
      {verdict, models.get(), false, MaskOf(Signal::kF)});

  const Json tile = Get("/api/v1/valves")["valves"][0];

  EXPECT_EQ(tile["state"], "NOT_JUDGED");
  EXPECT_EQ(tile["quality"], "BAD_INPUT");
  EXPECT_EQ(tile["missing"], Json::array({"F"}));
}

TEST_F(ConsoleRoutesTest, WhatIsPartlyJudgedIsNotCalledNormal) {
  Start();
  const auto models = monitor::SharedLinearModels();
  Verdict verdict;
  verdict.quality = Quality::kLive;
  verdict.confidence = 1.0;
  const auto show = [&](const Sample& sample) {
    console_->live().OnVerdict("V1", sample, {verdict, models.get(), false});
    return Get("/api/v1/valves")["valves"][0];
  };
  EXPECT_EQ(show(monitor::PlantSample(0))["state"], "NORMAL");

  verdict.residuals[0] = std::numeric_limits<double>::quiet_NaN();
  const Json partly = show(monitor::PlantSample(1));

  EXPECT_EQ(partly["state"], "PARTLY_JUDGED");
  EXPECT_EQ(partly["unjudged"], Json::array({"X"}));
  EXPECT_TRUE(partly["refused"].is_null());

  verdict.residuals[0] = 0.0;
  verdict.confidence = 0.0;
  const Json blind = show(monitor::PlantSample(2));
  EXPECT_EQ(blind["state"], "PARTLY_JUDGED");
  EXPECT_EQ(blind["blind"], true);

  verdict.confidence = 1.0;
  verdict.intake = Intake::kSuperseded;
  monitor::ValveOutcome outcome{verdict, models.get(), false};
  outcome.contested = true;
  console_->live().OnVerdict("V1", monitor::PlantSample(3), outcome);
  const Json contested = Get("/api/v1/valves")["valves"][0];
  EXPECT_EQ(contested["state"], "PARTLY_JUDGED");
  EXPECT_EQ(contested["contested"], true);

  verdict.quality = Quality::kBadInput;
  verdict.intake = Intake::kRange;
  const Json refused = show(monitor::PlantSample(3, 1e6));

  EXPECT_EQ(refused["state"], "NOT_JUDGED");
  EXPECT_EQ(refused["refused"]["reason"], "range");
  EXPECT_EQ(refused["refused"]["signals"], Json::array({"X"}));
  EXPECT_TRUE(refused["unjudged_since_ms"].is_null());
  EXPECT_TRUE(refused["why"].is_null());

  outcome.unjudged_ns = 3'000'000'000;
  console_->live().OnVerdict("V1", monitor::PlantSample(4), outcome);
  const Json since = Get("/api/v1/valves")["valves"][0];
  EXPECT_EQ(since["unjudged_since_ms"], 3000);
  EXPECT_EQ(since["why"], "BAD_INPUT range");
}

TEST_F(ConsoleRoutesTest, OpenCommonCausesAndWhatALabelMayBe) {
  RecordEpisode(writer_, 4);
  storage::Transaction transaction(writer_.database());
  writer_.database().Run(
      "INSERT INTO common_cause VALUES ('00000000000000aa', 'air', 5000000, "
      "NULL), ('00000000000000bb', 'air', 1000000, 2000000)");
  writer_.database().Run(
      "INSERT INTO common_cause_member SELECT '00000000000000aa', "
      "episode_id, valve_id, 'f7', detected_ns FROM episode");
  transaction.Commit();
  Start();

  const Json causes = Get("/api/v1/causes")["causes"];
  ASSERT_EQ(causes.size(), 1U);
  EXPECT_EQ(causes[0]["group"], "air");
  EXPECT_EQ(causes[0]["opened_ms"], 5);
  EXPECT_EQ(causes[0]["members"][0]["fault"], "f7");

  const Json known = Get("/api/v1/faults");
  for (const Json& fault : known["faults"]) {
    EXPECT_EQ(fault["label"],
              ParseFault(fault["fault"].get<std::string>()).has_value());
  }
}

TEST_F(ConsoleRoutesTest, WhatCannotBeIsRefusedWithTheRange) {
  Start();
  ShowValve("V1", 3);

  EXPECT_THAT(
      std::string(Get("/api/v1/valves/V1/trend?seconds=0", 400)["error"]),
      HasSubstr("seconds=0: expected a whole number of 1..86400"));
  EXPECT_THAT(std::string(Get("/api/v1/history?limit=9999", 400)["error"]),
              HasSubstr("1..1000"));
  Get("/api/v1/history?state=nonsense", 400);
  Get("/api/v1/history?fault=f99", 400);
  Get("/api/v1/valves/V2/trend", 404);
  Get("/api/v1/episodes/0123456789abcdef", 404);
}

TEST_F(ConsoleRoutesTest, WhatAValveServesComesFromItsEntryAndThePlantsTable) {
  {
    storage::ModelStore models(directory_.path() / "models.db",
                               storage::Access::kOccasionalWriter);
    storage::ValveEntry entry;
    entry.pattern = "LV-*";
    entry.type = "globe DN100";
    models.PutValve(entry);
    storage::PlantLoop loop;
    loop.name = "LV-1";
    loop.service = "L";
    loop.grade = 1;
    loop.description = "Feed";
    models.PutLoop(loop, entry);
  }
  Start();

  EXPECT_EQ(Get("/api/v1/valves/LV-1/about"),
            Json::parse(R"({"type": "globe DN100", "service": "L",
                            "description": "Feed", "location": null,
                            "document": null, "grade": 1, "group": null,
                            "repairs": []})"));
  EXPECT_EQ(Get("/api/v1/valves/FV-1/about"),
            Json::parse(R"({"type": null, "service": null,
                            "description": null, "location": null,
                            "document": null, "grade": null, "group": null,
                            "repairs": []})"));
}

TEST_F(ConsoleRoutesTest, AnEpisodeComesWithItsEvidence) {
  RecordEpisode(writer_, 4);
  writer_.AppendTrace(Id(), Instants(60, -30.0));
  writer_.Commit(kDetected);
  for (const int day : {0, 1, 2}) {
    const double strength = -0.2 - 0.1 * day;
    writer_.StoreStrength({Id(), kDetected + day * kNsPerDay, 19, strength,
                           strength - 0.01, strength + 0.01, Layer::kPhysics});
  }
  Start();

  const Json answer = Get("/api/v1/episodes/" + IdText());
  EXPECT_EQ(answer["episode"]["fault"], "f19");
  ASSERT_EQ(answer["growth"].size(), 1U);
  const Json& growth = answer["growth"][0];
  EXPECT_EQ(growth["strength"], -0.4);
  EXPECT_EQ(growth["rate"]["value"], 0.1);
  EXPECT_GT(growth["rate"]["lowest"], 0.0);
  EXPECT_NEAR(growth["full_in_ms"]["value"].get<double>(), 6 * 86.4e6, 1.0);
  EXPECT_EQ(answer["events"].size(), 4U);
  EXPECT_EQ(answer["model_hash"], "fedcba9876543210");
  const Json& trace = answer["trace"];
  EXPECT_EQ(trace["t_ms"].size(), 60U);
  EXPECT_EQ(trace["t_ms"][30], kDetected / 1'000'000);
  EXPECT_EQ(trace["marks"][1]["kind"], "ISOLATED");
  EXPECT_EQ(trace["channels"][1]["name"], "F");
  EXPECT_TRUE(trace["channels"][1]["low"].is_null());  // The set is gone.
  const httplib::Result csv =
      client_->Get("/api/v1/episodes/" + IdText() + ".csv");
  EXPECT_THAT(csv->body,
              StartsWith("utc,CV_pct,X_pct,F_m3_h,r_X,r_F,d0,d_f1,d_f7,d_f19,"
                         "state,quality\n2026-11-20T14:55:41Z,40.0,"));
  EXPECT_EQ(std::count(csv->body.begin(), csv->body.end(), '\n'), 61);
  const httplib::Result picture =
      client_->Get("/api/v1/episodes/" + IdText() + ".svg");
  if (plot::HaveGnuplot()) {
    EXPECT_THAT(picture->body, HasSubstr("<svg"));
    EXPECT_EQ(picture->get_header_value("Content-Type"), "image/svg+xml");
  } else {
    EXPECT_EQ(picture->status, 404);
  }
}

// On the page of the valve, in its trend, and in the episode before it.
TEST_F(ConsoleRoutesTest, ARepairIsSeenWhereverTheValveIs) {
  RecordEpisode(writer_, 4);
  writer_.AppendTrace(Id(), Instants(60, -30.0));
  writer_.Commit(kDetected);
  const std::string valve = Event(TransitionKind::kDetected, 0, 0, 0).valve_id;
  {
    storage::ModelStore models(directory_.path() / "models.db",
                               storage::Access::kOccasionalWriter);
    storage::ValveEvent event;
    event.kind = storage::ValveEventKind::kRecalibrated;
    event.who = "bo";
    event.at_ns = kDetected + 10 * kNsPerSecond;
    models.AddValveEvent("*", event);
    event.at_ns = monitor::PlantSample(75).stamp_ns;
    models.AddValveEvent("V7", event);
    event.kind = storage::ValveEventKind::kOrdered;
    models.AddValveEvent("V7", event);
  }
  Start();
  const Json answer = Get("/api/v1/episodes/" + IdText());
  ASSERT_EQ(answer["repairs"].size(), 1U);
  EXPECT_EQ(answer["repairs"][0]["who"], "bo");
  EXPECT_EQ(answer["trace"]["marks"].back()["kind"], "recalibrated");
  EXPECT_EQ(Get("/api/v1/valves/" + valve + "/about")["repairs"].size(), 1U);
  ShowValve("V7", 80, 0.0);
  const Json marks = Get("/api/v1/valves/V7/trend?seconds=900")["marks"];
  EXPECT_TRUE(std::ranges::any_of(marks, [](const Json& mark) {
    return mark["kind"] == "recalibrated";
  })) << marks;
  EXPECT_TRUE(std::ranges::none_of(marks, [](const Json& mark) {
    return mark["kind"] == "ordered";
  })) << marks;

  // The trend goes on without what cannot be read.
  std::filesystem::remove(directory_.path() / "models.db");
  std::ofstream(directory_.path() / "models.db") << "damaged";
  EXPECT_FALSE(Get("/api/v1/valves/V7/trend?seconds=900")["t_ms"].empty());
}

TEST_F(ConsoleRoutesTest, HistoryIsPagedNewestFirst) {
  RecordLater("A", 0.0);
  RecordLater("B", 100.0);
  RecordLater("C", 200.0);
  Start();

  const Json page = Get("/api/v1/history?limit=2");
  ASSERT_EQ(page["episodes"].size(), 2U);
  EXPECT_EQ(page["episodes"][0]["valve"], "C");
  EXPECT_EQ(page["more"], true);
  const std::string last = page["episodes"][1]["detected_ms"].dump();
  const Json rest = Get("/api/v1/history?limit=2&before_ms=" + last);
  ASSERT_EQ(rest["episodes"].size(), 1U);
  EXPECT_EQ(rest["episodes"][0]["valve"], "A");
  EXPECT_EQ(rest["more"], false);
  EXPECT_EQ(Get("/api/v1/history?valve=B")["episodes"].size(), 1U);
  const Json statistics = Get("/api/v1/statistics");
  EXPECT_EQ(statistics["valves"].size(), 3U);
  EXPECT_EQ(statistics["per_day"][0]["day"], "2026-11-20");
  EXPECT_EQ(statistics["per_day"][0]["episodes"], 3);
}

TEST_F(ConsoleRoutesTest, PagesLoseNoEpisodeOfTheSameInstant) {
  RecordLater("A", 0.0);
  RecordLater("B", 100.0);
  RecordLater("C", 100.0002);
  RecordLater("D", 100.0002);
  RecordLater("E", 200.0);
  Start();

  std::string valves;
  std::string query = "/api/v1/history?limit=2";
  for (bool more = true; more;) {
    const Json page = Get(query);
    for (const Json& row : page["episodes"]) {
      valves += row["valve"];
    }
    query = "/api/v1/history?limit=2&before_ms=" +
            page["episodes"].back()["detected_ms"].dump();
    more = page["more"];
  }

  EXPECT_EQ(valves, "EDCBA");
}

TEST_F(ConsoleRoutesTest, ItsEndEndsStreamsAndThreads) {
  Start();
  std::jthread listener([this] {
    client_->Get("/api/v1/stream", [](const char* /*data*/,
                                      std::size_t /*size*/) { return true; });
  });
  while (console_->streams().clients == 0) {
    std::this_thread::yield();
  }

  console_.reset();  // As when something throws after the console started.

  listener.join();
  EXPECT_FALSE(client_->Get("/api/v1/status"));
}

TEST(ConsoleFilesTest, AFolderWithoutAPageIsNamed) {
  const storage::TemporaryDirectory empty;

  EXPECT_THAT(
      storage::MessageOf<ConfigError>([&] { FindConsoleFiles(empty.path()); }),
      testing::AllOf(HasSubstr(empty.path().string()),
                     HasSubstr("no index.html")));
}

}  // namespace
}  // namespace fdi::console
