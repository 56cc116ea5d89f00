#include "storage/run_reader.h"

#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/error.h"
#include "storage/recorder_liveness.h"
#include "storage/run_rows.h"

namespace fdi::storage {
namespace {

constexpr std::string_view kSelectRun =
    "SELECT run_id, id, valve_id, source_id, start_ns, period_s, flow_unit,"
    " origin, scenario, seed, software, state, recorder_id, created_ns,"
    " samples, truth_samples, first_stamp_ns, last_stamp_ns, signals,"
    " intake_accepted, intake_repeat, intake_late, intake_superseded,"
    " intake_bad_quality, intake_not_finite, intake_range, intake_unit,"
    " intake_period,"
    " (SELECT ifnull(sum(length(bytes)), 0) FROM chunk"
    "   WHERE chunk.run_id = run.run_id) +"
    " (SELECT ifnull(sum(length(bytes)), 0) FROM tail"
    "   WHERE tail.run_id = run.run_id)"
    " FROM run";

template <typename Enum, typename NameOf>
Enum ParseName(const std::string& text, NameOf name_of) {
  for (int i = 0; i < 3; ++i) {
    if (name_of(static_cast<Enum>(i)) == text) {
      return static_cast<Enum>(i);
    }
  }
  throw DataError("runs.db: unknown name " + text);
}

void ApplyLabels(StoredRun& run) {
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

}  // namespace

/// Seconds from the start as ns UTC; what is beyond the numbers is the end.
std::int64_t StampAt(const RunInfo& info, double t_s) {
  constexpr auto kEarliest = std::numeric_limits<std::int64_t>::min();
  constexpr auto kLatest = std::numeric_limits<std::int64_t>::max();
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

std::vector<RunInfo> RunReader::List(const RunFilter& filter) {
  const Snapshot snapshot(database_);
  Statement rows = database_.Prepare(
      std::string(kSelectRun) +
      " WHERE valve_id GLOB ? AND start_ns >= ? AND start_ns <= ?"
      " AND (?4 IS NULL OR origin = ?4) ORDER BY start_ns, run_id");
  rows.Bind(filter.valve_glob, filter.since_ns, filter.until_ns,
            filter.origin ? std::optional(RunOriginName(*filter.origin))
                          : std::nullopt);
  std::vector<RunInfo> infos;
  while (rows.Step()) {
    infos.push_back(Read(rows).info);
  }
  return infos;
}

FoundRun RunReader::Find(const RunSelector& selector) {
  Statement rows = database_.Prepare(std::string(kSelectRun) +
                                     " WHERE id >= ?1 AND id < ?1 || 'g'"
                                     " ORDER BY id LIMIT 2");
  if (!rows.Bind(selector.id).Step()) {
    throw NotFoundError("there is no run " + selector.id + " in " +
                        database_.path().string());
  }
  FoundRun found = Read(rows);
  if (rows.Step()) {
    throw NotFoundError("run " + selector.id + " is ambiguous: " +
                        found.info.id + ", " + rows.Text(1) + ", ...");
  }
  return found;
}

StoredRun RunReader::Load(std::string_view text) {
  StoredRun run;
  run.selector = ParseRunSelector(text);
  const Snapshot snapshot(database_);
  const FoundRun found = Find(run.selector);
  run.info = found.info;
  const std::int64_t from = StampAt(run.info, run.selector.from_s);
  const std::int64_t to = StampAt(run.info, run.selector.to_s);
  for (const std::string_view table : {"chunk", "tail"}) {
    LoadTable(table, found.run_id, from, to, run);
  }
  if (run.samples.empty()) {
    throw NotFoundError("run " + std::string(text) + " holds no sample (of " +
                        std::to_string(run.info.samples) + ")");
  }
  ApplyLabels(run);
  return run;
}

FoundRun RunReader::Read(const Statement& row) {
  FoundRun found;
  found.run_id = row.Int64(0);
  RunInfo& info = found.info;
  info.id = row.Text(1);
  info.run.valve_id = row.Text(2);
  info.run.source_id = row.Uint64(3);
  info.run.start_ns = row.Int64(4);
  info.run.period_s = row.Double(5);
  info.run.flow_unit =
      ParseFlowUnit(row.Text(6)).value_or(FlowUnit::kM3PerHour);
  info.run.origin = ParseName<RunOrigin>(row.Text(7), RunOriginName);
  info.run.scenario = row.Text(8);
  if (!row.IsNull(9)) {
    info.run.seed = row.Uint64(9);
  }
  info.run.software = row.Text(10);
  info.state = ParseName<RunState>(row.Text(11), RunStateName);
  if (info.state == RunState::kRecording &&
      !RecorderLiveness::IsAlive(database_.path(), row.Int64(12))) {
    info.state = RunState::kInterrupted;  // not yet noted in the file
  }
  info.created_ns = row.Int64(13);
  info.samples = row.Int64(14);
  info.has_truth = info.samples > 0 && row.Int64(15) == info.samples;
  info.first_stamp_ns = row.Int64(16);
  info.last_stamp_ns = row.Int64(17);
  info.signals = static_cast<SignalMask>(row.Int64(18));
  for (int i = 0; i < kIntakeCount; ++i) {
    info.intake[static_cast<std::size_t>(i)] = row.Int64(19 + i);
  }
  info.stored_bytes = row.Int64(19 + kIntakeCount);
  ReadLabels(found);
  return found;
}

void RunReader::ReadLabels(FoundRun& found) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Statement rows = database_.Prepare(
      "SELECT from_s, to_s, fault, strength FROM run_label"
      " WHERE run_id = ? ORDER BY label_id");
  rows.Bind(found.run_id);
  while (rows.Step()) {
    found.info.labels.push_back({rows.OptionalDouble(0).value_or(-kInfinity),
                                 rows.OptionalDouble(1).value_or(kInfinity),
                                 rows.Int(2), rows.Double(3)});
  }
}

void RunReader::LoadTable(std::string_view table, std::int64_t run_id,
                          std::int64_t from, std::int64_t to, StoredRun& run) {
  Statement rows = database_.Prepare(
      "SELECT count, codec, crc, bytes, first FROM " + std::string(table) +
      " WHERE run_id = ? AND t1_ns >= ? AND t0_ns <= ? ORDER BY first");
  rows.Bind(run_id, from, to);
  while (rows.Step()) {
    const std::string where = database_.path().string() + ": run " +
                              run.info.id + ", " + std::string(table) +
                              " of sample " + rows.Text(4);
    for (StoredSample& sample : DecodeChunk(ChunkOf(rows, 0), where)) {
      const std::int64_t stamp = sample.sample.stamp_ns;
      if (stamp >= from && (stamp < to || !run.selector.IsStretch())) {
        run.samples.push_back(std::move(sample));
      }
    }
  }
}

}  // namespace fdi::storage
