// Runs the built program: validation runs of a campaign, files by pattern.
#include <cstdlib>

#include <gmock/gmock.h>

#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class AppValidationTest : public TrainerProgram {
 protected:
  static std::string Validation() {
    return "[[validation]]\nsimulate = {duration_s = 400}\n"
           "faults = [\"f19:abrupt@200\"]\nstrengths = [0.5, 0.6]\n"
           "horizon_s = 300\n[[validation]]\nsimulate = {}\n";
  }
};

TEST_F(AppValidationTest, ValidationRunsAreScoredAndNotTrainedOn) {
  Write("c.toml", Quick() + TwoConditions() + Validation());
  ASSERT_EQ(Run("train --campaign c.toml").code, 0);
  EXPECT_EQ(RunJson("show quick")["training_runs"].size(), 2U);
  const json scored = RunJson("evaluate --model-set quick --campaign c.toml");
  ASSERT_EQ(scored["runs"].size(), 3U);
  EXPECT_EQ(scored["runs"][0]["run_id"], "f19:abrupt@200:strength=0.5");
  EXPECT_EQ(scored["runs"][1]["run_id"], "f19:abrupt@200:strength=0.6");
  EXPECT_EQ(scored["runs"][2]["run_id"], "normal");
  EXPECT_EQ(scored["runs"][0]["fault"], "f19");
}

TEST_F(AppValidationTest, HorizonEndsWhatCounts) {
  Write("c.toml",
        Quick() + TwoConditions() +
            "[[validation]]\nsimulate = {duration_s = 500}\n"
            "faults = [\"f19:abrupt@300:strength=0.5:until=320\"]\n"
            "horizon_s = 315\n[[validation]]\nsimulate = {duration_s = 500}\n"
            "faults = [\"f19:abrupt@300:strength=0.5:until=320\"]\n");
  ASSERT_EQ(Run("train --campaign c.toml").code, 0);
  const json scored = RunJson("evaluate --model-set quick --campaign c.toml");
  EXPECT_TRUE(scored["runs"][0]["detected"]);
  EXPECT_FALSE(scored["runs"][1]["detected"]);
}

TEST_F(AppValidationTest, OtherSeedsAreOtherRuns) {
  Write("c.toml", Quick() + TwoConditions());
  Write("v.toml", Quick() + Validation());
  ASSERT_EQ(Run("train --campaign c.toml").code, 0);
  const std::string call = "evaluate --model-set quick --campaign v.toml";
  ASSERT_EQ(Run(call + " --vectors a.csv").code, 0);
  ASSERT_EQ(Run(call + " --vectors b.csv").code, 0);
  ASSERT_EQ(Run(call + " --seed-offset 9 --vectors c.csv").code, 0);
  EXPECT_EQ(Read("a.csv"), Read("b.csv"));
  EXPECT_NE(Read("a.csv"), Read("c.csv"));
}

TEST_F(AppValidationTest, CampaignWithoutRunsIsNotTrained) {
  Write("v.toml", Quick() + Validation());
  const Outcome outcome = Run("train --campaign v.toml");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("v.toml"), HasSubstr("[[run]]")));
}

TEST_F(AppValidationTest, CampaignWithoutValidationIsNamed) {
  Write("c.toml", Quick() + TwoConditions());
  ASSERT_EQ(Run("train --campaign c.toml").code, 0);
  const Outcome outcome = Run("evaluate --model-set quick --campaign c.toml");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("c.toml"), HasSubstr("[[validation]]")));
}

TEST_F(AppValidationTest, PatternsAndVariablesNameFiles) {
  const std::string head = "t_s,CV_pct,X_pct,F_m3_h,fault_no,fault_strength\n";
  for (const char* name : {"b_1.csv", "b_2.csv", "other.csv"}) {
    Write(name, head + "0,1,2,3,0,0\n1,2,3,4,0,0\n2,3,4,5,0,0\n");
  }
  ::setenv("FDI_TEST_FOLDER", directory_.path().c_str(), 1);
  Write("c.toml", Quick() +
                      "[[run]]\nimport = \"${FDI_TEST_FOLDER}/b_*.csv\"\n"
                      "valve = \"V\"\n");
  const Outcome outcome = Run("train --campaign c.toml --print-campaign");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("b_1.csv"), HasSubstr("b_2.csv")));
  EXPECT_EQ(outcome.out.find("other.csv"), std::string::npos);
}

TEST_F(AppValidationTest, MissingVariableOrFileIsNamed) {
  ::unsetenv("FDI_TEST_MISSING");
  Write("c.toml",
        Quick() + "[[run]]\nimport = \"${FDI_TEST_MISSING}/a.csv\"\n");
  const Outcome variable = Run("train --campaign c.toml");
  EXPECT_EQ(variable.code, 2);
  EXPECT_THAT(variable.err,
              AllOf(HasSubstr("c.toml"), HasSubstr("FDI_TEST_MISSING")));
  Write("c.toml", Quick() + "[[run]]\nimport = \"none_*.csv\"\n");
  const Outcome files = Run("train --campaign c.toml");
  EXPECT_EQ(files.code, 2);
  EXPECT_THAT(files.err, HasSubstr("none_*.csv"));
  // The value is taken as it is, whatever it holds.
  ::setenv("FDI_TEST_ITSELF", "${FDI_TEST_ITSELF}", 1);
  Write("c.toml", Quick() + "[[run]]\nimport = \"${FDI_TEST_ITSELF}.csv\"\n");
  const Outcome itself = Run("train --campaign c.toml");
  EXPECT_EQ(itself.code, 5);
  EXPECT_THAT(itself.err, HasSubstr("${FDI_TEST_ITSELF}.csv"));
}

}  // namespace
}  // namespace fdi::trainer
