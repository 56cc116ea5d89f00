// Data from which `relearn --models` makes the models of a valve, and its
// refusals; the training itself is that of onboard.
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/error.h"
#include "simulator/second_look/valve_physics.h"
#include "storage/runs/runs.h"
#include "tests/diagnosis/linear_plant.h"
#include "tests/programs/trainer/fixture.h"
#include "trainer/learning/extension.h"
#include "trainer/onboarding/onboarding.h"

namespace fdi::trainer {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class ExtendTest : public TrainerProgram {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(Path("data"));
    storage::EnsureExists(directory());
  }
  storage::DataDirectory directory() const { return {Path("data")}; }

  // A run of healthy samples in runs.db. @returns its id.
  std::string StoreRun() const {
    SampleSeries series;
    for (std::uint64_t k = 0; k < 10; ++k) {
      series.samples.push_back({fdi::tests::PlantSample(k), {}});
    }
    series.signals = series.samples.front().sample.present;
    storage::RunStore store(directory().runs(),
                            storage::Access::kOccasionalWriter);
    return store.Import({&series, 1}, {.valve_id = "V1"}).front();
  }

  // As onboarding stores it, made from `runs`.
  void StoreSet(const std::vector<std::string>& runs,
                const std::string& preset = "onboard") const {
    ModelSet models = fdi::tests::LinearPlant();
    models.name = "V1";
    models.preset = preset;
    models.training_runs = runs;
    simulator::ValvePhysics physics;
    physics.parameters.trim.kv_m3_h = 72.0;
    physics.drive.command_delay = 1;
    physics.p1.mean = 900.0;
    models.physics = simulator::ToValues(physics);
    storage::ModelStore store(directory().models(),
                              storage::Access::kOccasionalWriter);
    const int version = store.Save(models).version;
    store.SetBaseline("V1", {0, "V1", version, 2.0, {}, {}});
  }

  FormerRecord Former(std::vector<std::string>& files) const {
    RelearnRequest request;
    request.valve = "V1";
    return ReadFormerRecord("V1", MakeLabelPlan(request, directory()),
                            directory(), files);
  }
};

TEST_F(ExtendTest, FindsRunsAndFilesWhereTheyWereOrAsTheyAreGiven) {
  const std::string run = StoreRun();
  Write("there.csv", "");
  const std::string there = Path("there.csv").string() + "@0:600";
  StoreSet({run + "@0:5", there, "/gone/moved.csv@5:"});
  std::vector<std::string> files{"new.csv", "now/moved.csv@5:"};
  const FormerRecord record = Former(files);
  EXPECT_THAT(record.runs, ElementsAre(run + "@0:5"));
  EXPECT_THAT(record.files, ElementsAre(there, "now/moved.csv@5:"));
  EXPECT_THAT(files, ElementsAre("new.csv"));
  EXPECT_EQ(record.type.parameters.trim.kv_m3_h, 72.0);
  EXPECT_EQ(record.type.command_delay, 1);
  EXPECT_EQ(record.type.levels.p1_kpa, 900.0);
  EXPECT_FALSE(record.type.of_any_size);
}

TEST_F(ExtendTest, WhatIsGoneIsNamedAndNothingIsStored) {
  StoreSet({"/gone/day.csv"});
  Write("new.csv", "t_s,CV_pct,X_pct\n0,50,50\n");
  const Outcome outcome = Run("relearn V1 --models --file new.csv");
  EXPECT_EQ(outcome.code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("the record /gone/day.csv"));
  EXPECT_THAT(outcome.err, HasSubstr("--file"));
  EXPECT_EQ(Run("show V1@2").code, 5);
}

TEST_F(ExtendTest, OtherSetsAndNoNewHoursAreRefused) {
  const std::string run = StoreRun();
  StoreSet({run});
  EXPECT_EQ(Run("relearn V9 --models --file new.csv").code, 5);
  const Outcome nothing = Run("relearn V1 --models");
  EXPECT_EQ(nothing.code, 2);
  EXPECT_THAT(nothing.err, HasSubstr("--runs ID,... or --file CSV"));
  EXPECT_THAT(Run("onboard --valve V1 --extend --runs " + run).err,
              HasSubstr("fdi-trainer relearn VALVE --models"));
  StoreSet({run}, "paper");
  storage::ModelStore(directory().models(), storage::Access::kOccasionalWriter)
      .Activate({"V1", 2});
  const Outcome trained = Run("relearn V1 --models --runs " + run);
  EXPECT_EQ(trained.code, 5);
  EXPECT_THAT(trained.err, HasSubstr("no labelled episode"));
}

TEST(CoverageChangeTest, FaultsThatAreNotDetectedAnyMoreAreLost) {
  const auto table = [](std::optional<double> f2, std::optional<double> f19) {
    CoverageTable made;
    made.faults = {{2, false, f2}, {6, false, 0.25}, {19, true, f19}};
    return made;
  };
  EXPECT_THAT(ChangesOf(table(0.5, 0.25), table(0.5, 0.25)), IsEmpty());
  const auto changes = ChangesOf(table(0.5, 0.25), table({}, 0.5));
  ASSERT_EQ(changes.size(), 2U);
  EXPECT_EQ(changes[0].fault, 2);
  EXPECT_TRUE(changes[0].lost());
  EXPECT_TRUE(changes[1].negative);
  EXPECT_EQ(changes[1].before, 0.25);
  EXPECT_EQ(changes[1].after, 0.5);
  EXPECT_FALSE(changes[1].lost());
}

}  // namespace
}  // namespace fdi::trainer
