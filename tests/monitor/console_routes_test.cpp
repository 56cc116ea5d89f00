// The console over real HTTP, beside a history, without a pipeline.
#include <fstream>

#include <gmock/gmock.h>
#include <httplib.h>

#include "diagnosis/error.h"
#include "diagnosis/valve_engine.h"
#include "monitor/console/console.h"
#include "storage/cli/time_text.h"
#include "storage/models.h"
#include "storage/plot/gnuplot.h"
#include "tests/monitor/linear_models.h"
#include "tests/storage/history_fixture.h"
#include "tests/storage/message_of.h"

namespace fdi::console {
namespace {

using monitor::PlantSample;
using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* kToken = "0123456789abcdef";

class NoBus : public monitor::EventSink {
 public:
  bool Publish(const monitor::EpisodeEvent& /*event*/,
               bool /*persisted*/) override {
    return true;
  }
};

class ConsoleRoutesTest : public storage::HistoryFixture {
 protected:
  ConsoleRoutesTest() : writer_(path_) {
    writer_.BeginSession(kDetected - kSecond, "test", "");
    const auto folder = directory_.path() / "page";
    std::filesystem::create_directory(folder);
    std::ofstream(folder / "index.html") << "<title>page</title>";
    std::ofstream(directory_.path() / "secret.txt") << "secret";
    std::ofstream(directory_.path() / "token") << kToken << '\n';
    storage::ModelStore(directory_.path() / "models.db",
                        storage::Access::kOccasionalWriter);
  }

  void Start(bool writable = true) {
    ConsoleOptions options;
    options.address.host = "127.0.0.1";
    options.files = directory_.path() / "page";
    if (writable) {
      options.token_file = directory_.path() / "token";
    }
    console_.emplace(options, cli::GlobalOptions{},
                     [this](LogLevel, std::string_view line) {
                       if (line.starts_with("console_listening")) {
                         listening_ = line;
                       }
                     });
    events_ = &console_->Before(bus_);
    console_->Start({path_, directory_.path() / "models.db", "0.0", kDetected,
                     [] {
                       return MonitorFacts{"OK", {{"received", 7}}, 1};
                     },
                     cli::NowNs});
    const std::size_t colon = listening_.find(':');
    client_.emplace("127.0.0.1", std::stoi(listening_.substr(colon + 1)));
  }

  /// Begins an episode so many seconds after the others.
  void RecordLater(const std::string& valve, double after_s) {
    storage::NewEvent event = Event(TransitionKind::kDetected, after_s, 0, 0.3,
                                    EndReason::kNone, valve);
    event.transition.detection_stamp_ns = event.transition.stamp_ns;
    writer_.Record(event);
  }

  void ShowValve(const std::string& id, int samples, double offset = 0.0) {
    const auto models = monitor::SharedLinearModels();
    ValveEngine engine(models);
    for (int k = 0; k < samples; ++k) {
      const Sample sample =
          PlantSample(static_cast<std::uint64_t>(k), k < 50 ? 0.0 : offset);
      console_->live().Show(id, sample, models.get(), engine.Step(sample),
                            false);
    }
  }

  Json Get(const std::string& path, int status = 200) {
    const httplib::Result answer = client_->Get(path);
    EXPECT_TRUE(answer) << path;
    if (!answer) {
      return {};
    }
    EXPECT_EQ(answer->status, status) << path << answer->body;
    return Json::parse(answer->body);
  }
  Json Post(const std::string& path, const Json& body, int status = 200,
            const std::string& token = kToken) {
    const httplib::Result answer =
        client_->Post(path, {{"Authorization", "Bearer " + token}}, body.dump(),
                      "application/json");
    EXPECT_TRUE(answer) << path;
    if (!answer) {
      return {};
    }
    EXPECT_EQ(answer->status, status) << path << answer->body;
    return Json::parse(answer->body);
  }
  std::string IdText() const { return storage::EpisodeIdText(Id()); }

  storage::HistoryWriter writer_;
  NoBus bus_;
  std::optional<Console> console_;
  monitor::EventSink* events_{nullptr};
  std::string listening_;
  std::optional<httplib::Client> client_;
};

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
  Start();

  EXPECT_EQ(
      client_->Get("/api/v1/valves", {{"Host", "evil.example:80"}})->status,
      403);
  EXPECT_EQ(
      client_->Get("/api/v1/valves", {{"Host", "localhost:9000"}})->status,
      200);
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

TEST_F(ConsoleRoutesTest, AnAlarmIsAcknowledgedLabelledAndShelved) {
  RecordEpisode(writer_, 4);
  Start();
  const std::string episode = "/api/v1/episodes/" + IdText();
  ASSERT_EQ(Get("/api/v1/alarms")["alarms"].size(), 1U);
  EXPECT_EQ(Get("/api/v1/alarms")["alarms"][0]["isa"], "RTN_UNACK");

  const Json acked =
      Post(episode + "/ack", {{"who", "anna"}, {"comment", "seen"}});
  Post(episode + "/label", {{"who", "anna"}, {"label", "f7"}});
  const Json shelf = Post("/api/v1/shelf",
                          {{"who", "bo"}, {"valve", "LV-1"}, {"minutes", 30}});

  EXPECT_EQ(acked["isa"], "NORMAL");
  EXPECT_EQ(acked["acked_by"], "anna");
  EXPECT_TRUE(Get("/api/v1/alarms")["alarms"].empty());
  const Json row = Get("/api/v1/history")["episodes"][0];
  EXPECT_EQ(row["label"], "f7");
  EXPECT_EQ(row["shelved"]["who"], "bo");
  const Json action = Get(episode)["events"][4];
  EXPECT_EQ(action["kind"], "ACK");
  EXPECT_EQ(action["comment"], "seen");
  EXPECT_EQ(action["origin"], "console 127.0.0.1");
  Post("/api/v1/shelf/" + shelf["shelf_id"].dump() + "/end", {{"who", "bo"}});
  EXPECT_TRUE(Get("/api/v1/shelf")["shelf"].empty());
  Post("/api/v1/shelf/" + shelf["shelf_id"].dump() + "/end", {{"who", "bo"}},
       400);
}

TEST_F(ConsoleRoutesTest, WithoutTheTokenNothingIsChanged) {
  RecordEpisode(writer_, 4);
  Start();
  const std::string ack = "/api/v1/episodes/" + IdText() + "/ack";

  Post(ack, {{"who", "eve"}}, 401, "0123456789abcdeF");
  EXPECT_EQ(client_->Post(ack, "{}", "application/json")->status, 401);
  EXPECT_EQ(Get("/api/v1/alarms")["alarms"].size(), 1U);
  console_.reset();
  Start(/*writable=*/false);
  Post(ack, {{"who", "eve"}}, 403);
  Post(ack, {{"who", "eve"}}, 403, "");
  EXPECT_EQ(Get("/api/v1/status")["write"], false);
  EXPECT_EQ(Get("/api/v1/alarms")["alarms"].size(), 1U);
}

TEST_F(ConsoleRoutesTest, BodiesThatCannotBeAreRefused) {
  RecordEpisode(writer_, 4);
  Start();
  const std::string episode = "/api/v1/episodes/" + IdText();

  Post(episode + "/ack", Json::array(), 400);
  Post(episode + "/ack", {{"comment", "nobody"}}, 400);
  Post(episode + "/ack", {{"who", 7}}, 400);
  Post(episode + "/label", {{"who", "anna"}, {"label", "f99"}}, 400);
  for (const Json& minutes : {Json(0), Json(-5), Json("30"), Json(1e9)}) {
    Post("/api/v1/shelf",
         {{"who", "bo"}, {"valve", "LV-1"}, {"minutes", minutes}}, 400);
  }
  Post("/api/v1/shelf/77/end", {{"who", "bo"}}, 404);
  const httplib::Result large =
      client_->Post(episode + "/ack", {{"Authorization", "Bearer x"}},
                    std::string(20'000, 'x'), "application/json");
  EXPECT_TRUE(!large || large->status == 413);
}

TEST_F(ConsoleRoutesTest, AnEpisodeComesWithItsEvidence) {
  RecordEpisode(writer_, 4);
  writer_.AppendTrace(Id(), Instants(60, -30.0));
  writer_.Commit(kDetected);
  Start();

  const Json answer = Get("/api/v1/episodes/" + IdText());
  EXPECT_EQ(answer["episode"]["fault"], "f19");
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
  if (storage::HaveGnuplot()) {
    EXPECT_THAT(picture->body, HasSubstr("<svg"));
    EXPECT_EQ(picture->get_header_value("Content-Type"), "image/svg+xml");
  } else {
    EXPECT_EQ(picture->status, 404);
  }
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

TEST_F(ConsoleRoutesTest, AnOpenAlarmIsListedOnceAcknowledgedOrNot) {
  RecordLater("A", 0.0);
  RecordLater("B", 100.0);
  Start();
  const Json alarms = Get("/api/v1/alarms")["alarms"];
  ASSERT_EQ(alarms.size(), 2U);
  EXPECT_EQ(alarms[0]["valve"], "B");

  const std::string id = alarms[0]["episode"];
  Post("/api/v1/episodes/" + id + "/ack", {{"who", "anna"}});
  const Json after = Get("/api/v1/alarms")["alarms"];
  ASSERT_EQ(after.size(), 2U);
  EXPECT_EQ(after[0]["isa"], "ACKED");
  EXPECT_EQ(after[1]["isa"], "UNACK");
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
