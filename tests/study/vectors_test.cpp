// Runs the built programs: decision vectors.
#include <cstdio>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/valve_engine.h"
#include "storage/models/models.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/trained_runs.h"
#include "tests/study/fixture.h"

namespace fdi::trainer::study {
namespace {

class StudyVectorsTest : public WithStudy<TrainedRuns> {};

// Writes a verdict of the live engine, as `--vectors` does, from its own loop.
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
TEST_F(StudyVectorsTest, RescoringARecordedRunRepeatsTheLiveVectorsBitForBit) {
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
      Study("evaluate --model-set quick --runs " + id + " --vectors v.csv");

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

TEST_F(StudyVectorsTest, FileThatCannotBeWrittenIsNamed) {
  EXPECT_EQ(Study("evaluate --model-set quick --vectors no/such/v.csv --runs " +
                  RunOf(900))
                .code,
            3);
}

}  // namespace
}  // namespace fdi::trainer::study
