// Runs the built program: two model sets on the same runs.
#include <gmock/gmock.h>

#include "tests/programs/trainer/fixture.h"
#include "tests/programs/trainer/validation_runs.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

// "one" knows f19 alone, "two" f1 as well. Seven runs fall ill of f1 at 200 s,
// one of f19, one stays well.
class AppCompareTest : public TrainerProgram {
 protected:
  void SetUp() override {
    Write("one.toml", Quick("one") + TwoConditions());
    Write("two.toml", Quick("two") + TwoConditions() +
                          "[[run]]\nsimulate = {}\nfaults = [\"f1\"]\n"
                          "strengths = [0.5]\n");
    Write("v.toml", Quick("v") +
                        "[[validation]]\nsimulate = {duration_s = 500}\n"
                        "repeat = 7\nfaults = [\"f1:abrupt@200\"]\n"
                        "strengths = [0.5]\n"
                        "[[validation]]\nsimulate = {duration_s = 500}\n"
                        "faults = [\"f19:abrupt@200\"]\nstrengths = [0.5]\n"
                        "[[validation]]\nsimulate = {duration_s = 500}\n");
    ASSERT_EQ(Run("train --campaign one.toml").code, 0) << Read("err.txt");
    ASSERT_EQ(Run("train --campaign two.toml").code, 0) << Read("err.txt");
    runs_ = " --runs " + StoreValidationRuns(Path("v.toml"), Path("data"));
  }
  static json Measure(const json& result, const std::string& name) {
    for (const json& measure : result["measures"]) {
      if (measure["measure"] == name) {
        return measure;
      }
    }
    return {};
  }

  std::string runs_;
};

TEST_F(AppCompareTest, WhatTheOneSetLacksIsMarkedAndTestedRunByRun) {
  const json result = RunJson("compare one two" + runs_);

  ASSERT_THAT(result["runs"], SizeIs(9));
  const json& run = result["runs"][0];
  EXPECT_EQ(run["fault"], "f1");
  EXPECT_THAT(run["differs"], Contains("final set"));
  EXPECT_THAT(run["differs"], Not(Contains("detected")));
  EXPECT_THAT(run["a"]["final_set"], IsEmpty());
  EXPECT_THAT(run["b"]["final_set"], ElementsAre("f1"));
  EXPECT_THAT(result["runs"][8]["differs"], IsEmpty());
  EXPECT_EQ(result["a"]["exact"], 1);
  EXPECT_EQ(result["b"]["exact"], 8);
  const json set = Measure(result, "final set");
  EXPECT_EQ(set["b_better"], 7);
  EXPECT_EQ(set["a_better"], 0);
  EXPECT_EQ(set["alike"], 1);
  EXPECT_NEAR(set["p_value"].get<double>(), 2.0 / 128.0, 1e-12);
  EXPECT_THAT(set["judgement"].get<std::string>(),
              HasSubstr("two@1 is better"));
  EXPECT_TRUE(Measure(result, "detected")["p_value"].is_null());
}

TEST_F(AppCompareTest, SidesChangeWithTheOrder) {
  const json set = Measure(RunJson("compare two one" + runs_), "final set");
  EXPECT_EQ(set["a_better"], 7);
  EXPECT_THAT(set["judgement"].get<std::string>(),
              HasSubstr("two@1 is better"));
}

TEST_F(AppCompareTest, TablesListRunsThatDifferAndSayHowManyDoNot) {
  const Outcome outcome = Run("compare one two" + runs_);
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("f1"), HasSubstr("1 runs alike"),
                                 HasSubstr("two@1 is better (p = 0.0156)")));
  EXPECT_THAT(Run("compare one two --all" + runs_).out, HasSubstr("f19"));
}

TEST_F(AppCompareTest, FewRunsAreNotJudged) {
  Write("w.toml", Quick("w") +
                      "[[validation]]\nsimulate = {duration_s = 500}\n"
                      "faults = [\"f1:abrupt@200\"]\nstrengths = [0.5]\n");
  const std::string run = StoreValidationRuns(Path("w.toml"), Path("data"));
  EXPECT_THAT(Run("compare one two --runs " + run).out,
              HasSubstr("too few runs differ (1, needed are 6)"));
}

TEST_F(AppCompareTest, WhatIsMissingIsNamed) {
  EXPECT_EQ(Run("compare one" + runs_).code, 2);
  EXPECT_EQ(Run("compare one two").code, 2);
  const Outcome outcome = Run("compare one three" + runs_);
  EXPECT_EQ(outcome.code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("three"));
}

TEST_F(AppCompareTest, FlowInAnotherUnitIsConvertedAsEvaluateDoes) {
  std::string csv = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
  for (int k = 0; k < 100; ++k) {
    csv += std::to_string(k) + ",70,3500,2600,100,70,17\n";
  }
  Write("t_h.csv", csv);
  const Outcome outcome = Run("compare one two --file t_h.csv");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("flow_converted"));
}

}  // namespace
}  // namespace fdi::trainer
