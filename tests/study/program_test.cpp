// Runs the built programs: other detectors, reduced sets, repeated seeds.
#include <gmock/gmock.h>

#include "tests/study/fixture.h"

namespace fdi::trainer::study {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class StudyVerdictsTest : public StudyProgram {
 protected:
  // 1000 s, f6 from 700 s on.
  void SetUp() override {
    std::string text = "t_s,CV_pct,X_pct,F_m3_h,fault,fault_strength\n";
    for (int t = 0; t < 1000; ++t) {
      text += std::to_string(t) +
              (t < 700 ? ",60,60,17,normal,0\n" : ",60,60,20,f6,0.3\n");
    }
    Write("run.csv", text);
  }
  // Detects from `from` on and names `faults` from `named` on.
  void WriteVerdicts(const std::string& name, int from, int named,
                     const std::string& faults, int count = 1000) const {
    std::string text = "t_s,detected,faults\n";
    for (int t = 0; t < count; ++t) {
      text += std::to_string(t) + (t < from ? ",0," : ",1,") +
              (t < named ? "" : faults) + '\n';
    }
    Write(name, text);
  }
  Outcome Score(const std::string& file) const {
    return Study("verdicts " + file + " --file run.csv");
  }
};

TEST_F(StudyVerdictsTest, AnotherDetectorIsScoredByTheSameIndices) {
  WriteVerdicts("v.csv", 720, 750, "f18|f6");
  const json result = StudyJson("verdicts v.csv --file run.csv");
  const json& run = result["runs"][0];
  EXPECT_EQ(run["detected"], true);
  EXPECT_EQ(run["t_dt"], 20.0);
  EXPECT_EQ(run["t_it"], 50.0);
  EXPECT_EQ(run["d_acc"], 0.5);
  EXPECT_EQ(run["r_fd"], 0.0);
  EXPECT_EQ(run["final_set"], json::array({"f6", "f18"}));
  EXPECT_EQ(result["summary"]["detector"], "v.csv");
  EXPECT_EQ(result["summary"]["contained"], 1);
}

TEST_F(StudyVerdictsTest, DetectionAloneNeedsNoFaultColumnAndOtherRowsAreLeft) {
  std::string text = "detected,t_s\n";
  for (int t = 0; t < 1000; ++t) {
    text += (t < 720 ? "0," : "1,") + std::to_string(t) + '\n';
  }
  Write("v.csv", text);
  const json result = StudyJson("verdicts v.csv --file run.csv@100:900");
  EXPECT_EQ(result["runs"][0]["t_dt"], 20.0);
  EXPECT_EQ(result["runs"][0]["d_acc"], 0.0);
}

TEST_F(StudyVerdictsTest, BadVerdictsAreRefusedWithTheirLine) {
  WriteVerdicts("short.csv", 720, 750, "f6", 999);
  const Outcome missing = Score("short.csv");
  EXPECT_EQ(missing.code, 3);
  EXPECT_THAT(missing.err, AllOf(HasSubstr("short.csv"), HasSubstr("999")));
  WriteVerdicts("name.csv", 720, 750, "f6|f99");
  EXPECT_THAT(Score("name.csv").err, HasSubstr("name.csv:752: fault 'f99'"));
  WriteVerdicts("early.csv", 720, 700, "f6");
  EXPECT_THAT(Score("early.csv").err,
              HasSubstr("early.csv:702: faults without"));
  Write("half.csv", "t_s,detected\n0,0.5\n");
  EXPECT_THAT(Score("half.csv").err, HasSubstr("half.csv:2: detected is 0.5"));
  Write("time.csv", "t_s,detected\n0,0\n0,1\n");
  EXPECT_THAT(Score("time.csv").err,
              HasSubstr("time.csv:3: t_s does not rise"));
  Write("column.csv", "t_s,alarm\n0,0\n");
  EXPECT_THAT(Score("column.csv").err, HasSubstr("column detected is missing"));
  Write("blank.csv", "\n\nt_s,alarm\n0,0\n");
  EXPECT_THAT(Score("blank.csv").err, HasSubstr("blank.csv:3: column"));
  EXPECT_EQ(Score("none.csv").code, 5);
  EXPECT_EQ(Score("short.csv,name.csv").code, 2);
}

class StudyReducedTest : public StudyProgram {
 protected:
  static std::string Faults(const std::string& list) {
    return "[[run]]\nsimulate = {duration_s = 900}\n"
           "[[run]]\nsimulate = {seed = 5}\nfaults = [" +
           list +
           "]\nstrengths = [0.5]\n"
           "[[validation]]\nsimulate = {duration_s = 400}\n"
           "faults = [\"f19:abrupt@200\", \"f1:abrupt@200\"]\n"
           "strengths = [0.5]\n";
  }
  void SetUp() override {
    Write("two.toml", Quick("two") + Faults("\"f19\", \"f1\""));
    ASSERT_EQ(Run("train --campaign two.toml").code, 0) << Read("err.txt");
  }
};

TEST_F(StudyReducedTest, SetWithoutAFaultAnswersAsIfNeverToldOfIt) {
  Write("one.toml", Quick("one") + Faults("\"f19\""));
  ASSERT_EQ(Run("train --campaign one.toml").code, 0) << Read("err.txt");
  const std::string score = " --campaign two.toml --vectors ";
  ASSERT_EQ(Study("evaluate --model-set one" + score + "one.csv").code, 0);
  ASSERT_EQ(Study("reduce two --as less --without f1").code, 0);
  ASSERT_EQ(Study("evaluate --model-set less" + score + "two.csv").code, 0);
  EXPECT_EQ(Read("one.csv"), Read("two.csv"));
}

// A week without samples is no week without an alarm.
TEST_F(StudyReducedTest, GapsAreNoHoursWithoutFault) {
  std::string csv = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h\n";
  for (int k = 0; k < 360; ++k) {
    csv +=
        std::to_string(k < 180 ? k : k + 604800) + ",70,3500,2600,100,70,17\n";
  }
  Write("gap.csv", csv);
  const json summary = RunJson(
      "evaluate --model-set two --file gap.csv --assume-normal")["summary"];
  EXPECT_NEAR(summary["fault_free_hours"].get<double>(), 0.1, 1e-9);
}

TEST_F(StudyReducedTest, FaultLeftOutIsUnknownOrWronglyNamed) {
  const json result =
      StudyJson("leave-one-out --model-set two --campaign two.toml");
  ASSERT_EQ(result["left_out"].size(), 2U);
  EXPECT_EQ(result["left_out"][0]["fault"], "f1");
  for (const json& fault : result["left_out"]) {
    EXPECT_EQ(fault["runs"], 1);
    EXPECT_EQ(fault["detected"], 1);
    EXPECT_EQ(fault["unknown"].get<int>() + fault["wrongly_named"].get<int>(),
              1);
    EXPECT_FALSE(fault["named"].contains(fault["fault"].get<std::string>()));
  }
  EXPECT_EQ(result["total"]["runs"], 2);
}

TEST_F(StudyReducedTest, ChannelLeftOutIsMissedInTheVectors) {
  const std::string call = "reduce two --as less ";
  ASSERT_EQ(Study(call + "--without-channels x").code, 0);
  ASSERT_EQ(
      Study("evaluate --model-set less --campaign two.toml --vectors v.csv")
          .code,
      0);
  const std::string head = Read("v.csv").substr(0, 200);
  EXPECT_THAT(head, HasSubstr("state,r_F,d_0"));
  const Outcome unknown = Study(call + "--without-channels T1");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, AllOf(HasSubstr("'T1'"), HasSubstr("X F")));
  EXPECT_EQ(Study(call + "--without f6").code, 2);
}

TEST_F(StudyReducedTest, BaselinesAreFittedToTheTrainingRunsOfTheCampaign) {
  const std::string call = "baseline --campaign two.toml ";
  const json arx = StudyJson(call + "arx-cusum");
  EXPECT_EQ(arx["summary"]["detector"], "arx-cusum");
  EXPECT_EQ(arx["summary"]["detected"], 2);
  EXPECT_EQ(arx["summary"]["contained"], 0);
  EXPECT_EQ(StudyJson(call + "signature-table")["summary"]["contained"], 2);
  EXPECT_THAT(Study(call + "signature-table").out, HasSubstr("F(X,P1,P2)"));
  EXPECT_EQ(Study(call + "pca").code, 2);
  Write("bare.toml", Quick() + "[[validation]]\nsimulate = {}\n");
  const Outcome bare = Study("baseline arx-cusum --campaign bare.toml");
  EXPECT_EQ(bare.code, 2);
  EXPECT_THAT(bare.err, AllOf(HasSubstr("bare.toml"), HasSubstr("[[run]]")));
}

TEST_F(StudyReducedTest, BaselineJudgesItsOwnUnitAndPeriodAlone) {
  const auto table = [](int period_s) {
    std::string csv = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
    for (int k = 0; k < 100; ++k) {
      csv += std::to_string(k * period_s) + ",70,3500,2600,100,70,17\n";
    }
    return csv;
  };
  Write("t_h.csv", table(1));
  Write("slow.csv", table(2));
  const std::string call = "baseline arx-cusum --campaign two.toml --file ";
  const Outcome unit = Study(call + "t_h.csv");
  EXPECT_EQ(unit.code, 0) << unit.err;
  EXPECT_THAT(unit.err, HasSubstr("flow_converted"));
  const Outcome slow = Study(call + "slow.csv");
  EXPECT_EQ(slow.code, 3);
  EXPECT_THAT(slow.err, AllOf(HasSubstr("slow.csv has a sample period of 2"),
                              HasSubstr("arx-cusum was fitted for 1")));
}

TEST_F(StudyReducedTest, SeedsAreRepetitionsThatStoreNothing) {
  const auto before = std::filesystem::file_size(Path("data") / "runs.db");
  const std::string call = "seeds --model-set two --campaign ";
  const json study = StudyJson(call + "two.toml 3");
  EXPECT_EQ(study["seeds"], 3);
  EXPECT_EQ(study["total"]["runs"], 6);
  EXPECT_EQ(study["faults"]["f19"]["runs"], 3);
  EXPECT_EQ(study["faults"]["f19"]["detected"]["count"], 3);
  EXPECT_NEAR(study["faults"]["f19"]["detected"]["low"], 0.4385, 1e-4);
  EXPECT_EQ(std::filesystem::file_size(Path("data") / "runs.db"), before);
  EXPECT_EQ(study, StudyJson(call + "two.toml 3"));
  EXPECT_THAT(Study(call + "two.toml 1").out, HasSubstr("per seed"));
  // This valve reads its flow in t/h, that of the set in m3/h.
  Write("t_h.toml",
        "[scenario]\nparameters = \"lublin-actuator-3\"\nduration_s = 300\n"
        "[[validation]]\nsimulate = {}\nfaults = [\"f19:abrupt@200\"]\n");
  EXPECT_EQ(StudyJson(call + "t_h.toml 2")["seeds"], 2);

  EXPECT_EQ(Study("seeds --model-set two 3").code, 2);
  EXPECT_EQ(Study(call + "two.toml 0").code, 2);
  Write("recorded.toml", Quick() + "[[validation]]\nrun = \"abc\"\n");
  const Outcome recorded = Study(call + "recorded.toml 2");
  EXPECT_EQ(recorded.code, 2);
  EXPECT_THAT(recorded.err, HasSubstr("abc"));
}

}  // namespace
}  // namespace fdi::trainer::study
