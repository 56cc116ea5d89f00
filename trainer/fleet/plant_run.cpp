#include "trainer/fleet/plant_run.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <new>
#include <optional>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/mutex.h"
#include "base/parallel_for.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/models/model_codec.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/fleet/plant_record.h"
#include "trainer/fleet/valve_types.h"
#include "trainer/onboarding/record_checks.h"

// The rows are independent of each other. A first loop over them compares
// fingerprints, because only the number of rows that are left tells how many
// threads each of them may have; a second one does the work. The result of each
// row is stored at once, so a run that is stopped loses only the rows that were
// in work.
namespace fdi::trainer {
namespace {

using storage::LoopState;
using storage::LoopWatch;
using storage::PlantLoop;

// A name of a model set: what it may not have becomes _.
std::string Storable(std::string name) {
  for (char& c : name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       (c >= '0' && c <= '9') || c == '.' || c == '-';
    c = plain ? c : '_';
  }
  name.resize(std::min<std::size_t>(name.size(), 64));
  return name;
}

// The type that a row is onboarded with; nothing if it is audited.
std::optional<FoundType> TypeOf(const PlantJob& job, storage::ModelStore* store,
                                const std::filesystem::path& folder) {
  if (!WantsModels(job)) {
    return std::nullopt;
  }
  try {
    return FindType(job.row.type, store, folder);
  } catch (const std::exception& error) {
    throw ConfigError("type " + job.row.type + ": " + error.what());
  }
}

// The type and parameters that the models of a row rest on.
std::string BasisText(const std::optional<FoundType>& type,
                      const OnboardingOptions& options) {
  return type ? TypeText(type->type) + type->set_hash +
                    std::to_string(options.false_alarms_per_hour)
              : "";
}

std::string FindingOf(const Onboarding& onboarding) {
  char hours[48];
  std::snprintf(hours, sizeof hours, "%.2f h of healthy data",
                onboarding.hours);
  std::string text = hours;
  if (onboarding.transferred) {
    text += ", fault observers of its type";
  }
  std::string unseen;
  for (const int fault : onboarding.models.undetectable) {
    unseen += (unseen.empty() ? "; not seen at half their strengths: " : " ") +
              FaultName(fault);
  }
  text += unseen;
  if (onboarding.models.position_as_command) {
    text += "; too slow for its command: judged at the position, not the rod";
  }
  return text;
}

// A failure of the row is that row's answer; one of the store, or an
// interruption, ends the run.
void RethrowUnlessOfRow(const std::exception& error) {
  if (dynamic_cast<const Interrupted*>(&error) != nullptr ||
      dynamic_cast<const storage::SqliteError*>(&error) != nullptr ||
      dynamic_cast<const std::bad_alloc*>(&error) != nullptr) {
    throw;
  }
}

class PlantRun {
 public:
  PlantRun(const std::vector<PlantJob>& jobs, PlantFiles& files,
           storage::ModelStore& store, const PlantSettings& settings,
           const PlantProgress& progress)
      : jobs_(jobs),
        files_(files),
        store_(store),
        settings_(settings),
        progress_(progress),
        outcomes_(jobs.size()),
        changed_(jobs.size(), 0) {
    for (const storage::PlantLoop& loop : store.Loops()) {
      stored_.emplace(loop.name, loop);
    }
  }

  std::vector<PlantOutcome> Run() {
    std::vector<std::size_t> rows(jobs_.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      rows[i] = i;
    }
    ForEach(rows, [this](std::size_t i) { FindChange(i); });
    std::erase_if(rows, [this](std::size_t i) { return changed_[i] == 0; });
    threads_of_row_ =
        std::max(1, Jobs() / std::max(1, static_cast<int>(rows.size())));
    std::size_t done = 0;
    ForEach(rows, [&](std::size_t i) {
      Work(i);
      const MutexLock lock(mutex_);
      ++done;
      if (progress_) {
        progress_(static_cast<double>(done) / static_cast<double>(rows.size()),
                  jobs_[i].row.name);
      }
    });
    return std::move(outcomes_);
  }

 private:
  int Jobs() const {
    return settings_.jobs > 0
               ? settings_.jobs
               : std::max(
                     1, static_cast<int>(std::thread::hardware_concurrency()));
  }

  void StopIfAsked() const {
    if (settings_.stop && settings_.stop()) {
      throw Interrupted("interrupted");
    }
  }

  // Calls task(row); a row whose task throws is refused.
  void ForEach(const std::vector<std::size_t>& rows,
               const std::function<void(std::size_t)>& task) {
    ParallelFor(static_cast<int>(rows.size()), Jobs(), [&](int k) {
      StopIfAsked();
      const std::size_t row = rows[static_cast<std::size_t>(k)];
      try {
        task(row);
      } catch (const std::exception& error) {
        RethrowUnlessOfRow(error);
        Refuse(row, error.what());
      }
    });
  }

  std::optional<FoundType> TypeOfRow(std::size_t i) {
    const MutexLock lock(mutex_);
    return TypeOf(jobs_[i], &store_, settings_.folder);
  }

  // A change of grade or group is stored without a new judgement.
  void FindChange(std::size_t i) {
    const PlantJob& job = jobs_[i];
    PlantOutcome& outcome = outcomes_[i];
    const auto before = stored_.find(job.row.name);
    outcome.loop =
        LoopOf(job.row, before == stored_.end() ? PlantLoop{} : before->second);
    if (!job.error.empty()) {
      throw DataError(job.error);
    }
    outcome.loop.input_hash =
        Hex16(InputHash(job, TextsOf(job, files_),
                        BasisText(TypeOfRow(i), settings_.onboarding)));
    if (before == stored_.end() ||
        before->second.input_hash != outcome.loop.input_hash ||
        before->second.type != outcome.loop.type) {
      changed_[i] = 1;
      return;
    }
    outcome.unchanged = true;
    const PlantLoop listed = std::move(outcome.loop);
    outcome.loop = before->second;
    ValveIdentity& identity = outcome.loop;
    if (identity != listed || listed.group != outcome.loop.group) {
      identity = static_cast<const ValveIdentity&>(listed);
      outcome.loop.group = listed.group;
      const MutexLock lock(mutex_);
      store_.PutLoop(outcome.loop, EntryOf(job.row));
    }
  }

  // Onboards or audits a row.
  void Work(std::size_t i) {
    const auto start = std::chrono::steady_clock::now();
    const PlantJob& job = jobs_[i];
    PlantOutcome outcome = outcomes_[i];
    const std::vector<RowText> texts = TextsOf(job, files_);
    if (const std::optional<FoundType> type = TypeOfRow(i)) {
      const Onboarding onboarding =
          OnboardRow(job, *type, ReadValve(job, texts, settings_.utc));
      outcome.loop.finding = FindingOf(onboarding);
      outcome.loop.state = LoopState::kOnboarded;
      outcome.loop.watch = LoopWatch::kFaults;
      storage::ValveResult result = ResultOf(job.row.name, onboarding, "");
      result.entry.type = job.row.type;
      result.entry.sense = job.row.sense;
      result.loop = outcome.loop;
      const MutexLock lock(mutex_);
      const auto saved = store_.Store(result);
      outcome.model_set = saved->name + '@' + std::to_string(saved->version);
    } else {
      outcome.loop.finding = AuditLoop(job, texts, settings_.utc, true);
      outcome.loop.state = LoopState::kDataOnly;
      outcome.loop.watch = LoopWatch::kAudit;
      const MutexLock lock(mutex_);
      store_.PutLoop(outcome.loop, EntryOf(job.row));
    }
    const std::chrono::duration<double> seconds =
        std::chrono::steady_clock::now() - start;
    outcome.seconds = seconds.count();
    outcomes_[i] = std::move(outcome);
  }

  // As `onboard --valve --type` does: a stored type has been fitted already,
  // and its set serves a valve that is like it.
  Onboarding OnboardRow(const PlantJob& job, const FoundType& type,
                        const std::vector<TrainingRun>& runs) {
    OnboardingOptions options = settings_.onboarding;
    options.name = Storable(job.row.name);
    options.type = type.type;
    options.fit = !type.stored;
    options.threads = threads_of_row_;
    options.assess = false;
    {
      const MutexLock lock(mutex_);
      options.of_type = SetOf(type, store_);
    }
    return Onboard(runs, options,
                   [this](double, std::string_view) { StopIfAsked(); });
  }

  // A refused loop is still expected, unless it has no usable name or is the
  // second of a name.
  void Refuse(std::size_t i, const std::string& reason) {
    PlantOutcome& outcome = outcomes_[i];
    outcome.loop.state = LoopState::kRefused;
    outcome.loop.finding = reason;
    if (jobs_[i].row.error.empty()) {
      const MutexLock lock(mutex_);
      store_.PutLoop(outcome.loop, EntryOf(jobs_[i].row));
    }
  }

  const std::vector<PlantJob>& jobs_;
  PlantFiles& files_;
  storage::ModelStore& store_;  // Used under mutex_.
  const PlantSettings& settings_;
  const PlantProgress& progress_;
  std::map<std::string, storage::PlantLoop> stored_;
  // Each row is written by one task at a time.
  std::vector<PlantOutcome> outcomes_;
  std::vector<char> changed_;
  int threads_of_row_{1};
  Mutex mutex_;
};

}  // namespace

std::vector<PlantOutcome> OnboardPlant(const std::vector<PlantJob>& jobs,
                                       PlantFiles& files,
                                       storage::ModelStore& store,
                                       const PlantSettings& settings,
                                       const PlantProgress& progress) {
  return PlantRun(jobs, files, store, settings, progress).Run();
}

std::vector<PlantOutcome> CheckPlant(const std::vector<PlantJob>& jobs,
                                     PlantFiles& files,
                                     storage::ModelStore* store,
                                     const PlantSettings& settings) {
  std::vector<PlantOutcome> outcomes(jobs.size());
  Mutex store_mutex;
  ParallelFor(static_cast<int>(jobs.size()), settings.jobs, [&](int k) {
    const auto i = static_cast<std::size_t>(k);
    storage::PlantLoop& loop = outcomes[i].loop;
    PlantJob job = jobs[i];
    // The first lines of a file tell its form, not what is in the window.
    job.row.from.clear();
    job.row.to.clear();
    loop = LoopOf(job.row);
    try {
      if (!job.error.empty()) {
        throw DataError(job.error);
      }
      std::optional<FoundType> type;
      {
        const MutexLock lock(store_mutex);
        type = TypeOf(job, store, settings.folder);
      }
      const std::vector<RowText> texts = TextsOf(job, files);
      if (type) {
        CheckRecords(ReadValve(job, texts, settings.utc),
                     type->type.parameters.medium);
      } else {
        loop.finding = AuditLoop(job, texts, settings.utc, false);
      }
      loop.watch = type ? LoopWatch::kFaults : LoopWatch::kAudit;
    } catch (const std::exception& error) {
      loop.state = LoopState::kRefused;
      loop.finding = error.what();
    }
  });
  return outcomes;
}

}  // namespace fdi::trainer
