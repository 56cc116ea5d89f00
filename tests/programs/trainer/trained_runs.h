#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "import/csv.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/programs/trainer/fixture.h"

namespace fdi::trainer {

/// The set `quick` and the runs that it was trained on, of 900 s without a
/// fault and of f19.
class TrainedRuns : public TrainerProgram {
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
  // `copies` of the normal run, one after another; in the last 300 samples the
  // flow sensor reads half.
  std::vector<LabelledSample> FaultySamples(std::size_t copies = 1) const {
    const storage::StoredRun normal =
        storage::RunStore(Runs()).Load(RunOf(900));
    std::vector<LabelledSample> samples;
    for (std::size_t k = 0; k < copies * normal.samples.size(); ++k) {
      LabelledSample labelled{normal.samples[k % normal.samples.size()].sample,
                              FaultTruth{}};
      labelled.sample.seq = k;
      labelled.sample.stamp_ns = static_cast<std::int64_t>(k) * 1'000'000'000;
      if (k + 300 >= copies * normal.samples.size()) {
        labelled.truth = FaultTruth{19, 0.5};
        labelled.sample.Set(Signal::kF, 0.5 * labelled.sample[Signal::kF]);
      }
      samples.push_back(labelled);
    }
    return samples;
  }
  void WriteFile(const std::string& name,
                 const std::vector<LabelledSample>& samples) const {
    std::ofstream file(Path(name));
    importer::WriteCsv(file, samples, FlowUnit::kM3PerHour, 0);
  }
};

}  // namespace fdi::trainer
