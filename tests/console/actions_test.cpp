// Actions of people on alarms over HTTP.
#include <gmock/gmock.h>

#include "tests/console/http_fixture.h"

namespace fdi::console {
namespace {

using ConsoleActionsTest = ConsoleRoutesTest;

TEST_F(ConsoleActionsTest, AnAlarmIsAcknowledgedLabelledAndShelved) {
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
  EXPECT_EQ(action["origin"], "console 10.1.2.3");
  const std::int64_t from_ms = shelf["until_ms"].get<std::int64_t>() + 1000;
  const Json planned = Post("/api/v1/shelf", {{"who", "bo"},
                                              {"valve", "LV-1"},
                                              {"minutes", 30},
                                              {"from_ms", from_ms}});
  EXPECT_EQ(planned["from_ms"], from_ms);
  EXPECT_EQ(Get("/api/v1/shelf")["shelf"].size(), 2U);
  Post("/api/v1/shelf/" + planned["shelf_id"].dump() + "/end", {{"who", "bo"}});
  Post("/api/v1/shelf/" + shelf["shelf_id"].dump() + "/end", {{"who", "bo"}});
  EXPECT_TRUE(Get("/api/v1/shelf")["shelf"].empty());
  Post("/api/v1/shelf/" + shelf["shelf_id"].dump() + "/end", {{"who", "bo"}},
       400);
}

TEST_F(ConsoleActionsTest, WithoutAProxyNothingIsChanged) {
  RecordEpisode(writer_, 4);
  Start(std::filesystem::path());

  const auto answer = client_->Post("/api/v1/episodes/" + IdText() + "/ack",
                                    {{"Origin", Origin()}}, R"({"who":"eve"})",
                                    "application/json");
  EXPECT_EQ(answer->status, 403);
  EXPECT_THAT(TakeLog(),
              testing::HasSubstr("console_refused reason=read_only"));
  EXPECT_EQ(Get("/api/v1/status")["write"], false);
  EXPECT_EQ(Get("/api/v1/alarms")["alarms"].size(), 1U);
}

TEST_F(ConsoleActionsTest, BodiesThatCannotBeAreRefused) {
  RecordEpisode(writer_, 4);
  Start();
  const std::string episode = "/api/v1/episodes/" + IdText();

  Post(episode + "/ack", Json::array(), 400);
  Post(episode + "/label", {{"who", "anna"}, {"label", "f99"}}, 400);
  for (const Json& from : {Json("now"), Json(-1), Json(1.5), Json(1)}) {
    Post("/api/v1/shelf",
         {{"who", "bo"}, {"valve", "LV-1"}, {"minutes", 5}, {"from_ms", from}},
         400);
  }
  for (const Json& minutes : {Json(0), Json(-5), Json("30"), Json(1e9)}) {
    Post("/api/v1/shelf",
         {{"who", "bo"}, {"valve", "LV-1"}, {"minutes", minutes}}, 400);
  }
  Post("/api/v1/shelf/77/end", {{"who", "bo"}}, 404);
  const httplib::Result large =
      client_->Post(episode + "/ack", {{"Origin", Origin()}},
                    std::string(20'000, 'x'), "application/json");
  EXPECT_TRUE(!large || large->status == 413);
}

TEST_F(ConsoleActionsTest, AnOpenAlarmIsListedOnceAcknowledgedOrNot) {
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

}  // namespace
}  // namespace fdi::console
