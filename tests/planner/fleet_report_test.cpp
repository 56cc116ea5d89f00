#include "planner/fleet_report.h"

#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "report/shared_files.h"
#include "storage/models/models.h"
#include "tests/html_check.h"
#include "tests/storage/history_fixture.h"

namespace fdi::planner {
namespace {

using report::Json;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const report::FaultTexts& Catalogue() {
  static const report::FaultTexts texts(report::SharedFile("faults.toml"));
  return texts;
}

class FleetReportTest : public storage::HistoryFixture {
 protected:
  static constexpr std::int64_t kDay = 86'400 * kSecond;

  FleetReportTest() : writer_(path_) {
    query_.now_ns = kDetected + 3600 * kSecond;
    query_.since_ns = query_.now_ns - 7 * kDay;
    query_.software = "1.0";
  }

  // A day with `live_h` hours judged and `other_h` in another quality.
  void Judge(const std::string& valve, int live_h, int other_h = 0,
             Quality other = Quality::kUncovered) {
    CoverageDay day{valve, kDetected / kDay, 1.0, {}};
    day.samples.Add(Quality::kLive, 3600 * live_h);
    day.samples.Add(other, 3600 * other_h);
    Checkpoint checkpoint;
    checkpoint.coverage = {day};
    writer_.CommitCheckpoint(checkpoint);
  }

  report::Report Made() {
    storage::HistoryReader history(path_);
    return FleetReport(&history, Catalogue(), query_);
  }
  Json Document() { return Made().document; }
  std::string Html() {
    std::ostringstream html;
    Made().PrintHtml(html, kFleetTitle, {true, true});
    return html.str();
  }

  storage::HistoryWriter writer_;
  FleetQuery query_;
};

TEST_F(FleetReportTest, EmptyHistoryIsSaidToBeEmpty) {
  const Json json = Document();
  EXPECT_EQ(json["coverage"]["loops"], 0);
  EXPECT_TRUE(json["worst"].empty());
  EXPECT_TRUE(json["changes"].is_null());
  EXPECT_THAT(Html(), AllOf(HasSubstr("No loop is known"),
                            HasSubstr("Nothing was found."),
                            HasSubstr("There is no earlier report")));
}

TEST_F(FleetReportTest, FindingHasItsFactorsAndWhoSawIt) {
  RecordEpisode(writer_, 0b100, "FV-1");  // f19
  storage::HistoryEditor(path_).Acknowledge("last", By("anna", kDetected));
  const Json json = Document();
  ASSERT_EQ(json["worst"].size(), 1u);
  const Json& finding = json["worst"][0];
  EXPECT_EQ(finding["rank"], 1);
  EXPECT_EQ(finding["valve_ids"], Json::array({"FV-1"}));
  EXPECT_EQ(finding["fault"], "f19");
  EXPECT_EQ(finding["name"], "Flow transmitter wrong");
  EXPECT_EQ(finding["severity"], "high");
  EXPECT_EQ(finding["severity_points"], 4.0);
  EXPECT_EQ(finding["grade"], nullptr);
  EXPECT_EQ(finding["certainty"], "likely");
  EXPECT_NEAR(finding["score"].get<double>(),
              4.0 * finding["confidence"].get<double>(), 1e-5);
  EXPECT_EQ(finding["acked_by"], "anna");
  EXPECT_EQ(finding["open"], false);
  EXPECT_THAT(finding["check"].get<std::string>(), Not(IsEmpty()));
}

TEST_F(FleetReportTest, GradeMovesALoopUpOrDown) {
  for (const char* valve : {"A", "B", "C"}) {
    RecordEpisode(writer_, 0b100, valve);
  }
  query_.loops = {{"A", 3}, {"C", 1}};
  const Json json = Document();
  EXPECT_EQ(json["worst"][0]["valve_ids"], Json::array({"C"}));
  EXPECT_EQ(json["worst"][1]["valve_ids"], Json::array({"B"}));
  EXPECT_EQ(json["worst"][2]["valve_ids"], Json::array({"A"}));
  EXPECT_DOUBLE_EQ(json["worst"][0]["score"].get<double>(),
                   4.0 * json["worst"][2]["score"].get<double>());
  query_.top = 2;
  EXPECT_EQ(Document()["others"][0]["rank"], 3);
}

TEST_F(FleetReportTest, LoopsOfOneCauseAreOneLine) {
  for (const char* valve : {"A", "B", "C"}) {
    RecordEpisode(writer_, 0b010, valve);
  }
  storage::CommonCause cause;
  cause.group = "air header";
  cause.opened_ns = kDetected;
  for (const char* valve : {"A", "B"}) {
    cause.members.push_back(
        {storage::EpisodeIdText(Id(valve)), valve, "f7", kDetected, {}});
  }
  query_.causes = {cause};
  const Json json = Document();
  ASSERT_EQ(json["worst"].size(), 2u);
  EXPECT_EQ(json["worst"][0]["valve_ids"], Json::array({"A", "B"}));
  EXPECT_EQ(json["worst"][0]["shares"], "cause: air header");
  EXPECT_EQ(json["worst"][1]["shares"], nullptr);
  EXPECT_EQ(json["shared"][0]["faults"], Json::array({"f7"}));
}

TEST_F(FleetReportTest, LoopsOfOnePeriodAreOneLineAndStictionIsAFinding) {
  query_.audits = {{"L1", "stiction", true, "two witnesses", 2.5, kDetected},
                   {"L2", "external", false, "a sine", {}, kDetected},
                   {"L3", "undetermined", false, "nothing", {}, kDetected},
                   {"L4", "tuning", false, "regular", {}, kDetected}};
  query_.periods = {{42.0, {"L1", "L2"}}};
  const Json json = Document();
  ASSERT_EQ(json["worst"].size(), 2u);
  EXPECT_EQ(json["worst"][0]["valve_ids"], Json::array({"L1", "L2"}));
  EXPECT_EQ(json["worst"][0]["shares"], "period: 42 s");
  EXPECT_EQ(json["worst"][0]["fault"], "stiction");
  EXPECT_DOUBLE_EQ(json["worst"][0]["score"].get<double>(), 2.0 * 0.9);
  EXPECT_EQ(json["worst"][1]["valve_ids"], Json::array({"L4"}));
  EXPECT_EQ(json["coverage"]["audit"], 4);
}

TEST_F(FleetReportTest, WhatIsNotJudgedIsListedWithItsReason) {
  Judge("A", 20);
  Judge("B", 2, 20, Quality::kInhibited);
  Judge("C", 0, 5, Quality::kUnassigned);
  query_.loops = {{"D"}, {"E", {}, "PV is constant"}};
  query_.not_audited = {{"C", "too short"}};
  const Json json = Document();
  EXPECT_EQ(
      json["coverage"],
      Json({{"loops", 5}, {"named_faults", 2}, {"audit", 0}, {"nothing", 3}}));
  const Json& unjudged = json["unjudged"];
  ASSERT_EQ(unjudged.size(), 4u);
  EXPECT_EQ(unjudged[0]["valve_id"], "B");
  EXPECT_EQ(unjudged[0]["reason"], "its loop was not in automatic");
  EXPECT_NEAR(unjudged[0]["judged_share"].get<double>(), 2.0 / 22.0, 1e-5);
  EXPECT_EQ(unjudged[1]["reason"],
            "it has no model set, and no window of its loop was judged; "
            "audit: too short");
  EXPECT_EQ(unjudged[2]["reason"], "no data came");
  EXPECT_EQ(unjudged[3]["reason"], "PV is constant");
}

// The time judged is stored once a minute.
TEST_F(FleetReportTest,
       WhatIsJudgedNowOrHasAnEpisodeIsWatchedFromTheBeginning) {
  RecordEpisode(writer_, 0b100, "A");
  query_.judged_now = {"B"};
  query_.loops = {{"C"}};
  const Json json = Document();
  EXPECT_EQ(json["coverage"]["named_faults"], 2);
  ASSERT_EQ(json["unjudged"].size(), 1u);
  EXPECT_EQ(json["unjudged"][0]["valve_id"], "C");
}

TEST_F(FleetReportTest, ChangesAreThoseSinceTheLastDocument) {
  RecordEpisode(writer_, 0b100, "A");
  Judge("A", 20);
  query_.last = Document();
  query_.last_file = "report.json";
  EXPECT_TRUE(Document()["changes"]["loops"].empty());

  storage::HistoryEditor(path_).Label("last", "false", By("anna", kDetected));
  RecordEpisode(writer_, 0b100, "B");
  query_.loops = {{"D"}};
  const Json changes = Document()["changes"];
  EXPECT_EQ(changes["last_utc"], (*query_.last)["made_utc"]);
  EXPECT_EQ(changes["coverage"]["loops"], 1);
  ASSERT_EQ(changes["loops"].size(), 3u);
  EXPECT_EQ(changes["loops"][0]["valve_id"], "A");
  EXPECT_EQ(changes["loops"][0]["change"], "gone");
  EXPECT_EQ(changes["loops"][0]["before"], "Flow transmitter wrong, high");
  EXPECT_EQ(changes["loops"][1]["valve_id"], "B");
  EXPECT_EQ(changes["loops"][1]["change"], "new");
  EXPECT_EQ(changes["loops"][2]["valve_id"], "D");
  EXPECT_EQ(changes["loops"][2]["change"], "new and not judged");

  query_.last = Document();
  query_.loops.clear();
  const Json later = Document()["changes"]["loops"];
  ASSERT_EQ(later.size(), 1u);
  EXPECT_EQ(later[0]["valve_id"], "D");
  EXPECT_EQ(later[0]["change"], "no longer known");
  query_.last = Document();

  (*query_.last)["worst"][0]["severity_points"] = "many";
  EXPECT_THROW(Document(), DataError);
  query_.last = {{"rows", 1}};
  EXPECT_THROW(Document(), DataError);
}

TEST_F(FleetReportTest, ShelvedFaultsAreListedApart) {
  RecordEpisode(writer_, 0b100, "A");
  storage::HistoryEditor(path_).Shelve("A", std::nullopt, query_.now_ns + kDay,
                                       By("bo", kDetected, "ordered"));
  const Json json = Document();
  EXPECT_TRUE(json["worst"].empty());
  ASSERT_EQ(json["shelved"].size(), 1u);
  EXPECT_EQ(json["shelved"][0]["who"], "bo");
}

TEST_F(FleetReportTest, PageIsWellFormedWhateverPeopleWrote) {
  const std::string bad = "<script>alert('&\")</script>";
  RecordEpisode(writer_, 0b100, bad);
  storage::HistoryEditor editor(path_);
  editor.Acknowledge("last", By("<b>anna", kDetected));
  editor.Shelve(bad, "f7", query_.now_ns + kDay,
                By("bo", kDetected, "</table><img src=x onerror=y>"));
  query_.not_audited = {{"<i>", "</td>"}};
  const std::string html = Html();
  EXPECT_THAT(html,
              AllOf(Not(HasSubstr("<script")), Not(HasSubstr("<img")),
                    Not(HasSubstr("<b>")), HasSubstr("&lt;script&gt;"),
                    HasSubstr("size:A4 landscape"), HasSubstr("@media print"),
                    HasSubstr("prefers-color-scheme:dark")));
  EXPECT_THAT(MalformedTags(html), IsEmpty());
}

TEST_F(FleetReportTest, WithoutHistoryTheAuditAndThePlantRemain) {
  query_.loops = {{"D", 2}};
  query_.audits = {{"L1", "no_response", false, "winds up", {}, kDetected}};
  const Json json = FleetReport(nullptr, Catalogue(), query_).document;
  EXPECT_EQ(
      json["coverage"],
      Json({{"loops", 2}, {"named_faults", 0}, {"audit", 1}, {"nothing", 1}}));
  EXPECT_EQ(json["worst"][0]["severity"], "high");
}

TEST_F(FleetReportTest, ValvesWithAnEntryOughtToBeThere) {
  const auto file = directory_.path() / "models.db";
  EXPECT_TRUE(LoopsOf(file).empty());
  {
    storage::ModelStore store(file, storage::Access::kOccasionalWriter);
    storage::ValveEntry entry;
    for (const char* pattern : {"FV-1", "FV-2*"}) {
      entry.pattern = pattern;
      store.PutValve(entry);
    }
  }
  const auto loops = LoopsOf(file);
  ASSERT_EQ(loops.size(), 1u);
  EXPECT_EQ(loops[0].valve_id, "FV-1");
}

}  // namespace
}  // namespace fdi::planner
