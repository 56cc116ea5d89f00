// Runs the built program: indices, decision vectors, rules in words.
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
#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

class AppEvaluateTest : public TrainerProgram {
 protected:
  void SetUp() override {
    Write("c.toml", Quick() + TwoConditions());
    ASSERT_EQ(Run("train --campaign c.toml").code, 0) << Read("err.txt");
  }
  std::filesystem::path Runs() const { return Path("data") / "runs.db"; }
  // The run of the training campaign that lasts so long.
  std::string RunOf(std::int64_t samples) const {
    for (const storage::RunInfo& run : storage::RunStore(Runs()).List()) {
      if (run.samples == samples) {
        return run.id;
      }
    }
    return {};
  }
  // A run in which the flow sensor reads half from 600 s on.
  std::string FaultyRun() const {
    storage::StoredRun normal = storage::RunStore(Runs()).Load(RunOf(900));
    storage::RunRecorder recorder(Runs());
    const auto key = recorder.Begin(normal.info.run);
    const std::string id = recorder.Id(key);
    for (storage::StoredSample& stored : normal.samples) {
      if (stored.sample.seq >= 600) {
        stored.sample.Set(Signal::kF, 0.5 * stored.sample[Signal::kF]);
        stored.truth = FaultTruth{19, 0.5};
      }
      recorder.Append(key, stored);
    }
    recorder.Close();
    return id;
  }
  std::vector<std::string> Lines(const std::string& name) const {
    std::istringstream text(Read(name));
    std::vector<std::string> lines;
    for (std::string line; std::getline(text, line);) {
      lines.push_back(line);
    }
    return lines;
  }
};

TEST_F(AppEvaluateTest, JsonHasTheKeysOfTheContractAndFindsTheFault) {
  const std::string id = FaultyRun();

  const json result =
      RunJson("evaluate --model-set quick --runs " + id + "," + RunOf(900));

  std::vector<std::string> keys;
  const json& run = result["runs"][0];
  for (const auto& [key, value] : run.items()) {
    keys.push_back(key);
  }
  EXPECT_THAT(
      keys, UnorderedElementsAre(
                "run_id", "fault", "strength", "detected", "t_dt_first", "t_dt",
                "t_it_first", "t_it", "r_fd", "r_td", "r_fi", "r_ti", "r_mi",
                "fs_d", "fs_i", "d_acc", "final_set", "certainty", "t_exact",
                "episodes", "wrong_isolations", "second_t", "second_set"));
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
  EXPECT_EQ(summary["confusion"]["f19"]["f19"], 1.0);
  EXPECT_EQ(summary["confusion"]["normal"]["no_alarm"], 1.0);
}

// What the live engine said, as `--vectors` writes it, from its own loop.
std::string LineOf(const std::string& run, const Verdict& v) {
  char text[600];
  std::snprintf(
      text, sizeof text,
      "%s,%lld,%llu,%llu,%s,%d,%s,%s,%a,%a,%a,%a,%a,%a,%a,%a,%a,%a,%s,%a,%a",
      run.c_str(), static_cast<long long>(v.stamp_ns),
      static_cast<unsigned long long>(v.source_id),
      static_cast<unsigned long long>(v.seq),
      std::string(IntakeName(v.intake)).c_str(), v.initialised ? 1 : 0,
      std::string(QualityName(v.quality)).c_str(),
      std::string(StateName(v.state)).c_str(), v.residuals[0], v.residuals[1],
      v.normal_factor, v.fault_factors[0], v.fault_factors[1],
      v.fault_factors[2], v.fault_factors[3], v.fault_factors[4],
      v.fault_factors[5], v.fault_factors[6], v.isolated != 0 ? "f19" : "",
      v.observer_factors[0], v.observer_factors[1]);
  return text;
}

// A live monitor meets repeats, gaps, bad readings, a swap of its model set and
// an episode ended from outside; its recorder keeps what became of each sample.
TEST_F(AppEvaluateTest, RescoringARecordedRunRepeatsTheLiveVectorsBitForBit) {
  const auto models = std::make_shared<const ModelSet>(
      storage::ModelStore(Path("data") / "models.db").Load("quick"));
  const storage::StoredRun source = storage::RunStore(Runs()).Load(FaultyRun());
  ValveEngine live(models);
  storage::RunRecorder recorder(Runs());
  storage::NewRun row = source.info.run;
  row.origin = storage::RunOrigin::kRecorded;
  const auto key = recorder.Begin(row);
  const std::string id = recorder.Id(key);
  std::vector<std::string> expected;
  const auto receive = [&](Sample sample, bool swapped) {
    if (swapped) {
      live.Adopt(models);
    }
    const Verdict& verdict = live.Step(sample);
    storage::StoredSample stored;
    stored.sample = sample;
    stored.intake = verdict.intake;
    stored.initialised = verdict.initialised;
    stored.model_swapped = swapped;
    recorder.Append(key, stored);
    expected.push_back(LineOf(id, verdict));
  };
  for (std::size_t k = 0; k < source.samples.size(); ++k) {
    Sample sample = source.samples[k].sample;
    if (k >= 300 && k < 305) {
      continue;  // A gap.
    }
    if (k == 200) {
      sample.Set(Signal::kX, std::numeric_limits<double>::quiet_NaN());
    }
    if (k == 700) {
      live.EndEpisode(EndReason::kStreamEnded);
    }
    receive(sample, k == 400 || k == 800);
    if (k == 100 || k == 650) {
      receive(sample, false);                        // A repeat,
      receive(source.samples[k - 3].sample, false);  // a late one.
    }
  }
  recorder.Close();

  const Outcome outcome =
      Run("evaluate --model-set quick --runs " + id + " --vectors v.csv");

  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::vector<std::string> lines = Lines("v.csv");
  ASSERT_EQ(lines.size(), expected.size() + 1);
  EXPECT_EQ(lines[0],
            "run,stamp_ns,source_id,seq,intake,initialised,quality,state,r_X,"
            "r_F,d_0,d_f19,d_travel_deviation,d_shut_flow,d_excess_flow,"
            "d_x_stuck,d_f_stuck,d_low_flow,isolated,o_normal,o_f19 0.50");
  for (std::size_t k = 0; k < expected.size(); ++k) {
    ASSERT_EQ(lines[k + 1], expected[k]) << "sample " << k;
  }
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
  EXPECT_EQ(
      Run("evaluate --model-set quick --vectors no/such/v.csv --runs " + id)
          .code,
      3);

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

// What earlier versions had answers with what to do instead.
TEST_F(AppEvaluateTest, RemovedVerbsAndOptionsNameWhatReplacesThem) {
  const std::vector<std::pair<std::string, std::string>> removed{
      {"evaluate --model-set quick --history plant --work-orders o.csv",
       "--history is gone: score each file with --file"},
      {"evaluate --model-set quick --campaign c.toml --leave-one-out",
       "fdi-study leave-one-out"},
      {"evaluate --campaign c.toml --seeds=20", "fdi-study seeds"},
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

}  // namespace
}  // namespace fdi::trainer
