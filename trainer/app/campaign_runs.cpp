#include "trainer/app/campaign_runs.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <optional>

#include "diagnosis/error.h"
#include "storage/csv.h"
#include "storage/runs.h"
#include "trainer/app/run_input.h"
#include "trainer/app/simulated_run.h"
#include "trainer/parallel_for.h"

namespace fdi::trainer {
namespace {

using simulator::ValveSimulation;
using storage::RunInfo;
using storage::RunOrigin;

constexpr std::uint64_t kSamplesPerReport = 500;

bool SameBits(double a, double b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

bool SameSample(const LabelledSample& a, const storage::StoredSample& b) {
  bool same = a.sample.present == b.sample.present &&
              a.truth.has_value() == b.truth.has_value();
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    same = same && SameBits(a.sample.values[i], b.sample.values[i]);
  }
  return same && (!a.truth || (a.truth->fault == b.truth->fault &&
                               SameBits(a.truth->strength, b.truth->strength)));
}

class Collector {
 public:
  Collector(const std::vector<CampaignRun>& runs,
            const storage::DataDirectory& directory,
            const CollectOptions& options, const CollectProgress& progress)
      : runs_(runs),
        directory_(directory),
        options_(options),
        progress_(progress),
        ids_(runs.size()) {}

  CollectedRuns Collect() {
    Open();
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (const auto* run = std::get_if<RecordedRun>(&runs_[i].source)) {
        store_->Info(run->selector);
        ids_[i] = run->selector;
      }
    }
    ReadFiles();
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (const auto* run = std::get_if<SimulatedRun>(&runs_[i].source)) {
        FindSimulated(i, *run);
      }
    }
    SimulateMissing();
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      result_.selectors.push_back(SelectorOf(i));
    }
    return std::move(result_);
  }

 private:
  // A campaign of recorded runs alone writes nothing.
  void Open() {
    const bool writes =
        std::any_of(runs_.begin(), runs_.end(), [](const CampaignRun& run) {
          return !std::holds_alternative<RecordedRun>(run.source);
        });
    if (writes) {
      storage::EnsureExists(directory_);
    }
    store_.emplace(directory_.runs(), writes
                                          ? storage::Access::kOccasionalWriter
                                          : storage::Access::kReader);
    known_ = store_->List();
  }

  void ReadFiles() {
    std::vector<std::pair<std::size_t, storage::CsvTable>> missing;
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      const auto* run = std::get_if<ImportedRun>(&runs_[i].source);
      if (run == nullptr) {
        continue;
      }
      storage::CsvOptions csv;
      csv.start_ns = options_.start_ns;
      storage::CsvTable table = storage::ReadCsvFile(run->file, csv);
      if (!FindImported(i, *run, table.runs.front())) {
        missing.emplace_back(i, std::move(table));
      }
    }
    for (const auto& [i, table] : missing) {
      const auto& run = std::get<ImportedRun>(runs_[i].source);
      storage::NewRun row;
      row.valve_id = run.valve_id;
      row.start_ns = options_.start_ns;
      row.scenario = ScenarioOf(run);
      row.software = options_.software;
      ids_[i] = store_->Import(table, row).front();
      ++result_.imported;
    }
  }

  static std::string ScenarioOf(const ImportedRun& run) {
    return std::filesystem::absolute(run.file).lexically_normal().string();
  }

  bool FindImported(std::size_t i, const ImportedRun& run,
                    const storage::CsvRun& content) {
    for (const RunInfo& info : known_) {
      if (info.run.origin != RunOrigin::kImported ||
          info.run.scenario != ScenarioOf(run) ||
          info.run.valve_id != run.valve_id ||
          info.run.flow_unit != content.flow_unit ||
          info.run.period_s != content.period_s || !info.labels.empty() ||
          info.samples != static_cast<std::int64_t>(content.samples.size())) {
        continue;
      }
      const storage::StoredRun stored = store_->Load(info.id);
      if (std::equal(content.samples.begin(), content.samples.end(),
                     stored.samples.begin(), stored.samples.end(),
                     SameSample)) {
        ids_[i] = info.id;
        ++result_.reused;
        return true;
      }
    }
    return false;
  }

  void FindSimulated(std::size_t i, const SimulatedRun& run) {
    const std::string scenario = simulator::ScenarioText(run.scenario);
    const auto found =
        std::find_if(known_.begin(), known_.end(), [&](const RunInfo& info) {
          return info.run.origin == RunOrigin::kSimulated &&
                 info.run.scenario == scenario &&
                 info.run.seed == run.scenario.config.seed &&
                 info.run.software == options_.software &&
                 info.state == storage::RunState::kComplete && info.has_truth &&
                 info.labels.empty();
        });
    if (found != known_.end()) {
      ids_[i] = found->id;
      ++result_.reused;
    } else {
      missing_.push_back(i);
    }
  }

  void SimulateMissing() {
    if (missing_.empty()) {
      return;
    }
    std::uint64_t total = 0;
    for (const std::size_t i : missing_) {
      total +=
          ValveSimulation(SimulationConfigOf(SimulatedAt(i), options_.start_ns))
              .sample_count();
    }
    storage::RunRecorder recorder(directory_.runs());
    std::uint64_t done = 0;
    std::mutex mutex;
    const auto report = [&](std::uint64_t samples, const std::string& what) {
      const std::scoped_lock lock(mutex);
      done += samples;
      if (progress_) {
        progress_(static_cast<double>(done) / static_cast<double>(total), what);
      }
    };
    ParallelFor(static_cast<int>(missing_.size()), options_.threads,
                [&](int m) {
                  const std::size_t i = missing_[static_cast<std::size_t>(m)];
                  const auto samples = Simulate(SimulatedAt(i), report);
                  const std::scoped_lock lock(mutex);
                  ids_[i] = Record(recorder, SimulatedAt(i), samples);
                });
    recorder.Close();
    result_.simulated = static_cast<int>(missing_.size());
  }

  const SimulatedRun& SimulatedAt(std::size_t i) const {
    return std::get<SimulatedRun>(runs_[i].source);
  }

  template <typename Report>
  std::vector<LabelledSample> Simulate(const SimulatedRun& run,
                                       const Report& report) const {
    ValveSimulation simulation(SimulationConfigOf(run, options_.start_ns));
    const auto& faults = run.scenario.config.faults;
    const std::string what =
        faults.empty() ? "normal" : simulator::ToText(faults.front());
    std::vector<LabelledSample> samples;
    samples.reserve(simulation.sample_count());
    std::uint64_t reported = 0;
    while (!simulation.finished()) {
      samples.push_back(simulation.Step());
      if (samples.size() - reported == kSamplesPerReport) {
        reported = samples.size();
        report(kSamplesPerReport, what);
      }
    }
    report(samples.size() - reported, what);
    return samples;
  }

  std::string Record(storage::RunRecorder& recorder, const SimulatedRun& run,
                     const std::vector<LabelledSample>& samples) const {
    const auto key =
        recorder.Begin(RunRowOf(run, options_.start_ns, options_.software));
    for (const LabelledSample& sample : samples) {
      recorder.Append(key, sample);
    }
    recorder.End(key);
    recorder.Commit();
    return recorder.Id(key);
  }

  std::string SelectorOf(std::size_t i) const {
    if (!runs_[i].stretch.IsStretch()) {
      return ids_[i];
    }
    storage::StoredRun name;
    name.info.id = ids_[i];
    name.selector = runs_[i].stretch;
    return RunName(name);
  }

  const std::vector<CampaignRun>& runs_;
  const storage::DataDirectory& directory_;
  const CollectOptions& options_;
  const CollectProgress& progress_;
  std::optional<storage::RunStore> store_;
  std::vector<RunInfo> known_;
  std::vector<std::string> ids_;  // Of the runs of the campaign.
  std::vector<std::size_t> missing_;
  CollectedRuns result_;
};

}  // namespace

CollectedRuns CollectRuns(const std::vector<CampaignRun>& runs,
                          const storage::DataDirectory& directory,
                          const CollectOptions& options,
                          const CollectProgress& progress) {
  return Collector(runs, directory, options, progress).Collect();
}

}  // namespace fdi::trainer
