// Runs the built program: the files of a campaign by pattern.
#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "tests/programs/trainer/fixture.h"
#include "trainer/campaign/campaign.h"

namespace fdi::trainer {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class AppCampaignFilesTest : public TrainerProgram {};

TEST_F(AppCampaignFilesTest, CampaignWithoutRunsIsNotTrained) {
  Write("v.toml", Quick() + "[[validation]]\nsimulate = {}\n");
  const Outcome outcome = Run("train --campaign v.toml");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("v.toml"), HasSubstr("[[run]]")));
}

TEST_F(AppCampaignFilesTest, PatternsAndVariablesNameFiles) {
  const std::string head = "t_s,CV_pct,X_pct,F_m3_h,fault_no,fault_strength\n";
  for (const char* name : {"b_1.csv", "b_2.csv", "other.csv"}) {
    Write(name, head + "0,1,2,3,0,0\n1,2,3,4,0,0\n2,3,4,5,0,0\n");
  }
  ::setenv("FDI_TEST_FOLDER", directory_.path().c_str(), 1);
  Write("c.toml", Quick() +
                      "[[run]]\nimport = \"${FDI_TEST_FOLDER}/b_*.csv\"\n"
                      "valve = \"V\"\n");
  std::vector<std::string> files;
  for (const CampaignRun& run : LoadCampaign(Path("c.toml")).runs) {
    files.push_back(RunLabel(run));
  }
  EXPECT_THAT(files, testing::ElementsAre("b_1", "b_2"));
}

TEST_F(AppCampaignFilesTest, MissingVariableOrFileIsNamed) {
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
