#include "trainer/fleet/plant_run.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <new>
#include <optional>
#include <span>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/mutex.h"
#include "base/parallel_for.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/models/model_codec.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/fleet/plant_record.h"
#include "trainer/fleet/valve_types.h"
#include "trainer/onboarding/record_checks.h"

// The rows of a plant are tasks of one list, which all threads work off. Rows
// of one kind (type, signals, unit of the flow) wait until one of them has been
// onboarded in full, which takes a minute or two and makes their type; then
// each takes seconds. What becomes of a row is stored at once, so a run that is
// stopped loses only the rows that were in work.
//
// A kind is written by the one task that makes its type. `ready`, set
// afterwards under the mutex of the tasks, hands it to those that Next() lets
// go, which only read it. The mutex of the tasks and that of the store are
// never held together.
namespace fdi::trainer {
namespace {

using importer::LoopTag;
using storage::LoopState;
using storage::LoopWatch;

// Usual times relative to a row that takes over its type's observers.
constexpr double kFirstCost = 12.0;
constexpr double kTransferCost = 1.0;
constexpr double kDataOnlyCost = 0.05;

// Rows of one type, with the same signals and units: the fault observers of one
// of them serve the others (docs/plant.md, "What happens to a row").
struct Kind {
  std::string text;  ///< Of the type and the signals, for InputHash().
  std::string name;  ///< That its fitted type is stored as.
  FoundType base;
  std::vector<std::size_t> rows;  ///< In the order of the table.
  /// Set once a row of the kind was onboarded, or the type is a stored one.
  std::optional<FoundType> known{};
  std::optional<ModelSet> models{};
  bool ready{false};  ///< No row is being onboarded to make the type.
};

// A name of a model set or type: what it may not have becomes _.
std::string Storable(std::string name) {
  for (char& c : name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       (c >= '0' && c <= '9') || c == '.' || c == '-';
    c = plain ? c : '_';
  }
  name.resize(std::min<std::size_t>(name.size(), 64));
  return name;
}

// What rows of one kind have in common beside the type: the signals that their
// models read, and the unit that their flow is stated in.
std::string SignalsOf(const PlantJob& job) {
  std::string text;
  for (const LoopTag tag :
       {LoopTag::kX, LoopTag::kF, LoopTag::kP1, LoopTag::kP2, LoopTag::kT1}) {
    const bool flow = tag == LoopTag::kF && job.row.FlowTag().has_value();
    const auto& match = job.sources.front().match;
    const LoopTag from = flow ? *job.row.FlowTag() : tag;
    if (!match[from].empty() && (tag != LoopTag::kF || flow)) {
      text += std::string(importer::LoopTagName(tag)) + ' ' +
              (flow ? job.row[from].unit : "") + ';';
    }
  }
  return text;
}

// What identifies the kind beside the type's name, which two files may share.
// The stem is cut so that the name, at most 59 bytes, is one that models.db
// takes.
std::string KindName(const std::string& type, const std::string& text) {
  const std::string hash =
      storage::HashHex(storage::Sha256Start(std::as_bytes(std::span(text))));
  const std::string stem =
      Storable(std::filesystem::path(type).stem().string()).substr(0, 50);
  return stem + '.' + hash.substr(0, 8);
}

class Kinds {
 public:
  Kinds(const std::vector<PlantJob>& jobs, storage::ModelStore* store,
        const PlantSettings& settings)
      : of_row_(jobs.size()), errors_(jobs.size()) {
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      if (jobs[i].error.empty() && WantsModels(jobs[i])) {
        Add(i, jobs[i], store, settings);
      }
    }
  }

  Kind* Of(std::size_t row) {
    return of_row_[row] ? &kinds_.at(*of_row_[row]) : nullptr;
  }
  const std::string& ErrorOf(std::size_t row) const { return errors_[row]; }
  std::map<std::string, Kind>& all() { return kinds_; }

 private:
  // A type that cannot be found is an error of every row that states it. A type
  // that an earlier run has fitted for this kind is taken up instead of made
  // anew.
  void Add(std::size_t i, const PlantJob& job, storage::ModelStore* store,
           const PlantSettings& settings) {
    // Looked up by the words of the table, before anything is read and parsed.
    const std::string key = job.row.type + '\n' + SignalsOf(job);
    if (const auto found = kinds_.find(key); found != kinds_.end()) {
      found->second.rows.push_back(i);
      of_row_[i] = key;
      return;
    }
    Kind kind;
    try {
      kind.base = FindType(job.row.type, store, settings.folder);
      kind.text = TypeText(kind.base.type) + SignalsOf(job) +
                  std::to_string(settings.onboarding.false_alarms_per_hour);
      kind.name = KindName(job.row.type, kind.text);
      if (kind.base.stored) {
        kind.known = kind.base;
      } else if (store != nullptr && IsStored(kind.name, *store)) {
        kind.known = FindType(kind.name, store);
      }
      if (kind.known && store != nullptr) {
        kind.models = SetOf(*kind.known, *store);
      }
    } catch (const std::exception& error) {
      errors_[i] = "type " + job.row.type + ": " + error.what();
      return;
    }
    // Without its set, a stored type still has the physics.
    kind.ready = kind.known && (kind.models || kind.base.stored);
    kind.rows.push_back(i);
    kinds_.emplace(key, std::move(kind));
    of_row_[i] = key;
  }

  static bool IsStored(const std::string& name, storage::ModelStore& store) {
    const auto types = store.ListTemplates();
    return std::ranges::find(types, name, &storage::ValveType::name) !=
           types.end();
  }

  std::map<std::string, Kind> kinds_;
  std::vector<std::optional<std::string>> of_row_;
  std::vector<std::string> errors_;
};

// Which rows are of the shard. Whole kinds go to the shard with the least to do
// so far, the largest first; without enough kinds rows are dealt one by one.
// Every shard finds the same division from the same table and files, without
// knowing of the others.
std::vector<bool> RowsOfShard(std::size_t count, Kinds& kinds,
                              const PlantSettings& settings) {
  std::vector<bool> mine(count, settings.shards == 1);
  if (settings.shards == 1) {
    return mine;
  }
  const auto shards = static_cast<std::size_t>(settings.shards);
  const auto shard = static_cast<std::size_t>(settings.shard - 1);
  std::vector<const Kind*> largest;
  for (const auto& [key, kind] : kinds.all()) {
    largest.push_back(&kind);
  }
  std::ranges::stable_sort(largest, [](const Kind* a, const Kind* b) {
    return a->rows.size() > b->rows.size();
  });
  const bool whole = largest.size() >= shards;
  std::vector<double> load(shards, 0.0);
  std::vector<bool> dealt(count, false);
  for (const Kind* kind : largest) {
    if (!whole) {
      break;
    }
    const auto least =
        static_cast<std::size_t>(std::ranges::min_element(load) - load.begin());
    load[least] +=
        kFirstCost + kTransferCost * static_cast<double>(kind->rows.size());
    for (const std::size_t row : kind->rows) {
      dealt[row] = true;
      mine[row] = least == shard;
    }
  }
  std::size_t next = 0;
  for (std::size_t row = 0; row < count; ++row) {
    if (!dealt[row]) {
      mine[row] = next++ % shards == shard;
    }
  }
  return mine;
}

std::string Hours(const Onboarding& onboarding) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f h", onboarding.hours);
  return text;
}

std::string FindingOf(const Onboarding& onboarding, const std::string& made) {
  std::string unseen;
  for (const int fault : onboarding.models.undetectable) {
    unseen += (unseen.empty() ? "; not seen at half their strengths: " : " ") +
              FaultName(fault);
  }
  if (onboarding.models.position_as_command) {
    unseen += "; too slow for its command: judged at the position, not the rod";
  }
  return Hours(onboarding) + " of healthy data, " + made + unseen;
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
        kinds_(jobs, &store, settings),
        mine_(RowsOfShard(jobs.size(), kinds_, settings)),
        outcomes_(jobs.size()),
        todo_(jobs.size(), false),
        attempted_(jobs.size(), false) {
    for (const storage::PlantLoop& loop : store.Loops()) {
      stored_.emplace(loop.name, loop);
    }
  }

  std::vector<PlantOutcome> Run() {
    FindChanges();
    MakeTasks();
    const int threads = Threads();
    // Few rows get several threads each.
    inner_threads_ =
        std::max(1, threads / std::max(1, static_cast<int>(tasks_.size())));
    ParallelFor(std::min(threads, static_cast<int>(tasks_.size())), threads,
                [this](int) { Work(); });
    StopIfAsked();
    return std::move(outcomes_);
  }

 private:
  // Rows that make the type of `kind`, or one row.
  struct Task {
    Kind* kind{nullptr};
    bool first{false};
    std::size_t row{0};
    double cost{0.0};
    bool taken{false};
  };

  int Threads() const {
    return settings_.onboarding.threads > 0
               ? settings_.onboarding.threads
               : std::max(
                     1, static_cast<int>(std::thread::hardware_concurrency()));
  }

  void StopIfAsked() const {
    if (settings_.stop && settings_.stop()) {
      throw Interrupted("interrupted");
    }
  }

  void FindChanges() {
    std::vector<int> rows;
    for (std::size_t i = 0; i < jobs_.size(); ++i) {
      outcomes_[i].loop = LoopOf(jobs_[i].row);
      outcomes_[i].in_shard = mine_[i];
      if (mine_[i]) {
        rows.push_back(static_cast<int>(i));
      }
    }
    ParallelFor(static_cast<int>(rows.size()), Threads(), [&](int k) {
      StopIfAsked();
      FindChange(static_cast<std::size_t>(rows[static_cast<std::size_t>(k)]));
    });
  }

  // A row is done again if InputHash() has changed: a cell that tells how to
  // read or judge its record, the record itself, or its kind. Grade and group
  // are not part of that; a change of them is stored without a new judgement.
  void FindChange(std::size_t i) {
    const PlantJob& job = jobs_[i];
    PlantOutcome& outcome = outcomes_[i];
    const std::string& error =
        job.error.empty() ? kinds_.ErrorOf(i) : job.error;
    if (!error.empty()) {
      Refuse(i, error);
      return;
    }
    try {
      const Kind* kind = kinds_.Of(i);
      outcome.loop.input_hash = storage::HashHex(InputHash(
          job, TextsOf(job, files_), kind == nullptr ? "" : kind->text));
    } catch (const DataError& refused) {
      Refuse(i, refused.what());
      return;
    }
    const auto before = stored_.find(job.row.name);
    if (before == stored_.end() ||
        before->second.input_hash != outcome.loop.input_hash ||
        before->second.type != outcome.loop.type) {
      todo_[i] = true;
      return;
    }
    outcome.unchanged = true;
    const storage::PlantLoop listed = outcome.loop;
    outcome.loop = before->second;
    if (listed.grade != outcome.loop.grade ||
        listed.group != outcome.loop.group) {
      outcome.loop.grade = listed.grade;
      outcome.loop.group = listed.group;
      const MutexLock lock(store_mutex_);
      store_.PutLoop(outcome.loop, EntryOf(job.row));
    }
  }

  // First what others wait for, then the quick rows.
  void MakeTasks() {
    for (auto& [key, kind] : kinds_.all()) {
      const bool needed = std::ranges::any_of(
          kind.rows, [this](std::size_t row) { return todo_[row]; });
      if (needed && !kind.ready) {
        tasks_.push_back({&kind, true, 0, kFirstCost});
      }
    }
    for (const bool data_only : {true, false}) {
      for (std::size_t i = 0; i < jobs_.size(); ++i) {
        Kind* kind = kinds_.Of(i);
        if (todo_[i] && (kind == nullptr) == data_only) {
          tasks_.push_back(
              {kind, false, i, data_only ? kDataOnlyCost : kTransferCost});
        }
      }
    }
    for (const Task& task : tasks_) {
      all_cost_ += task.cost;
    }
  }

  // The next task that waits for nothing; null: there is none left.
  Task* Next() {
    MutexLock lock(mutex_);
    while (!failed_) {
      bool waiting = false;
      for (Task& task : tasks_) {
        if (task.taken) {
          continue;
        }
        if (task.first || task.kind == nullptr || task.kind->ready) {
          task.taken = true;
          return &task;
        }
        waiting = true;
      }
      if (!waiting) {
        return nullptr;
      }
      changed_.wait(lock);
    }
    return nullptr;
  }

  // A task that fails leaves others waiting for a type that will never be
  // ready. So they are woken by `failed_` before the exception goes on to
  // ParallelFor().
  void Work() {
    try {
      while (Task* task = Next()) {
        StopIfAsked();
        if (task->first) {
          MakeType(*task->kind);
        } else if (!attempted_[task->row]) {
          Finish(task->row);
        }
        Done(*task);
      }
    } catch (...) {
      const MutexLock lock(mutex_);
      failed_ = true;
      changed_.notify_all();
      throw;
    }
  }

  void Done(const Task& task) {
    const MutexLock lock(mutex_);
    done_cost_ += task.cost;
    if (progress_) {
      progress_(
          all_cost_ > 0.0 ? done_cost_ / all_cost_ : 1.0,
          task.first ? task.kind->base.type.name : jobs_[task.row].row.name);
    }
    changed_.notify_all();
  }

  // Onboards the rows of the kind one after the other until one can be: also
  // one of another shard, so that every shard makes the same type. If none can
  // be, those to be done have been refused, and `ready` only ends the wait.
  void MakeType(Kind& kind) {
    for (const std::size_t row : kind.rows) {
      {
        // A row that was onboarded before its type was deleted stays.
        const MutexLock lock(mutex_);
        attempted_[row] = attempted_[row] != 0 ? attempted_[row] : todo_[row];
      }
      if (Attempt(row, kind)) {
        break;
      }
    }
    const MutexLock lock(mutex_);
    kind.ready = true;
  }

  bool Attempt(std::size_t row, Kind& kind) {
    const auto start = std::chrono::steady_clock::now();
    try {
      const std::vector<TrainingRun> runs =
          ReadValve(jobs_[row], TextsOf(jobs_[row], files_), settings_.utc);
      const Onboarding onboarding = OnboardWith(row, runs, kind.base, nullptr);
      Keep(row, onboarding, "first of its type", kind.name, start);
      const MutexLock lock(store_mutex_);
      kind.known = FindType(kind.name, &store_);
      kind.models = SetOf(*kind.known, store_);
      return true;
    } catch (const std::exception& error) {
      RethrowUnlessOfRow(error);
      if (todo_[row]) {
        Refuse(row, error.what());
      }
      return false;
    }
  }

  // Whether the failure is of the row, not of the store or the user.
  static void RethrowUnlessOfRow(const std::exception& error) {
    if (dynamic_cast<const Interrupted*>(&error) != nullptr ||
        dynamic_cast<const storage::SqliteError*>(&error) != nullptr ||
        dynamic_cast<const std::bad_alloc*>(&error) != nullptr) {
      throw;
    }
  }

  // With the set of its type a valve only takes over observers; where it is not
  // like its type that throws DataError, and Finish() onboards it in full. A
  // stored type has been fitted already.
  Onboarding OnboardWith(std::size_t row, const std::vector<TrainingRun>& runs,
                         const FoundType& type, const ModelSet* of_type) {
    OnboardingOptions options = settings_.onboarding;
    options.name = Storable(jobs_[row].row.name);
    options.type = type.type;
    options.fit = !type.stored;
    if (of_type != nullptr) {
      options.of_type = *of_type;
      options.only_of_type = true;
    }
    options.threads = inner_threads_;
    options.assess = false;
    return Onboard(runs, options,
                   [this](double, std::string_view) { StopIfAsked(); });
  }

  // Onboards a row whose type is ready, or audits one that wants no models.
  void Finish(std::size_t row) {
    const auto start = std::chrono::steady_clock::now();
    const PlantJob& job = jobs_[row];
    try {
      const std::vector<RowText> texts = TextsOf(job, files_);
      Kind* kind = kinds_.Of(row);
      if (kind == nullptr) {
        PlantOutcome outcome = outcomes_[row];
        outcome.loop.finding = AuditLoop(job, texts, settings_.utc, true);
        outcome.loop.state = LoopState::kDataOnly;
        outcome.loop.watch = LoopWatch::kAudit;
        StoreLoop(row, std::move(outcome), start);
        return;
      }
      const std::vector<TrainingRun> runs =
          ReadValve(job, texts, settings_.utc);
      if (kind->models) {
        try {
          const Onboarding onboarding =
              OnboardWith(row, runs, *kind->known, &*kind->models);
          Keep(row, onboarding, "from its type", "", start);
          return;
        } catch (const DataError&) {
          // Not like its type: in full, which says what is wrong if it fails.
        }
      }
      const Onboarding onboarding = OnboardWith(row, runs, kind->base, nullptr);
      Keep(row, onboarding, "on its own", "", start);
    } catch (const std::exception& error) {
      RethrowUnlessOfRow(error);
      Refuse(row, error.what());
    }
  }

  // Stores the model set of a row. A row that was onboarded only to make the
  // type, because it is another shard's or has not changed, keeps its entry and
  // outcome.
  void Keep(std::size_t row, const Onboarding& onboarding,
            const std::string& made, const std::string& type_name,
            std::chrono::steady_clock::time_point start) {
    PlantOutcome outcome = outcomes_[row];
    outcome.made = made;
    outcome.loop.finding = FindingOf(onboarding, made);
    outcome.loop.state = LoopState::kOnboarded;
    outcome.loop.watch = LoopWatch::kFaults;
    storage::ValveResult result =
        ResultOf(jobs_[row].row.name, onboarding, type_name);
    if (todo_[row]) {
      result.entry.type = jobs_[row].row.type;
      result.entry.sense = jobs_[row].row.sense;
      result.loop = outcome.loop;
    } else {
      result.entry = {};  // Of another shard, or there already.
    }
    {
      const MutexLock lock(store_mutex_);
      const auto saved = store_.Store(result);
      outcome.model_set = saved->name + '@' + std::to_string(saved->version);
    }
    outcome.seconds = SecondsSince(start);
    if (todo_[row]) {
      outcomes_[row] = std::move(outcome);
    }
  }

  static double SecondsSince(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() -
                                         start)
        .count();
  }

  void StoreLoop(std::size_t row, PlantOutcome outcome,
                 std::chrono::steady_clock::time_point start) {
    {
      const MutexLock lock(store_mutex_);
      store_.PutLoop(outcome.loop, EntryOf(jobs_[row].row));
    }
    outcome.seconds = SecondsSince(start);
    outcomes_[row] = std::move(outcome);
  }

  // A refused loop is still expected, unless it has no usable name or is the
  // second of a name.
  void Refuse(std::size_t row, const std::string& reason) {
    PlantOutcome& outcome = outcomes_[row];
    outcome.loop.state = LoopState::kRefused;
    outcome.loop.finding = reason;
    if (jobs_[row].row.error.empty()) {
      const MutexLock lock(store_mutex_);
      store_.PutLoop(outcome.loop, EntryOf(jobs_[row].row));
    }
  }

  const std::vector<PlantJob>& jobs_;
  PlantFiles& files_;
  storage::ModelStore& store_;
  const PlantSettings& settings_;
  const PlantProgress& progress_;
  Kinds kinds_;
  std::vector<bool> mine_;
  std::map<std::string, storage::PlantLoop> stored_;
  // Each row is written by one task at a time.
  std::vector<PlantOutcome> outcomes_;
  std::vector<char> todo_;       // Changed since it was stored.
  std::vector<char> attempted_;  // By MakeType().
  std::vector<Task> tasks_;
  double all_cost_{0.0};
  int inner_threads_{1};
  Mutex mutex_;  // Also of tasks and kinds, once the work began.
  CondVar changed_;
  bool failed_ GUARDED_BY(mutex_){false};
  double done_cost_ GUARDED_BY(mutex_){0.0};
  Mutex store_mutex_;
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
  Kinds kinds(jobs, store, settings);
  const std::vector<bool> mine = RowsOfShard(jobs.size(), kinds, settings);
  std::vector<PlantOutcome> outcomes(jobs.size());
  const int threads = settings.onboarding.threads;
  ParallelFor(static_cast<int>(jobs.size()), threads, [&](int k) {
    const auto i = static_cast<std::size_t>(k);
    PlantOutcome& outcome = outcomes[i];
    outcome.in_shard = mine[i];
    if (!mine[i]) {
      return;
    }
    PlantJob job = jobs[i];
    // The first lines of a file tell its form, not what is in the window.
    job.row.from.clear();
    job.row.to.clear();
    outcome.loop = LoopOf(job.row);
    outcome.loop.finding = job.error.empty() ? kinds.ErrorOf(i) : job.error;
    Kind* kind = kinds.Of(i);
    outcome.loop.watch =
        kind == nullptr ? LoopWatch::kAudit : LoopWatch::kFaults;
    try {
      if (outcome.loop.finding.empty() && kind == nullptr) {
        outcome.loop.finding =
            AuditLoop(job, TextsOf(job, files), settings.utc, false);
      } else if (outcome.loop.finding.empty()) {
        CheckRecords(ReadValve(job, TextsOf(job, files), settings.utc),
                     kind->base.type.parameters.medium);
      } else {
        outcome.loop.state = LoopState::kRefused;
      }
    } catch (const std::exception& error) {
      outcome.loop.state = LoopState::kRefused;
      outcome.loop.finding = error.what();
    }
    if (outcome.loop.state == LoopState::kRefused) {
      outcome.loop.watch = LoopWatch::kNothing;
    }
  });
  return outcomes;
}

}  // namespace fdi::trainer
