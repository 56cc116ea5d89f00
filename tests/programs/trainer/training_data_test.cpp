// Runs the built program: data that nothing can be trained on.
#include <string>

#include <gmock/gmock.h>

#include "storage/models/models.h"
#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class AppTrainingDataTest : public TrainerProgram {
 protected:
  // Trains; afterwards there must be no model set.
  Outcome Refused(const std::string& runs) {
    Write("c.toml", Quick() + runs);
    const Outcome outcome = Run("train --campaign c.toml");
    const auto file = Path("data") / "models.db";
    EXPECT_TRUE(!std::filesystem::exists(file) ||
                storage::ModelStore(file).List().empty());
    return outcome;
  }
};

TEST_F(AppTrainingDataTest, FaultsWithoutNormalOperationAreRefused) {
  const Outcome outcome = Refused(
      "[[run]]\nsimulate = {}\nfaults = [\"f19\"]\nstrengths = [0.5]\n");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("60 samples of normal operation"));
}

TEST_F(AppTrainingDataTest, ImportWithoutRowsIsRefusedByName) {
  Write("empty.csv", "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n");
  const Outcome outcome =
      Refused("[[run]]\nimport = \"empty.csv\"\nvalve = \"LV-9\"\n");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("empty.csv"), HasSubstr("no rows")));
}

TEST_F(AppTrainingDataTest, ImportOfAnAbsentFileIsRefusedByName) {
  const Outcome outcome =
      Refused("[[run]]\nimport = \"none.csv\"\nvalve = \"LV-9\"\n");

  EXPECT_NE(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("none.csv"));
}

}  // namespace
}  // namespace fdi::trainer
