// Runs the built program: stored runs and files scored, rules in words.
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <vector>

#include <gmock/gmock.h>

#include "diagnosis/decision/valve_engine.h"
#include "storage/models/models.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/trained_runs.h"
#include "trainer/scoring/evaluated_run.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

class AppEvaluateTest : public TrainedRuns {};

TEST_F(AppEvaluateTest, JsonHasTheKeysOfTheContractAndFindsTheFault) {
  const std::string id = FaultyRun();

  const json result =
      RunJson("evaluate --model-set quick --runs " + id + "," + RunOf(900));

  std::vector<std::string> keys;
  const json& run = result["runs"][0];
  for (const auto& [key, value] : run.items()) {
    keys.push_back(key);
  }
  EXPECT_THAT(keys, UnorderedElementsAre(
                        "run_id", "fault", "strength", "detected", "t_dt",
                        "t_it", "final_set", "certainty", "episodes",
                        "wrong_isolations", "second_t", "second_set"));
  EXPECT_EQ(run["run_id"], id);
  EXPECT_EQ(run["fault"], "f19");
  EXPECT_EQ(run["strength"], 0.5);
  EXPECT_EQ(run["detected"], true);
  EXPECT_EQ(run["t_dt"], 0.0);  // Half the flow shows in the first sample.
  EXPECT_EQ(run["final_set"], json::array({"f19"}));
  EXPECT_EQ(run["certainty"], "sure");
  EXPECT_EQ(result["runs"][1]["fault"], "normal");
  EXPECT_TRUE(result["runs"][1]["certainty"].is_null());
  const json& summary = result["summary"];
  EXPECT_EQ(summary["faulty_runs"], 1);
  EXPECT_EQ(summary["exact"], 1);
  EXPECT_EQ(summary["fault_free_episodes"], 0);
  EXPECT_EQ(summary["answers"],
            json::parse(R"([{"certainty":"sure","answers":1,"right":1}])"));
  // A pipe gets all of it.
  EXPECT_THAT(Run("evaluate --model-set quick --runs " + id).out,
              AllOf(HasSubstr("wrong  said to be  final set\n"),
                    HasSubstr("how right the answers are")));
}

TEST_F(AppEvaluateTest, RunWithoutTruthIsScoredButNotCounted) {
  storage::StoredRun normal = storage::RunStore(Runs()).Load(RunOf(900));
  storage::RunRecorder recorder(Runs());
  const auto key = recorder.Begin(normal.info.run);
  const std::string id = recorder.Id(key);
  for (storage::StoredSample& stored : normal.samples) {
    stored.truth.reset();
    recorder.Append(key, stored);
  }
  recorder.Close();
  const std::string call = "evaluate --model-set quick --runs " + id;

  const json result = RunJson(call);
  EXPECT_TRUE(result["runs"][0]["fault"].is_null());
  EXPECT_EQ(result["summary"]["fault_free_runs"], 0);
  EXPECT_EQ(result["summary"]["runs_without_truth"], 1);
  EXPECT_EQ(RunJson(call + " --assume-normal")["summary"]["fault_free_runs"],
            1);
}

TEST_F(AppEvaluateTest, ValveIsScoredWithTheSetAssignedToIt) {
  const std::string call = "evaluate --valve LV-1 --csv --runs " + RunOf(900);
  const Outcome unassigned = Run(call);
  EXPECT_EQ(unassigned.code, 5);
  EXPECT_THAT(unassigned.err, HasSubstr("LV-1"));

  storage::ModelStore(Path("data") / "models.db",
                      storage::Access::kOccasionalWriter)
      .AssignModelSet("LV-*", storage::ModelReference{"quick", {}});

  const Outcome outcome = Run(call);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("run_id,fault,strength,detected,"),
                                 HasSubstr(RunOf(900) + ",normal,0.0,false,")));
}

TEST_F(AppEvaluateTest, BadInputIsNamedWithItsExitCode) {
  const std::string id = RunOf(900);
  EXPECT_EQ(Run("evaluate --runs " + id).code, 2);
  EXPECT_EQ(Run("evaluate --model-set quick").code, 2);
  EXPECT_EQ(Run("evaluate --model-set quick --runs abcdefabcdef").code, 5);
  EXPECT_EQ(Run("evaluate --model-set quick@9 --runs " + id).code, 5);
  EXPECT_THAT(Run("show other").err, HasSubstr("quick@1"));
  EXPECT_EQ(Run("show other").code, 5);

  storage::StoredRun run = storage::RunStore(Runs()).Load(id);
  run.info.run.flow_unit = FlowUnit::kTPerHour;
  storage::RunRecorder recorder(Runs());
  const auto key = recorder.Begin(run.info.run);
  const std::string tonnes = recorder.Id(key);
  for (storage::StoredSample& stored : run.samples) {
    stored.sample.flow_unit = FlowUnit::kTPerHour;
    recorder.Append(key, stored);
  }
  recorder.Close();
  const Outcome unit = Run("evaluate --model-set quick --runs " + tonnes);
  EXPECT_EQ(unit.code, 0);
  EXPECT_THAT(unit.err,
              HasSubstr("flow_converted run=" + tonnes + " from=t/h to=m3/h"));
}

// Verbs and options of earlier versions answer with what to do instead.
TEST_F(AppEvaluateTest, RemovedVerbsAndOptionsNameWhatReplacesThem) {
  const std::vector<std::pair<std::string, std::string>> removed{
      {"evaluate --model-set quick --history plant --work-orders o.csv",
       "--history is gone: score each file with --file"},
      {"evaluate --model-set quick --campaign c.toml", "fdi-study evaluate"},
      {"evaluate --model-set quick --file f.csv --report r",
       "fdi-study evaluate"},
      {"compare quick@1 quick@1 --campaign c.toml", "fdi-study evaluate"},
      {"evaluate --model-set quick --leave-one-out", "fdi-study leave-one-out"},
      {"evaluate --model-set quick --seeds=20", "fdi-study seeds"},
      {"evaluate --verdicts v.csv --file f.csv", "fdi-study verdicts"},
      {"evaluate --baseline arx-cusum", "fdi-study baseline"},
      {"evaluate --model-set quick --without f1", "fdi-study reduce"},
      {"show quick --pictures pics", "fdi-study pictures"},
      {"inject --file f.csv --fault f5:abrupt@5", "fdi-study inject"}};
  for (const auto& [call, instead] : removed) {
    const Outcome outcome = Run(call);
    EXPECT_EQ(outcome.code, 2) << call;
    EXPECT_THAT(outcome.err, HasSubstr(instead)) << call;
  }
}

TEST_F(AppEvaluateTest, ShowTellsWhereTheSetCameFromAndItsRulesInWords) {
  const Outcome outcome = Run("show quick --rules");

  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("quick@1 (active)"),
                    HasSubstr("false alarms per hour"), HasSubstr(RunOf(900)),
                    HasSubstr("f19 0.50, F:"), HasSubstr("then X(k) = ")));
  const json set = RunJson("show quick@1 --rules");
  EXPECT_EQ(set["decision"]["isolation_threshold"], 0.7);
  const json& rule = set["observers"][0]["channels"][1]["rule_list"][0];
  EXPECT_EQ(rule["data_share"], 1.0);
  EXPECT_EQ(rule["slopes"].size(),
            set["observers"][0]["channels"][1]["regressors"].size());
}

TEST(FiguresTest, RunsWithAFaultAndHealthyOnesAreSummedApart) {
  EvaluatedRun right;
  right.indices.fault = 6;
  right.indices.detected = true;
  right.indices.final_set = {6};
  right.indices.d_acc = 1.0;
  EvaluatedRun pair = right;
  pair.indices.final_set = {3, 6};
  pair.indices.d_acc = 0.5;
  EvaluatedRun missed;
  missed.indices.fault = 3;
  missed.indices.d_acc = 0.0;
  EvaluatedRun healthy;
  healthy.indices.episodes = 2;
  healthy.duration_s = 7200.0;
  EvaluatedRun unknown = healthy;
  unknown.has_truth = false;
  const EvaluationFigures figures =
      FiguresOf({right, pair, missed, healthy, unknown});
  EXPECT_EQ(figures.faulty_runs, 3);
  EXPECT_EQ(figures.detected, 2);
  EXPECT_EQ(figures.contained, 2);
  EXPECT_EQ(figures.exact, 1);
  EXPECT_EQ(figures.fault_free_episodes, 2);
  EXPECT_DOUBLE_EQ(figures.fault_free_hours, 2.0);
  EXPECT_EQ(figures.without_truth, 1);
}

}  // namespace
}  // namespace fdi::trainer
