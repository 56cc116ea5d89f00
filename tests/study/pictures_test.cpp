// Runs the built programs: pictures of a model set.
#include <filesystem>

#include <gmock/gmock.h>

#include "storage/runs/runs.h"
#include "tests/study/fixture.h"

namespace fdi::trainer::study {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class StudyPicturesTest : public StudyProgram {
 protected:
  void SetUp() override {
    Write("c.toml", Quick() + TwoConditions());
    ASSERT_EQ(Run("train --campaign c.toml").code, 0) << Read("err.txt");
  }
};

TEST_F(StudyPicturesTest, PicturesShowEverySetAndEveryMembership) {
  const json set = RunJson("show quick --rules");
  const Outcome outcome = Study("pictures quick pics");

  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, Not(HasSubstr("residuals_missing")));
  std::size_t memberships = 0;
  std::size_t residuals = 0;
  for (const auto& entry : std::filesystem::directory_iterator(Path("pics"))) {
    const std::string name = entry.path().filename();
    const std::string picture = Read("pics/" + name);
    EXPECT_THAT(picture, HasSubstr("membership [-]")) << name;
    memberships += name.starts_with("membership_");
    residuals += name.starts_with("residual_");
    if (name.starts_with("residual_")) {
      EXPECT_THAT(picture, AllOf(HasSubstr("residuals in training"),
                                 HasSubstr("tallest bar")))
          << name;
    }
  }
  std::size_t regressors = 0;
  for (const json& channel : set["observers"][0]["channels"]) {
    regressors += channel["regressors"].size();
  }
  EXPECT_EQ(memberships, regressors);
  EXPECT_EQ(residuals, 4U);  // normal and f19, X and F
}

TEST_F(StudyPicturesTest, MissingTrainingRunIsNamedAndTheTrapezoidStandsAlone) {
  const json set = RunJson("show quick");
  const std::string id = set["training_runs"][0];
  storage::RunStore(Path("data") / "runs.db",
                    storage::Access::kOccasionalWriter)
      .Delete(id);

  const Outcome outcome = Study("pictures quick pics");

  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("residuals_missing"), HasSubstr(id)));
  const std::string picture = Read("pics/residual_normal_X.svg");
  EXPECT_THAT(picture, AllOf(HasSubstr("training runs missing"),
                             Not(HasSubstr("residuals in training"))));
}

}  // namespace
}  // namespace fdi::trainer::study
