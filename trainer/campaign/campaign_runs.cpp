#include "trainer/campaign/campaign_runs.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/mutex.h"
#include "base/parallel_for.h"
#include "import/csv.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/run_input.h"

namespace fdi::trainer {
namespace {

using storage::RunInfo;
using storage::RunOrigin;

// A progress bar that moves a few times per second.
constexpr std::uint64_t kSamplesPerReport = 500;

// 2^64 divided by the golden ratio: seeds that follow each other give sources
// that are far apart.
constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15ULL;

// The configuration that a run is simulated with: `start_ns` where its scenario
// does not say it, a source id that follows from its seed.
simulator::ValveSimulationConfig SimulationConfigOf(const SimulatedRun& run,
                                                    std::int64_t start_ns) {
  simulator::ValveSimulationConfig config = run.scenario.config;
  config.start_ns = config.start_ns != 0 ? config.start_ns : start_ns;
  config.source_id = (config.seed + 1) * kGolden;
  return config;
}

storage::NewRun RunRowOf(const SimulatedRun& run, std::int64_t start_ns,
                         const std::string& software) {
  const simulator::ValveSimulationConfig config =
      SimulationConfigOf(run, start_ns);
  storage::NewRun row;
  row.valve_id = run.scenario.valve_id;
  row.source_id = config.source_id;
  row.start_ns = config.start_ns;
  row.period_s = config.period_s;
  row.flow_unit = config.parameters.instruments.flow_unit;
  row.origin = RunOrigin::kSimulated;
  row.scenario = simulator::ScenarioText(run.scenario);
  row.seed = config.seed;
  row.software = software;
  return row;
}

// `report` is called with the number of samples since its last call.
std::vector<LabelledSample> Simulate(
    const simulator::ValveSimulationConfig& config,
    const std::function<void(std::uint64_t)>& report) {
  simulator::ValveSimulation simulation(config);
  std::vector<LabelledSample> samples;
  samples.reserve(simulation.sample_count());
  std::uint64_t reported = 0;
  while (!simulation.finished()) {
    samples.push_back(simulation.Step());
    if (samples.size() - reported == kSamplesPerReport) {
      reported = samples.size();
      report(kSamplesPerReport);
    }
  }
  report(samples.size() - reported);
  return samples;
}

// Also true of two missing readings, which are NaN and unequal as numbers.
bool SameBits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

bool SameSample(const LabelledSample& a, const storage::StoredSample& b) {
  return a.sample.present == b.sample.present &&
         std::equal(a.sample.values.begin(), a.sample.values.end(),
                    b.sample.values.begin(), SameBits) &&
         a.truth.has_value() == b.truth.has_value() &&
         (!a.truth || (a.truth->fault == b.truth->fault &&
                       SameBits(a.truth->strength, b.truth->strength)));
}

// Looks for all runs first, then imports files, then simulates: what can fail
// because of a wrong name or a bad file fails before hours of simulation.
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
    // A campaign of only recorded runs writes nothing.
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
    for (at_ = 0; at_ < runs_.size(); ++at_) {
      std::visit([this](const auto& source) { Find(source); },
                 runs_[at_].source);
    }
    for (const auto& [i, file] : files_) {
      Import(i, std::get<ImportedRun>(runs_[i].source), file);
    }
    if (!missing_.empty()) {
      SimulateMissing();
    }
    for (const auto& [i, first] : repeated_) {
      ids_[i] = ids_[first];
    }
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      result_.selectors.push_back(SelectorOf(ids_[i], runs_[i].stretch));
    }
    return std::move(result_);
  }

 private:
  // The id in full: once others are stored, `last` means another run.
  void Find(const RecordedRun& run) {
    ids_[at_] = SelectorOf(store_->Info(run.selector).id,
                           storage::ParseRunSelector(run.selector));
  }

  void Find(const ImportedRun& run) {
    const std::string scenario = ScenarioOf(run);
    if (IsRepeated(scenario + '\n' + run.valve_id)) {
      return;
    }
    importer::CsvOptions csv;
    csv.start_ns = options_.start_ns;
    importer::CsvTable table = importer::ReadCsvFile(run.file, csv);
    const SampleSeries& content = table.runs.front();
    const bool found = Reuse([&](const RunInfo& info) {
      if (info.run.origin != RunOrigin::kImported ||
          info.run.scenario != scenario || info.run.valve_id != run.valve_id ||
          info.run.flow_unit != content.flow_unit ||
          info.run.period_s != content.period_s || !info.labels.empty()) {
        return false;
      }
      // The file may have been changed since.
      const storage::StoredRun stored = store_->Load(info.id);
      return std::equal(content.samples.begin(), content.samples.end(),
                        stored.samples.begin(), stored.samples.end(),
                        SameSample);
    });
    if (!found) {
      files_.emplace_back(at_, std::move(table));
    }
  }

  void Find(const SimulatedRun& run) {
    const std::string scenario = simulator::ScenarioText(run.scenario);
    if (IsRepeated(scenario + std::to_string(run.scenario.config.seed))) {
      return;
    }
    // Another version of the simulator may give other samples, so only runs of
    // the same software count. A label would override their truth.
    const bool found = Reuse([&](const RunInfo& info) {
      return info.run.origin == RunOrigin::kSimulated &&
             info.run.scenario == scenario &&
             info.run.seed == run.scenario.config.seed &&
             info.run.software == options_.software &&
             info.state == storage::RunState::kComplete && info.has_truth &&
             info.labels.empty();
    });
    if (!found) {
      missing_.push_back(at_);
    }
  }

  // Several runs of a campaign may be stretches of one file or simulation,
  // which is stored once. `content` tells one from another.
  bool IsRepeated(const std::string& content) {
    const auto [first, added] = first_.emplace(content, at_);
    if (!added) {
      repeated_.emplace_back(at_, first->second);
      ++result_.reused;
    }
    return !added;
  }

  // Takes the first known run that matches, if there is one.
  template <typename Predicate>
  bool Reuse(const Predicate& matches) {
    const auto found = std::find_if(known_.begin(), known_.end(), matches);
    if (found == known_.end()) {
      return false;
    }
    ids_[at_] = found->id;
    ++result_.reused;
    return true;
  }

  static std::string ScenarioOf(const ImportedRun& run) {
    return std::filesystem::absolute(run.file).lexically_normal().string();
  }

  void Import(std::size_t i, const ImportedRun& run,
              const importer::CsvTable& table) {
    storage::NewRun row;
    row.valve_id = run.valve_id;
    row.start_ns = options_.start_ns;
    row.scenario = ScenarioOf(run);
    row.software = options_.software;
    ids_[i] = store_->Import(table.runs, row).front();
    ++result_.imported;
  }

  // Simulates on all cores; a mutex guards progress and recorder.
  void SimulateMissing() {
    const auto config_of = [this](std::size_t i) {
      return SimulationConfigOf(std::get<SimulatedRun>(runs_[i].source),
                                options_.start_ns);
    };
    std::uint64_t total = 0;
    for (const std::size_t i : missing_) {
      total += simulator::ValveSimulation(config_of(i)).sample_count();
    }
    storage::RunRecorder recorder(directory_.runs());
    std::uint64_t done = 0;
    Mutex mutex;
    const auto simulate = [&](std::size_t i) {
      const auto samples = Simulate(config_of(i), [&](std::uint64_t count) {
        const MutexLock lock(mutex);
        done += count;
        if (progress_) {
          progress_(static_cast<double>(done) / static_cast<double>(total),
                    RunLabel(runs_[i]));
        }
      });
      const MutexLock lock(mutex);
      const auto key =
          recorder.Begin(RunRowOf(std::get<SimulatedRun>(runs_[i].source),
                                  options_.start_ns, options_.software));
      for (const LabelledSample& sample : samples) {
        recorder.Append(key, sample);
      }
      ids_[i] = recorder.Id(key);
      recorder.End(key);
      recorder.Commit();
    };
    ParallelFor(
        static_cast<int>(missing_.size()), options_.threads,
        [&](int m) { simulate(missing_[static_cast<std::size_t>(m)]); });
    recorder.Close();
    result_.simulated = static_cast<int>(missing_.size());
  }

  const std::vector<CampaignRun>& runs_;
  const storage::DataDirectory& directory_;
  const CollectOptions& options_;
  const CollectProgress& progress_;
  std::optional<storage::RunStore> store_;
  std::vector<RunInfo> known_;
  std::vector<std::string> ids_;  // One per run of the campaign.
  std::size_t at_{0};             // The run being looked for.
  std::vector<std::pair<std::size_t, importer::CsvTable>> files_;  // To import.
  std::vector<std::size_t> missing_;          // To simulate.
  std::map<std::string, std::size_t> first_;  // The first run, by content.
  // A later run, and the first one of the same content.
  std::vector<std::pair<std::size_t, std::size_t>> repeated_;
  CollectedRuns result_;
};

}  // namespace

CollectedRuns CollectRuns(const std::vector<CampaignRun>& runs,
                          const storage::DataDirectory& directory,
                          const CollectOptions& options,
                          const CollectProgress& progress) {
  return Collector(runs, directory, options, progress).Collect();
}

storage::StoredRun SimulateRun(const SimulatedRun& run) {
  storage::StoredRun result;
  result.info.run = RunRowOf(run, 0, {});
  for (const LabelledSample& labelled :
       Simulate(SimulationConfigOf(run, 0), [](std::uint64_t) {})) {
    storage::StoredSample stored;
    stored.sample = labelled.sample;
    stored.truth = labelled.truth;
    result.info.signals |= labelled.sample.present;
    result.samples.push_back(stored);
  }
  result.info.samples = static_cast<std::int64_t>(result.samples.size());
  result.info.has_truth = true;
  return result;
}

}  // namespace fdi::trainer
