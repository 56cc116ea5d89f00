// Runs the built program: what people say of episodes becomes the next set.
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/error.h"
#include "storage/history/history_editor.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/fixture.h"
#include "tests/programs/trainer/validation_runs.h"
#include "tests/trainer/recorded_episodes.h"
#include "trainer/learning/label_plan.h"

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
using testing::UnorderedElementsAre;

// The set knows f19 at 0.5 alone. The scored runs begin normal; the fault acts
// from 600 s on.
class AppLabelsTest : public TrainerProgram {
 protected:
  void SetUp() override {
    Write("c.toml", Quick() + TwoConditions() + Validation());
    ASSERT_EQ(Run("train --campaign c.toml").code, 0) << Read("err.txt");
    StoreValidationRuns(Path("c.toml"), Path("data"));
  }
  static std::string Validation() {
    return "[[validation]]\nsimulate = {duration_s = 1200}\n"
           "faults = [\"f1:abrupt@600\", \"f19:abrupt@600\"]\n"
           "strengths = [0.5, 0.75]\n";
  }
  std::filesystem::path History() const { return Path("data") / "history.db"; }
  storage::RunStore Runs(
      storage::Access access = storage::Access::kReader) const {
    return storage::RunStore(Path("data") / "runs.db", access);
  }
  storage::StoredRun RunWith(const std::string& fault,
                             const std::string& strength = "0.5") const {
    storage::RunStore store = Runs();
    const std::string needle =
        "\"" + fault + ":abrupt@600:strength=" + strength + "\"";
    for (const storage::RunInfo& info : store.List()) {
      if (info.samples == 1200 &&
          info.run.scenario.find(needle) != std::string::npos) {
        return store.Load(info.id);
      }
    }
    ADD_FAILURE() << "no run with " << fault;
    return {};
  }
  // Its only episode, labelled.
  std::string Episode(const storage::StoredRun& run, const std::string& label,
                      bool held = false) const {
    const auto models = std::make_shared<const ModelSet>(
        storage::ModelStore(Path("data") / "models.db").Load("quick"));
    const auto ids = RecordEpisodes(History(), models, run, held);
    EXPECT_THAT(ids, SizeIs(1));
    Label(ids.at(0), label);
    return ids.at(0);
  }
  void Label(const std::string& id, const std::string& label) const {
    storage::HistoryEditor(History()).Label(id, label,
                                            {"kim", "", "test", ++clock_});
  }
  json DetectionOf(const std::string& set, const std::string& fault) const {
    return RunJson("evaluate --model-set " + set + " --runs " +
                   RunWith(fault).info.id)["runs"][0];
  }

  mutable std::int64_t clock_{0};
};

TEST_F(AppLabelsTest, NamedFaultIsLearntAndToldWhereItCameFrom) {
  const std::string id = Episode(RunWith("f1"), "f1");
  ASSERT_THAT(DetectionOf("quick", "f1")["final_set"], IsEmpty());

  const json set = RunJson("relearn '*' --strength " + id + "=0.5");

  EXPECT_EQ(set["model_set"], "quick");
  EXPECT_EQ(set["version"], 2);
  EXPECT_THAT(DetectionOf("quick@2", "f1")["final_set"], ElementsAre("f1"));
  EXPECT_THAT(DetectionOf("quick@2", "f19")["final_set"], ElementsAre("f19"));
  const json shown = RunJson("show quick@2");
  const json& lineage = shown["lineage"];
  EXPECT_EQ(lineage["parent"]["model_set"], "quick");
  EXPECT_EQ(lineage["parent"]["version"], 1);
  EXPECT_EQ(lineage["parent"]["content_hash"],
            RunJson("show quick@1")["content_hash"]);
  EXPECT_EQ(lineage["settings"]["max_rules"], 1);  // As of the parent.
  const json& episode = lineage["episodes"][0];
  EXPECT_EQ(episode["episode_id"], id);
  EXPECT_EQ(episode["label"], "f1");
  EXPECT_EQ(episode["labelled_by"], "kim");
  EXPECT_EQ(episode["fault"], "f1");
  EXPECT_EQ(episode["strength"], 0.5);
  EXPECT_THAT(shown["training_runs"], SizeIs(3));
  EXPECT_THAT(shown["training_runs"], Contains(episode["run"]));
}

TEST_F(AppLabelsTest, FalseAlarmIsNormalOperationFromThenOn) {
  const storage::StoredRun run = RunWith("f1");
  Episode(run, "false");
  ASSERT_TRUE(DetectionOf("quick", "f1")["detected"]);

  const json set = RunJson("relearn '*'");

  ASSERT_THAT(set["lineage"]["episodes"], SizeIs(1));
  EXPECT_EQ(set["lineage"]["episodes"][0]["fault"], "normal");
  EXPECT_GT(set["lineage"]["episodes"][0]["samples"], 1100);
  // The rod is far from its command, and no label hides that.
  EXPECT_THAT(DetectionOf("quick@2", "f1")["final_set"],
              testing::Not(testing::Contains("f1")));
}

TEST_F(AppLabelsTest, TraceServesWhereNoRunWasRecorded) {
  const storage::StoredRun run = RunWith("f19");
  const std::string id = Episode(run, "true");
  EXPECT_THAT(RunJson("relearn '*' --dry-run")["episodes"][0]["data"]
                  .get<std::string>(),
              HasSubstr(run.info.id + "@"));
  Runs(storage::Access::kOccasionalWriter).Delete(run.info.id);

  const json plan = RunJson("relearn '*' --dry-run");

  EXPECT_EQ(plan["episodes"][0]["data"], "trace");
  EXPECT_NEAR(plan["episodes"][0]["strength"].get<double>(), 0.5, 0.05);
  const json set = RunJson("relearn '*'");
  const json& learnt = set["lineage"]["episodes"][0];
  EXPECT_EQ(learnt["samples"], plan["episodes"][0]["samples"]);
  const storage::StoredRun kept = Runs().Load(learnt["run"].get<std::string>());
  EXPECT_EQ(kept.info.run.valve_id, run.info.run.valve_id);
  EXPECT_EQ(kept.samples.front().truth->fault, 19);
  EXPECT_EQ(kept.samples.back().sample.stamp_ns,
            run.samples.back().sample.stamp_ns);
}

TEST_F(AppLabelsTest, UnknownStrengthIsRefusedWithAllThatHelps) {
  const std::string id = Episode(RunWith("f1"), "f1");

  const Outcome outcome = Run("relearn '*'");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(
      outcome.err,
      AllOf(HasSubstr(id), HasSubstr("label f1"), HasSubstr("does not know f1"),
            HasSubstr("--strength " + id + "=S"), HasSubstr("--skip-refused")));
  EXPECT_EQ(Run("show quick@2").code, 5);
  EXPECT_EQ(RunJson("relearn '*' --dry-run")["episodes"][0]["refused"]
                .get<std::string>()
                .find("the strength is unknown"),
            0U);
  EXPECT_EQ(Run("relearn '*' --strength " + id + "=1.5").code, 2);
  EXPECT_EQ(Run("relearn '*' --strength 0123=0.5").code, 5);
}

TEST_F(AppLabelsTest, TrueNeedsExactlyOneIsolatedFault) {
  Episode(RunWith("f1"), "true");
  const Outcome outcome = Run("relearn '*'");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("label it with the name of the fault"));
}

TEST_F(AppLabelsTest, ShortEpisodeIsRefusedWithItsLengthAndWhatIsNeeded) {
  storage::StoredRun run = RunWith("f19");
  run.samples.resize(660);
  Runs(storage::Access::kOccasionalWriter).Delete(run.info.id);
  Episode(run, "true");

  const Outcome outcome = Run("relearn '*'");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("too short: 6"), HasSubstr("needed are 80")));
}

TEST_F(AppLabelsTest, FaultThatWasNotNamedLiveGetsTheStrengthThatFits) {
  Episode(RunWith("f19"), "f19", true);
  const json episode = RunJson("relearn '*' --dry-run")["episodes"][0];
  EXPECT_TRUE(episode["refused"].is_null()) << episode;
  EXPECT_NEAR(episode["strength"].get<double>(), 0.5, 0.05);
}

TEST_F(AppLabelsTest, StrengthOfAFaultThatFitsBadlyIsNotEstimated) {
  Episode(RunWith("f1"), "f19");
  const Outcome outcome = Run("relearn '*'");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("gives f19 a factor of"));
}

// The set knows f19 up to 0.5.
TEST_F(AppLabelsTest, StrengthBeyondTheTrainedOnesIsNotEstimated) {
  Episode(RunWith("f19", "0.75"), "f19", true);
  const Outcome outcome = Run("relearn '*'");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("beyond what it was trained at (0.5)"));
}

// The fault acts from 600 s to 1200 s.
TEST_F(AppLabelsTest, TimeAfterTheFaultDoesNotCountAsFault) {
  storage::StoredRun run = RunWith("f19");
  const std::int64_t end_ns = run.samples.back().sample.stamp_ns;
  for (int k = 0; k < 400; ++k) {
    storage::StoredSample after = run.samples[static_cast<std::size_t>(k)];
    after.sample.seq += 1200;
    after.sample.stamp_ns += 1200LL * 1'000'000'000;
    run.samples.push_back(after);
  }
  Runs(storage::Access::kOccasionalWriter).Delete(run.info.id);
  const std::string id = Episode(run, "true");
  ASSERT_TRUE(storage::HistoryReader(History()).Show(id).cleared_ns);

  const json set = RunJson("relearn '*'");

  const storage::StoredRun kept =
      Runs().Load(set["lineage"]["episodes"][0]["run"].get<std::string>());
  EXPECT_LE(kept.samples.back().sample.stamp_ns, end_ns);
  EXPECT_GE(kept.samples.size(), 500U);
  EXPECT_GE(kept.samples.front().sample.stamp_ns,
            run.samples[600].sample.stamp_ns);
}

TEST_F(AppLabelsTest, SignalsThatNotAllRunsHaveAreLeftOut) {
  storage::StoredRun run = RunWith("f19");
  Runs(storage::Access::kOccasionalWriter).Delete(run.info.id);
  for (storage::StoredSample& stored : run.samples) {
    stored.sample.Set(Signal::kSp, 50.0);
  }
  Episode(run, "true");
  EXPECT_EQ(RunJson("relearn '*'")["version"], 2);
}

TEST_F(AppLabelsTest, RunsOfTheParentThatAreGoneAreNamed) {
  Episode(RunWith("f19"), "true");
  std::string gone;
  for (const storage::RunInfo& info : Runs().List()) {
    gone = info.samples == 300 ? info.id : gone;
  }
  Runs(storage::Access::kOccasionalWriter).Delete(gone);

  const Outcome outcome = Run("relearn '*'");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("1 of the 2 runs"), HasSubstr(gone),
                                 HasSubstr("--skip-refused")));

  RunJson("relearn '*' --skip-refused");
  EXPECT_THAT(RunJson("show quick@2")["training_runs"].dump(),
              Not(HasSubstr(gone)));
}

TEST_F(AppLabelsTest, RelabelledEpisodeReplacesWhatItTaught) {
  const std::string id = Episode(RunWith("f1"), "f1");
  const json second = RunJson("relearn '*' --strength " + id + "=0.5");
  EXPECT_TRUE(
      RunJson("relearn '*' --strength " + id + "=0.5")["version"].is_null());
  Label(id, "false");

  const json third = RunJson("relearn '*'");

  ASSERT_THAT(third["lineage"]["episodes"], SizeIs(1));
  EXPECT_EQ(third["lineage"]["episodes"][0]["fault"], "normal");
  EXPECT_EQ(third["lineage"]["parent"]["version"], 2);
  const json shown = RunJson("show quick@3");
  EXPECT_THAT(shown["training_runs"], SizeIs(3));
  EXPECT_THAT(shown["training_runs"],
              Not(Contains(second["lineage"]["episodes"][0]["run"])));
}

// If a label goes, what it taught goes too, though nothing takes its place.
TEST_F(AppLabelsTest, RelabelledEpisodeThatIsRefusedForgetsWhatItTaught) {
  const std::string id = Episode(RunWith("f1"), "f1");
  const json second = RunJson("relearn '*' --strength " + id + "=0.5");
  Label(id, "true");  // And no fault was isolated.

  const json third = RunJson("relearn '*' --skip-refused");

  EXPECT_THAT(third["lineage"]["episodes"], IsEmpty());
  EXPECT_THAT(RunJson("show quick@3")["training_runs"],
              Not(Contains(second["lineage"]["episodes"][0]["run"])));
}

TEST_F(AppLabelsTest, StrengthIsOfOneEpisode) {
  Episode(RunWith("f1"), "f1");
  Episode(RunWith("f19"), "true");
  RelearnRequest request;
  request.valve = "*";
  request.strengths[""] = 0.5;  // As both ids begin.
  EXPECT_THROW(MakeLabelPlan(request, {Path("data")}), NotFoundError);
}

TEST_F(AppLabelsTest, RunsOfTheRequestAreNamedInFull) {
  Episode(RunWith("f19"), "true");
  const std::string parent =
      RunJson("show quick")["training_runs"][0].get<std::string>();
  const std::string last =
      RunJson("relearn '*' --dry-run --runs last")["training_runs"][2]
          .get<std::string>();
  EXPECT_EQ(Runs().Info("last").id, last);

  const json set = RunJson("relearn '*' --runs last," + parent.substr(0, 11));

  EXPECT_EQ(set["version"], 2);
  EXPECT_THAT(RunJson("show quick@2")["training_runs"],
              UnorderedElementsAre(
                  parent, testing::_, last,
                  set["lineage"]["episodes"][0]["run"].get<std::string>()));
}

TEST_F(AppLabelsTest, TransmitterThatFailsAtFirstIsNotAMissingSignal) {
  storage::StoredRun run = RunWith("f19");
  Runs(storage::Access::kOccasionalWriter).Delete(run.info.id);
  run.samples.front().sample.present = kBasicSignals & ~MaskOf(Signal::kX);
  Episode(run, "true");
  const json episode = RunJson("relearn '*' --dry-run")["episodes"][0];
  EXPECT_TRUE(episode["refused"].is_null()) << episode;
}

TEST_F(AppLabelsTest, SameLabelsGiveTheSameHash) {
  const std::string id = Episode(RunWith("f1"), "f1");
  const std::string call = "relearn '*' --strength " + id + "=0.5";
  const json first = RunJson(call);
  const std::size_t runs = Runs().List().size();
  storage::ModelStore(Path("data") / "models.db",
                      storage::Access::kOccasionalWriter)
      .Activate({"quick", 1});

  EXPECT_EQ(RunJson(call)["content_hash"], first["content_hash"]);
  EXPECT_THAT(Runs().List(), SizeIs(runs));
}

TEST_F(AppLabelsTest, WithoutLabelsThereIsNothingToLearn) {
  EXPECT_EQ(Run("relearn '*'").code, 5);
  Episode(RunWith("f19"), "true");
  EXPECT_EQ(Run("relearn '*' --from 2100-01-01").code, 5);
  EXPECT_EQ(Run("relearn '*' --models").code, 2);
  const Outcome removed = Run("train --from-labels");
  EXPECT_EQ(removed.code, 2);
  EXPECT_THAT(removed.err, HasSubstr("fdi-trainer relearn VALVE"));
}

// The new set is compared with the old one before it is taken into use.
TEST_F(AppLabelsTest, ASetThatIsNotWorseIsInUseAfterwards) {
  const std::string id = Episode(RunWith("f1"), "f1");

  const json set = RunJson("relearn '*' --strength " + id + "=0.5");

  EXPECT_EQ(set["active"], true);
  EXPECT_THAT(set["worse"], IsEmpty());
  EXPECT_EQ(set["episodes"][0]["before"], "unknown");
  EXPECT_EQ(set["episodes"][0]["after"], "f1");
  EXPECT_EQ(RunJson("show quick")["version"], 2);
}

}  // namespace
}  // namespace fdi::trainer
