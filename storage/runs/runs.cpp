#include "storage/runs/runs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/database/record.h"
#include "storage/runs/run_rows.h"
#include "storage/runs/sql.h"

namespace fdi::storage {

template <>
struct EnumText<RunOrigin> {
  static constexpr auto name = RunOriginName;
  static constexpr auto last = RunOrigin::kRecorded;
};
template <>
struct EnumText<RunState> {
  static constexpr auto name = RunStateName;
  static constexpr auto last = RunState::kInterrupted;
};

namespace sql = runs_sql;
namespace {

constexpr std::string_view kLastRun = "last";

[[noreturn]] void RefuseSelector(std::string_view text,
                                 const std::string& why) {
  throw ConfigError(
      "run \"" + std::string(text) + "\": " + why +
      "; accepted are ID or last, ID@from:to, ID@from: and ID@:to with"
      " seconds from the start of the run");
}

double ParseBound(std::string_view bound, double absent,
                  std::string_view text) {
  if (bound.empty()) {
    return absent;
  }
  const auto value = ParseWhole<double>(bound);
  if (!value || !std::isfinite(*value)) {
    RefuseSelector(text, '"' + std::string(bound) + "\" is not a number");
  }
  return *value;
}

// Seconds from the start of a run as ns UTC, clamped to the range of int64.
std::int64_t StampAt(const RunInfo& info, double t_s) {
  constexpr auto kEarliest = std::numeric_limits<std::int64_t>::min();
  constexpr auto kLatest = std::numeric_limits<std::int64_t>::max();
  // A selector without bounds has infinite ones, and a user may write any
  // number: converting a double beyond the range of int64 is undefined, and so
  // is a sum that overflows.
  const double offset = std::round(t_s * 1e9);
  if (!(std::abs(offset) < 4e18)) {
    return t_s < 0.0 ? kEarliest : kLatest;
  }
  const auto ns = static_cast<std::int64_t>(offset);
  const std::int64_t start = info.run.start_ns;
  if (ns > 0 && start > kLatest - ns) {
    return kLatest;
  }
  return ns < 0 && start < kEarliest - ns ? kEarliest : start + ns;
}

void ApplyLabels(StoredRun& run) {
  // Labels come in the order in which they were given, so the last one wins.
  for (const RunLabel& label : run.info.labels) {
    const std::int64_t from = StampAt(run.info, label.from_s);
    const std::int64_t to = StampAt(run.info, label.to_s);
    for (StoredSample& sample : run.samples) {
      if (sample.sample.stamp_ns >= from && sample.sample.stamp_ns < to) {
        sample.truth = FaultTruth{label.fault, label.strength};
      }
    }
  }
}

// As a recorder does by default (RunRecorderOptions::chunk_samples).
constexpr std::size_t kImportChunk = 600;

std::optional<double> BoundOf(double t_s) {
  return std::isfinite(t_s) ? std::optional(t_s) : std::nullopt;
}

void CheckLabel(int fault, double strength) {
  if (fault < 0 || fault > kLastFault) {
    throw ConfigError("label: fault " + std::to_string(fault) +
                      " is not in 0.." + std::to_string(kLastFault));
  }
  const bool fits = fault == 0 ? strength == 0.0
                               : strength != 0.0 && std::abs(strength) <= 1.0;
  if (!fits) {
    throw ConfigError("label: strength " + std::to_string(strength) + " of " +
                      FaultName(fault) + " is not " +
                      (fault == 0 ? "0" : "in [-1, 1] without 0"));
  }
}

std::string ImportPart(Database& database, const SampleSeries& part,
                       const NewRun& run) {
  std::string id = NewRunId();
  const std::int64_t run_id = InsertRun(database, id, run, std::nullopt);
  RunCounters counters;
  ChunkHints hints;
  // By chunks, so that there is no second copy of a long run.
  for (std::size_t first = 0; first < part.samples.size();
       first += kImportChunk) {
    std::vector<StoredSample> samples;
    const std::size_t end = std::min(first + kImportChunk, part.samples.size());
    for (std::size_t k = first; k < end; ++k) {
      StoredSample stored;
      stored.sample = part.samples[k].sample;
      stored.sample.source_id = run.source_id;
      stored.truth = part.samples[k].truth;
      counters.Count(stored);
      samples.push_back(stored);
    }
    InsertChunk(database, run_id, static_cast<std::int64_t>(first), samples,
                &hints);
  }
  AddCounters(database, run_id, counters);
  return id;
}

}  // namespace

const Schema& RunsSchema() {
  static const Schema schema{
      "run",
      kRunsApplicationId,
      Synchronous::kNormal,
      {sql::kMigrations.begin(), sql::kMigrations.end()},
      sql::kBaseline,
      "import its runs again with `fdi-store runs import`, from what the "
      "program that wrote it exports"};
  return schema;
}

std::string_view RunOriginName(RunOrigin origin) {
  switch (origin) {
    case RunOrigin::kSimulated:
      return "simulated";
    case RunOrigin::kImported:
      return "imported";
    case RunOrigin::kRecorded:
      break;
  }
  return "recorded";
}

std::string_view RunStateName(RunState state) {
  switch (state) {
    case RunState::kRecording:
      return "recording";
    case RunState::kComplete:
      return "complete";
    case RunState::kInterrupted:
      break;
  }
  return "interrupted";
}

// The text of a selector, with the first hex digits of an id, or `last`, and
// seconds from the start of the run:
//
//     selector = id ["@" [from] ":" [to]]
RunSelector ParseRunSelector(std::string_view text) {
  RunSelector selector;
  const std::size_t at = text.find('@');
  selector.id = std::string(text.substr(0, at));
  if (selector.id != kLastRun &&
      (selector.id.empty() || selector.id.size() > 12 ||
       selector.id.find_first_not_of("0123456789abcdefABCDEF") !=
           std::string::npos)) {
    RefuseSelector(text, "an id is up to 12 hex digits, or last");
  }
  for (char& c : selector.id) {
    c = static_cast<char>(c >= 'A' && c <= 'F' ? c - 'A' + 'a' : c);
  }
  if (at == std::string_view::npos) {
    return selector;
  }
  const std::string_view stretch = text.substr(at + 1);
  const std::size_t colon = stretch.find(':');
  if (colon == std::string_view::npos) {
    RefuseSelector(text, "the stretch has no colon");
  }
  selector.from_s = ParseBound(stretch.substr(0, colon), selector.from_s, text);
  selector.to_s = ParseBound(stretch.substr(colon + 1), selector.to_s, text);
  if (!(selector.from_s < selector.to_s)) {
    RefuseSelector(text, "the stretch ends before it begins");
  }
  return selector;
}

RunStore::RunStore(const std::filesystem::path& path, Access access)
    : database_(std::make_unique<Database>(path, RunsSchema(), access)) {}

std::vector<RunInfo> RunStore::List(const RunFilter& filter) {
  const Snapshot snapshot(*database_);
  Statement rows = database_->Prepare(
      std::string(sql::runs) +
      " valve_id GLOB ? AND start_ns >= ? AND start_ns < ?"
      " AND (?4 IS NULL OR origin = ?4) ORDER BY start_ns, run_id");
  rows.Bind(filter.valve_glob, filter.since_ns, filter.until_ns, filter.origin);
  std::vector<RunInfo> infos;
  while (rows.Step()) {
    infos.push_back(ReadRun(rows));
  }
  return infos;
}

RunInfo RunStore::Info(std::string_view selector) {
  return Find(ParseRunSelector(selector));
}

RunInfo RunStore::Find(const RunSelector& selector) {
  // The ids with a given prefix are a range of their index, because 'g' sorts
  // behind every hex digit; a second row shows that the prefix is ambiguous.
  // For `last`, the condition ?1 <> '' only mentions the parameter: SQLite
  // refuses a value for one that is not in the text.
  const bool last = selector.id == kLastRun;
  Statement rows = database_->Prepare(
      std::string(sql::runs) +
      (last ? " ?1 <> '' ORDER BY run_id DESC LIMIT 1"
            : " id >= ?1 AND id < ?1 || 'g' ORDER BY id LIMIT 2"));
  if (!rows.Bind(selector.id).Step()) {
    throw NotFoundError("there is no run " + selector.id + " in " +
                        database_->path().string());
  }
  RunInfo found = ReadRun(rows);
  if (rows.Step()) {
    throw NotFoundError("run " + selector.id + " is ambiguous: " + found.id +
                        ", " + rows.Text(1) + ", ...");
  }
  return found;
}

StoredRun RunStore::Load(std::string_view text) {
  StoredRun run;
  run.selector = ParseRunSelector(text);
  const Snapshot snapshot(*database_);
  run.info = Find(run.selector);
  const std::int64_t from = StampAt(run.info, run.selector.from_s);
  const std::int64_t to = StampAt(run.info, run.selector.to_s);
  // A recorder moves samples from tail to chunk, so both are read in one
  // snapshot. The tail holds the newest samples and comes last.
  for (const std::string_view table : {"chunk", "tail"}) {
    LoadTable(table, from, to, run);
  }
  if (run.samples.empty()) {
    throw NotFoundError("run " + std::string(text) + " holds no sample (of " +
                        std::to_string(run.info.samples) + ")");
  }
  ApplyLabels(run);
  return run;
}

RunInfo RunStore::ReadRun(const Statement& row) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr int kFirstIntake = 20;
  RunInfo info;
  NewRun& run = info.run;
  std::int64_t recorder = 0;
  row.Read(0, info.row_id, info.id, run.valve_id, run.source_id, run.start_ns,
           run.period_s, run.flow_unit, run.origin, run.scenario, run.seed,
           run.software, info.state, recorder, info.created_ns, info.samples,
           info.has_truth, info.first_stamp_ns, info.last_stamp_ns,
           info.signals, info.stored_bytes);
  for (int i = 0; i < kIntakeCount; ++i) {
    info.intake[static_cast<std::size_t>(i)] = row.Int64(kFirstIntake + i);
  }
  // A recorder that was killed leaves its runs as `recording`; the next
  // recorder marks them. Until then its released lock tells.
  if (info.state == RunState::kRecording &&
      !RecorderLiveness::IsAlive(database_->path(), recorder)) {
    info.state = RunState::kInterrupted;  // Not marked in the file yet.
  }
  Statement labels = database_->Prepare(sql::labels);
  labels.Bind(info.row_id);
  while (labels.Step()) {
    info.labels.push_back({labels.OptionalDouble(0).value_or(-kInfinity),
                           labels.OptionalDouble(1).value_or(kInfinity),
                           labels.Int(2), labels.Double(3)});
  }
  return info;
}

void RunStore::LoadTable(std::string_view table, std::int64_t from,
                         std::int64_t to, StoredRun& run) {
  const std::string name(table);
  Statement rows = database_->Prepare(std::string(sql::bundles) + " " + name +
                                      " " + std::string(sql::bundles_between));
  rows.Bind(run.info.row_id, from, to);
  const std::string where = database_->path().string() + ": run " +
                            run.info.id + ", " + name + " of sample ";
  while (rows.Step()) {
    // Rows are selected by their earliest and latest stamp, so they may hold
    // samples beyond the bounds. Without a stretch, `to` is the largest
    // possible stamp and belongs to the run.
    for (StoredSample& sample : ReadBundle(rows, where)) {
      const std::int64_t stamp = sample.sample.stamp_ns;
      if (stamp >= from && (stamp < to || !run.selector.IsStretch())) {
        run.samples.push_back(std::move(sample));
      }
    }
  }
}

// In one transaction: all runs of a file with gaps are stored or none.
std::vector<std::string> RunStore::Import(std::span<const SampleSeries> series,
                                          const NewRun& base) {
  std::vector<std::string> ids;
  Transaction transaction(*database_);
  for (const SampleSeries& part : series) {
    NewRun run = base;
    run.origin = RunOrigin::kImported;
    run.period_s = part.period_s;
    run.flow_unit = part.flow_unit;
    if (series.size() > 1) {
      run.start_ns = part.samples.front().sample.stamp_ns;
    }
    ids.push_back(ImportPart(*database_, part, run));
  }
  transaction.Commit();
  return ids;
}

void RunStore::Label(std::string_view text, int fault, double strength) {
  CheckLabel(fault, strength);
  const RunSelector selector = ParseRunSelector(text);
  Transaction transaction(*database_);
  const RunInfo info = Find(selector);
  if (info.samples == 0 ||
      StampAt(info, selector.from_s) > info.last_stamp_ns ||
      StampAt(info, selector.to_s) <= info.first_stamp_ns) {
    throw NotFoundError("run " + std::string(text) + " holds no sample");
  }
  database_->Run(sql::insert_label, info.row_id, BoundOf(selector.from_s),
                 BoundOf(selector.to_s), fault, FaultName(fault), strength,
                 NowNs());
  transaction.Commit();
}

int RunStore::RemoveLabels(std::string_view text) {
  Transaction transaction(*database_);
  database_->Run("DELETE FROM run_label WHERE run_id = ?", Info(text).row_id);
  const int removed = database_->Changes();
  transaction.Commit();
  return removed;
}

std::string RunStore::Delete(std::string_view text) {
  const RunSelector selector = ParseRunSelector(text);
  if (selector.IsStretch()) {
    throw ConfigError("run " + std::string(text) +
                      ": a stretch cannot be deleted, only the whole run");
  }
  Transaction transaction(*database_);
  const RunInfo info = Find(selector);
  // Its recorder would fail at every commit, because its rows refer to a run
  // that is gone.
  if (info.state == RunState::kRecording) {
    throw DataError("run " + info.id +
                    " is being recorded: end its recorder first");
  }
  database_->Run("DELETE FROM run WHERE run_id = ?", info.row_id);
  transaction.Commit();
  return info.id;
}

}  // namespace fdi::storage
