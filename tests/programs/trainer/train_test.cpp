// Runs the built program: training from campaigns, bad input, interruption.
#include <chrono>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <spawn.h>
#include <unistd.h>

#include "storage/models/models.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/fixture.h"

extern char** environ;

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::UnorderedElementsAre;

class AppTrainTest : public TrainerProgram {
 protected:
  Outcome TrainText(const std::string& campaign) {
    Write("c.toml", campaign);
    return Run("train --campaign c.toml");
  }
  std::vector<storage::ModelSummary> Stored() const {
    const auto file = Path("data") / "models.db";
    return std::filesystem::exists(file) ? storage::ModelStore(file).List()
                                         : std::vector<storage::ModelSummary>();
  }
  std::vector<storage::RunInfo> Runs() const {
    return storage::RunStore(Path("data") / "runs.db").List();
  }
  // Stores a run of 400 samples with X = CV and F = 2 CV.
  std::string StoreRun(double period_s, FlowUnit unit, bool truth) const {
    std::filesystem::create_directories(Path("data"));
    storage::RunRecorder recorder(Path("data") / "runs.db");
    storage::NewRun run;
    run.valve_id = "LV-1";
    run.period_s = period_s;
    run.flow_unit = unit;
    const auto key = recorder.Begin(run);
    const std::string id = recorder.Id(key);
    for (int k = 0; k < 400; ++k) {
      storage::StoredSample stored;
      Sample& sample = stored.sample;
      sample.seq = static_cast<std::uint64_t>(k);
      sample.stamp_ns = static_cast<std::int64_t>(k * period_s * 1e9);
      sample.flow_unit = unit;
      const double cv = 50.0 + 20.0 * std::sin(0.1 * k) + 3.0 * std::sin(k * k);
      sample.Set(Signal::kCv, cv);
      sample.Set(Signal::kP1, 3500.0 + k % 7);
      sample.Set(Signal::kP2, 2600.0 + k % 5);
      sample.Set(Signal::kT1, 100.0);
      sample.Set(Signal::kX, cv + 0.01 * (k % 11));
      sample.Set(Signal::kF, 2.0 * cv);
      stored.truth = truth ? std::optional(FaultTruth{}) : std::nullopt;
      recorder.Append(key, stored);
    }
    recorder.Close();
    return id;
  }
};

TEST_F(AppTrainTest, CampaignIsSimulatedTrainedAndStoredWithTheKeysOfJson) {
  Write("c.toml", Quick() + TwoConditions());

  const json set = RunJson("train --campaign c.toml");

  std::vector<std::string> keys;
  for (const auto& [key, value] : set.items()) {
    keys.push_back(key);
  }
  EXPECT_THAT(keys, UnorderedElementsAre("model_set", "version", "content_hash",
                                         "channels", "observers", "groups",
                                         "undetectable"));
  EXPECT_EQ(set["model_set"], "quick");
  EXPECT_EQ(set["version"], 1);
  ASSERT_EQ(set["observers"].size(), 2U);
  EXPECT_EQ(set["observers"][1]["fault"], "f19");
  EXPECT_NEAR(set["observers"][1]["strength"].get<double>(), 0.5, 1e-9);
  const json& channel = set["observers"][0]["channels"][0];
  EXPECT_EQ(channel["name"], "X");
  EXPECT_GT(channel["regressors"].size(), 0U);
  EXPECT_EQ(channel["rules"], 1);
  for (const char* key : {"mse", "vaf", "bias"}) {
    EXPECT_TRUE(channel[key].is_number()) << key;
  }
  ASSERT_THAT(Runs(), SizeIs(2));
  for (const storage::RunInfo& run : Runs()) {
    EXPECT_EQ(run.run.origin, storage::RunOrigin::kSimulated);
    EXPECT_TRUE(run.has_truth);
    EXPECT_THAT(run.run.scenario, HasSubstr("paper-operating-point"));
    EXPECT_THAT(run.run.software, HasSubstr("+"));
  }
  EXPECT_NE(Runs()[0].run.seed, Runs()[1].run.seed);
}

TEST_F(AppTrainTest, SameCampaignGivesTheSameHashElsewhere) {
  Write("c.toml", Quick() + TwoConditions());

  const json here = RunJson("train --jobs 1 --campaign c.toml", "a");
  const json there = RunJson("train --jobs 2 --campaign c.toml", "b");

  EXPECT_EQ(here["content_hash"], there["content_hash"]);
  EXPECT_EQ(here, there);
}

TEST_F(AppTrainTest, RunsAreReusedAndTheFirstVersionStaysActive) {
  Write("c.toml", Quick() + TwoConditions());
  RunJson("train --campaign c.toml");

  const json second = RunJson("train --campaign c.toml");
  EXPECT_EQ(second["version"], 2);
  EXPECT_THAT(Runs(), SizeIs(2));
  EXPECT_TRUE(Stored()[0].active);
  EXPECT_FALSE(Stored()[1].active);

  RunJson("train --campaign c.toml --activate");
  EXPECT_TRUE(Stored()[2].active);
}

// Such a VAF comes from dividing by what rounding leaves of a variance.
TEST_F(AppTrainTest, FitOfAnOutputThatDidNotVaryHasNoVaf) {
  Write("c.toml", Quick() + TwoConditions());
  RunJson("train --campaign c.toml");
  storage::ModelStore store(Path("data") / "models.db",
                            storage::Access::kOccasionalWriter);
  ModelSet models = store.Load("quick");
  models.observers[0].channels[1].validation.vaf = -1.3e29;
  store.Save(models);

  const json set = RunJson("show quick@2");

  EXPECT_TRUE(set["observers"][0]["channels"][1]["vaf"].is_null());
  EXPECT_TRUE(set["observers"][0]["channels"][0]["vaf"].is_number());
  EXPECT_THAT(Run("show quick@2").out, testing::Not(HasSubstr("-13000")));
}

TEST_F(AppTrainTest, ImportedFileIsReadOnceAndStretchesAreKept) {
  std::string csv = "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h\n";
  for (int k = 0; k < 300; ++k) {
    const double cv = 50.0 + 20.0 * std::sin(0.1 * k) + 3.0 * std::sin(k * k);
    csv += std::to_string(k) + ',' + std::to_string(cv) + ',' +
           std::to_string(3500 + k % 7) + ',' + std::to_string(2600 + k % 5) +
           ",100," + std::to_string(cv + 0.01 * (k % 11)) + ',' +
           std::to_string(0.2 * cv) + '\n';
  }
  Write("plant.csv", csv);
  Write("c.toml", Quick() +
                      "[[run]]\nimport = \"plant.csv\"\nvalve = \"LV-9\"\n"
                      "from_s = 10\nto_s = 290\n");

  RunJson("train --campaign c.toml --assume-normal");
  RunJson("train --campaign c.toml --assume-normal");

  ASSERT_THAT(Runs(), SizeIs(1));
  EXPECT_EQ(Runs()[0].run.valve_id, "LV-9");
  EXPECT_EQ(Runs()[0].run.origin, storage::RunOrigin::kImported);
  const auto shown = RunJson("show quick");
  EXPECT_EQ(shown["training_runs"][0], Runs()[0].id + "@10:290");
}

TEST_F(AppTrainTest, StretchesOfOneSimulationAreOfOneRun) {
  const std::string one = "[[run]]\nsimulate = {duration_s = 900, seed = 3}\n";
  Write("c.toml", Quick() + one + "to_s = 400\n" + one + "from_s = 500\n");
  RunJson("train --campaign c.toml");
  ASSERT_THAT(Runs(), SizeIs(1));
  EXPECT_THAT(RunJson("show quick")["training_runs"],
              ElementsAre(Runs()[0].id + "@:400", Runs()[0].id + "@500:"));
}

TEST_F(AppTrainTest, LastRunIsThatBeforeTheCampaignStoredOthers) {
  Write("a.toml", Quick() + "[[run]]\nsimulate = {duration_s = 900}\n");
  RunJson("train --campaign a.toml");
  const std::string last = Runs()[0].id;
  Write("b.toml", Quick() +
                      "[[run]]\nrun = \"last\"\n"
                      "[[run]]\nsimulate = {duration_s = 800}\n");
  RunJson("train --campaign b.toml --activate");
  const json runs = RunJson("show quick")["training_runs"];
  ASSERT_THAT(runs, SizeIs(2));
  EXPECT_EQ(runs[0], last);
  EXPECT_NE(runs[1], last);
}

TEST_F(AppTrainTest, UnknownKeyIsRefusedWithFileLineAndWhatIsAccepted) {
  const Outcome outcome =
      TrainText("name = \"x\"\n[decision]\nisolation_treshold = 0.7\n");

  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("c.toml:3"), HasSubstr("isolation_treshold"),
                    HasSubstr("isolation_threshold")));
  EXPECT_FALSE(std::filesystem::exists(Path("data")));
}

TEST_F(AppTrainTest, UnknownFaultIsRefusedAtItsLine) {
  const Outcome outcome = TrainText(
      Quick() +
      "[[run]]\nsimulate = {}\nfaults = [\"f77\"]\nstrengths = [1]\n");

  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("c.toml:"), HasSubstr("f77"), HasSubstr("f19")));
}

TEST_F(AppTrainTest, RunTableNeedsExactlyOneSource) {
  const Outcome outcome =
      TrainText(Quick() + "[[run]]\nsimulate = {}\nrun = \"1a2b3c4d5e6f\"\n");

  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("exactly one of simulate, import, run"));
}

TEST_F(AppTrainTest, ValueBeyondItsRangeIsRefused) {
  const Outcome outcome =
      TrainText("name = \"x\"\n[decision]\nisolation_threshold = 1.5\n");

  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("c.toml:3"), HasSubstr("1.5")));
}

TEST_F(AppTrainTest, MissingRunIsNotFoundBeforeAnythingIsSimulated) {
  const Outcome outcome = TrainText(Quick() + TwoConditions() +
                                    "[[run]]\nrun = \"1a2b3c4d5e6f\"\n");

  EXPECT_EQ(outcome.code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("1a2b3c4d5e6f"));
  EXPECT_THAT(Runs(), IsEmpty());
  EXPECT_THAT(Stored(), IsEmpty());
}

TEST_F(AppTrainTest, RunWithoutTruthIsRefusedUnlessAssumedNormal) {
  const std::string id = StoreRun(1.0, FlowUnit::kTPerHour, false);

  const Outcome outcome = Run("train --name a --runs " + id);

  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr(id), HasSubstr("--assume-normal")));
  EXPECT_THAT(Stored(), IsEmpty());
  EXPECT_EQ(Run("train --name a --assume-normal --runs " + id).code, 0);
  EXPECT_THAT(Stored(), SizeIs(1));
}

TEST_F(AppTrainTest, RunsOfAnotherPeriodOrUnitAreRefused) {
  const std::string id = StoreRun(1.0, FlowUnit::kTPerHour, true);
  const std::string slow = StoreRun(2.0, FlowUnit::kTPerHour, true);
  const std::string cubic = StoreRun(1.0, FlowUnit::kM3PerHour, true);

  const Outcome period = Run("train --name a --runs " + id + "," + slow);
  EXPECT_EQ(period.code, 3);
  EXPECT_THAT(period.err, AllOf(HasSubstr(slow), HasSubstr("period")));
  const Outcome unit = Run("train --name a --runs " + id + "," + cubic);
  EXPECT_EQ(unit.code, 3);
  EXPECT_THAT(unit.err, AllOf(HasSubstr(cubic), HasSubstr("m3/h")));
  EXPECT_THAT(Stored(), IsEmpty());
}

TEST_F(AppTrainTest, UsageErrorsNameTheOption) {
  EXPECT_EQ(Run("train --name a").code, 2);
  EXPECT_THAT(Run("train --name a").err, HasSubstr("--campaign"));
  EXPECT_EQ(Run("train --name a@2 --runs 1a").code, 2);
  EXPECT_EQ(Run("train --name a --preset cubic --runs 1a").code, 2);
  EXPECT_THAT(Run("train --name a --preset cubic --runs 1a").err,
              HasSubstr("paper"));
  EXPECT_EQ(Run("train --name a --runs xyz").code, 2);
  EXPECT_EQ(Run("train --campaign none.toml").code, 5);
  EXPECT_FALSE(std::filesystem::exists(Path("data")));
}

// Waits until the program has written `text` to its log.
void AwaitText(const std::filesystem::path& log, const std::string& text) {
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::seconds(60);
  std::string content;
  while (content.find(text) == std::string::npos) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline) << content;
    std::ostringstream read;
    read << std::ifstream(log).rdbuf();
    content = read.str();
    std::this_thread::yield();
  }
}

TEST_F(AppTrainTest, InterruptedTrainingLeavesNoModelSet) {
  Write("c.toml", Quick() + "[[run]]\nsimulate = {duration_s = 20000}\n");
  const std::string data = Path("data").string();
  const std::string campaign = Path("c.toml").string();
  const std::string log = Path("log.txt").string();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT, 0600);
  std::vector<std::string> words{FDI_TRAINER_PROGRAM, "--data", data, "train",
                                 "--campaign",        campaign};
  std::vector<char*> arguments;
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  pid_t child = 0;
  ASSERT_EQ(posix_spawn(&child, FDI_TRAINER_PROGRAM, &actions, nullptr,
                        arguments.data(), environ),
            0);

  AwaitText(log, "train:");
  kill(child, SIGINT);
  const auto begin = std::chrono::steady_clock::now();
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_LT(std::chrono::steady_clock::now() - begin,
            std::chrono::milliseconds(1500));
  posix_spawn_file_actions_destroy(&actions);

  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_THAT(Read("log.txt"), HasSubstr("interrupted"));
  EXPECT_THAT(Stored(), IsEmpty());
}

}  // namespace
}  // namespace fdi::trainer
