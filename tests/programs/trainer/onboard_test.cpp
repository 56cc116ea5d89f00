// Refusals of `onboard`; its results are tested with the system.
#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {
namespace {

class OnboardProgramTest : public TrainerProgram {};

TEST_F(OnboardProgramTest, NeedsHealthyData) {
  const Outcome outcome = Run("onboard --valve FV-101");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("--runs ID,... or --file CSV"), std::string::npos)
      << outcome.err;
}

TEST_F(OnboardProgramTest, ShortRecordIsRefusedAndNothingIsStored) {
  std::string csv = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
  for (int k = 0; k < 300; ++k) {
    csv += std::to_string(k) + "," + std::to_string(50 + k % 7) +
           ",3500,2600,100," + std::to_string(50 + k % 7) + ",17\n";
  }
  Write("short.csv", csv);
  const Outcome outcome = Run("onboard --valve FV-101 --file short.csv");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(
      outcome.err.find("300 samples in a row, onboarding takes at least 600"),
      std::string::npos)
      << outcome.err;
  EXPECT_EQ(Run("show FV-101").code, 5);
}

// 600 samples take ten hours.
TEST_F(OnboardProgramTest, ASlowRecordThatIsTooShortIsToldHowLongItHasToBe) {
  std::string csv = "t_s,CV_pct,X_pct,F_t_h\n";
  for (int k = 0; k < 150; ++k) {
    const std::string cv = std::to_string(50 + k % 7);
    csv += std::to_string(60 * k) + "," + cv + "," + cv + ",17\n";
  }
  Write("slow.csv", csv);
  const Outcome outcome =
      Run("onboard --valve FV-101 --file slow.csv --resample 60s");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.err.find("export at least 600 minutes"), std::string::npos)
      << outcome.err;
}

// Opening read as closing: before anything is fitted or stored.
TEST_F(OnboardProgramTest, RecordThatCannotBeIsRefusedAndNothingIsStored) {
  std::string csv = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
  for (int k = 0; k < 900; ++k) {
    const int cv = 40 + k % 21;
    csv += std::to_string(k) + "," + std::to_string(cv) + ",3500,2600,100," +
           std::to_string(100 - cv) + ",17\n";
  }
  Write("against.csv", csv);
  const Outcome outcome = Run("onboard --valve FV-101 --file against.csv");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.err.find("not usable: X moves against CV (correlation -1)"),
            std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("sense = \"opening\""), std::string::npos);
  EXPECT_EQ(Run("show FV-101").code, 5);
}

TEST_F(OnboardProgramTest, UnknownTypesAndSignalsAreNamed) {
  const Outcome signal = Run("onboard --dry-run --signals CV,X,Q");
  EXPECT_EQ(signal.code, 2);
  EXPECT_NE(signal.err.find("'Q'"), std::string::npos) << signal.err;
  const Outcome type =
      Run("onboard --dry-run --signals CV,X --type nothing-like-it");
  EXPECT_EQ(type.code, 2);
  EXPECT_NE(type.err.find("nothing-like-it"), std::string::npos) << type.err;
  const Outcome blind = Run("onboard --dry-run --signals CV,P1");
  EXPECT_EQ(blind.code, 3);
  EXPECT_NE(blind.err.find("CV, and X or F"), std::string::npos) << blind.err;
}

// Otherwise the work would be lost, or the set stored without its valve.
TEST_F(OnboardProgramTest, NamesAreCheckedBeforeTheRecordIsRead) {
  const Outcome set = Run("onboard --valve V --name a@2 --file none.csv");
  EXPECT_EQ(set.code, 2);
  EXPECT_NE(set.err.find("--name a@2: expected"), std::string::npos) << set.err;
  const Outcome valve = Run("onboard --valve 'FV 1' --file none.csv");
  EXPECT_EQ(valve.code, 2);
  EXPECT_NE(valve.err.find("--name FV 1: expected"), std::string::npos)
      << valve.err;
  const Outcome type =
      Run("onboard --valve V --save-type 'a type' --file none.csv");
  EXPECT_EQ(type.code, 2);
  EXPECT_NE(type.err.find("--save-type a type: expected"), std::string::npos)
      << type.err;
}

}  // namespace
}  // namespace fdi::trainer
