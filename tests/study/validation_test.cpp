// Runs the built programs: the validation runs of a campaign, and what the
// engine said on every sample.
#include <gmock/gmock.h>

#include "tests/study/fixture.h"

namespace fdi::trainer::study {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class StudyValidationTest : public StudyProgram {
 protected:
  static std::string Validation() {
    return "[[validation]]\nsimulate = {duration_s = 400}\n"
           "faults = [\"f19:abrupt@200\"]\nstrengths = [0.5, 0.6]\n"
           "horizon_s = 300\n[[validation]]\nsimulate = {}\n";
  }
};

TEST_F(StudyValidationTest, ValidationRunsAreScoredAndNotTrainedOn) {
  Write("c.toml", Quick() + TwoConditions() + Validation());
  ASSERT_EQ(Run("train --campaign c.toml").code, 0);
  EXPECT_EQ(RunJson("show quick")["training_runs"].size(), 2U);
  const json scored = StudyJson("evaluate --model-set quick --campaign c.toml");
  ASSERT_EQ(scored["runs"].size(), 3U);
  EXPECT_EQ(scored["runs"][0]["run_id"], "f19:abrupt@200:strength=0.5");
  EXPECT_EQ(scored["runs"][1]["run_id"], "f19:abrupt@200:strength=0.6");
  EXPECT_EQ(scored["runs"][2]["run_id"], "normal");
  EXPECT_EQ(scored["runs"][0]["fault"], "f19");
}

TEST_F(StudyValidationTest, HorizonEndsWhatCounts) {
  Write("c.toml",
        Quick() + TwoConditions() +
            "[[validation]]\nsimulate = {duration_s = 500}\n"
            "faults = [\"f19:abrupt@300:strength=0.5:until=320\"]\n"
            "horizon_s = 315\n[[validation]]\nsimulate = {duration_s = 500}\n"
            "faults = [\"f19:abrupt@300:strength=0.5:until=320\"]\n");
  ASSERT_EQ(Run("train --campaign c.toml").code, 0);
  const json scored = StudyJson("evaluate --model-set quick --campaign c.toml");
  EXPECT_TRUE(scored["runs"][0]["detected"]);
  EXPECT_FALSE(scored["runs"][1]["detected"]);
}

TEST_F(StudyValidationTest, OtherSeedsAreOtherRuns) {
  Write("c.toml", Quick() + TwoConditions());
  Write("v.toml", Quick() + Validation());
  ASSERT_EQ(Run("train --campaign c.toml").code, 0);
  const std::string call = "evaluate --model-set quick --campaign v.toml";
  ASSERT_EQ(Study(call + " --vectors a.csv").code, 0);
  ASSERT_EQ(Study(call + " --vectors b.csv").code, 0);
  ASSERT_EQ(Study(call + " --seed-offset 9 --vectors c.csv").code, 0);
  EXPECT_EQ(Read("a.csv"), Read("b.csv"));
  EXPECT_NE(Read("a.csv"), Read("c.csv"));
}

TEST_F(StudyValidationTest, CampaignWithoutValidationIsNamed) {
  Write("c.toml", Quick() + TwoConditions());
  ASSERT_EQ(Run("train --campaign c.toml").code, 0);
  const Outcome outcome = Study("evaluate --model-set quick --campaign c.toml");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("c.toml"), HasSubstr("[[validation]]")));
}

}  // namespace
}  // namespace fdi::trainer::study
