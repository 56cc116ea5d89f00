// Runs the built program: other detectors, reduced sets, repeated seeds.
#include <gmock/gmock.h>

#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class AppVerdictsTest : public TrainerProgram {
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
    return Run("evaluate --file run.csv --verdicts " + file);
  }
};

TEST_F(AppVerdictsTest, AnotherDetectorIsScoredByTheSameIndices) {
  WriteVerdicts("v.csv", 720, 750, "f18|f6");
  const json result = RunJson("evaluate --file run.csv --verdicts v.csv");
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

TEST_F(AppVerdictsTest, DetectionAloneNeedsNoFaultColumnAndOtherRowsAreLeft) {
  std::string text = "detected,t_s\n";
  for (int t = 0; t < 1000; ++t) {
    text += (t < 720 ? "0," : "1,") + std::to_string(t) + '\n';
  }
  Write("v.csv", text);
  const json result =
      RunJson("evaluate --file run.csv@100:900 --verdicts v.csv");
  EXPECT_EQ(result["runs"][0]["t_dt"], 20.0);
  EXPECT_EQ(result["runs"][0]["d_acc"], 0.0);
}

TEST_F(AppVerdictsTest, BadVerdictsAreRefusedWithTheirLine) {
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
  EXPECT_EQ(Run("evaluate --model-set q --file run.csv --verdicts v.csv").code,
            2);
}

class AppReducedTest : public TrainerProgram {
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

TEST_F(AppReducedTest, SetWithoutAFaultAnswersAsIfNeverToldOfIt) {
  Write("one.toml", Quick("one") + Faults("\"f19\""));
  ASSERT_EQ(Run("train --campaign one.toml").code, 0) << Read("err.txt");
  const std::string score = " --campaign two.toml --vectors ";
  ASSERT_EQ(Run("evaluate --model-set one" + score + "one.csv").code, 0);
  ASSERT_EQ(
      Run("evaluate --model-set two --without f1" + score + "two.csv").code, 0);
  EXPECT_EQ(Read("one.csv"), Read("two.csv"));
  EXPECT_THAT(Read("out.txt"), HasSubstr("two@1 without f1"));
}

// A week without samples is no week without an alarm.
TEST_F(AppReducedTest, GapsAreNoHoursWithoutFault) {
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

TEST_F(AppReducedTest, FaultLeftOutIsUnknownOrWronglyNamed) {
  const json result =
      RunJson("evaluate --model-set two --campaign two.toml --leave-one-out");
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

TEST_F(AppReducedTest, ChannelLeftOutIsMissedInTheVectors) {
  const std::string call = "evaluate --model-set two --campaign two.toml ";
  ASSERT_EQ(Run(call + "--without-channels x --vectors v.csv").code, 0);
  const std::string head = Read("v.csv").substr(0, 200);
  EXPECT_THAT(head, HasSubstr("state,r_F,d_0"));
  const Outcome unknown = Run(call + "--without-channels T1");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, AllOf(HasSubstr("'T1'"), HasSubstr("X F")));
  EXPECT_EQ(Run(call + "--without f6").code, 2);
}

TEST_F(AppReducedTest, BaselinesAreFittedToTheTrainingRunsOfTheCampaign) {
  const std::string call = "evaluate --campaign two.toml --baseline ";
  const json arx = RunJson(call + "arx-cusum");
  EXPECT_EQ(arx["summary"]["detector"], "arx-cusum");
  EXPECT_EQ(arx["summary"]["detected"], 2);
  EXPECT_EQ(arx["summary"]["contained"], 0);
  EXPECT_EQ(RunJson(call + "signature-table")["summary"]["contained"], 2);
  EXPECT_THAT(Run(call + "signature-table").out, HasSubstr("F(X,P1,P2)"));
  EXPECT_EQ(Run(call + "pca").code, 2);
  EXPECT_EQ(Run(call + "arx-cusum --model-set two").code, 2);
  Write("bare.toml", Quick() + "[[validation]]\nsimulate = {}\n");
  const Outcome bare =
      Run("evaluate --campaign bare.toml --baseline arx-cusum");
  EXPECT_EQ(bare.code, 2);
  EXPECT_THAT(bare.err, AllOf(HasSubstr("bare.toml"), HasSubstr("[[run]]")));
}

TEST_F(AppReducedTest, BaselineJudgesItsOwnUnitAndPeriodAlone) {
  const auto table = [](int period_s) {
    std::string csv = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
    for (int k = 0; k < 100; ++k) {
      csv += std::to_string(k * period_s) + ",70,3500,2600,100,70,17\n";
    }
    return csv;
  };
  Write("t_h.csv", table(1));
  Write("slow.csv", table(2));
  const std::string call =
      "evaluate --campaign two.toml --baseline arx-cusum --file ";
  const Outcome unit = Run(call + "t_h.csv");
  EXPECT_EQ(unit.code, 0) << unit.err;
  EXPECT_THAT(unit.err, HasSubstr("flow_converted"));
  const Outcome slow = Run(call + "slow.csv");
  EXPECT_EQ(slow.code, 3);
  EXPECT_THAT(slow.err, AllOf(HasSubstr("slow.csv has a sample period of 2"),
                              HasSubstr("arx-cusum was fitted for 1")));
}

TEST_F(AppReducedTest, SeedsAreRepetitionsThatStoreNothing) {
  const auto before = std::filesystem::file_size(Path("data") / "runs.db");
  const std::string call = "evaluate --model-set two --campaign two.toml ";
  const json study = RunJson(call + "--seeds 3");
  EXPECT_EQ(study["seeds"], 3);
  EXPECT_EQ(study["total"]["runs"], 6);
  EXPECT_EQ(study["faults"]["f19"]["runs"], 3);
  EXPECT_EQ(study["faults"]["f19"]["detected"]["count"], 3);
  EXPECT_NEAR(study["faults"]["f19"]["detected"]["low"], 0.4385, 1e-4);
  EXPECT_EQ(std::filesystem::file_size(Path("data") / "runs.db"), before);
  EXPECT_EQ(study, RunJson(call + "--seeds 3"));
  EXPECT_THAT(Run(call + "--seeds 1").out, HasSubstr("per seed"));
  // This valve reads its flow in t/h, that of the set in m3/h.
  Write("t_h.toml",
        "[scenario]\nparameters = \"lublin-actuator-3\"\nduration_s = 300\n"
        "[[validation]]\nsimulate = {}\nfaults = [\"f19:abrupt@200\"]\n");
  EXPECT_EQ(
      RunJson(
          "evaluate --model-set two --campaign t_h.toml --seeds 2")["seeds"],
      2);

  EXPECT_EQ(Run("evaluate --model-set two --seeds 3").code, 2);
  EXPECT_EQ(Run(call + "--seeds 3 --leave-one-out").code, 2);
  Write("recorded.toml", Quick() + "[[validation]]\nrun = \"abc\"\n");
  const Outcome recorded =
      Run("evaluate --model-set two --campaign recorded.toml --seeds 2");
  EXPECT_EQ(recorded.code, 2);
  EXPECT_THAT(recorded.err, HasSubstr("abc"));
}

}  // namespace
}  // namespace fdi::trainer
