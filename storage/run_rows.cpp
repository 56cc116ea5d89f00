#include "storage/run_rows.h"

#include <algorithm>
#include <chrono>
#include <random>

namespace fdi::storage {
namespace {

constexpr std::string_view kInsertRun =
    "INSERT INTO run (id, valve_id, source_id, start_ns, period_s, flow_unit,"
    " origin, scenario, seed, software, state, recorder_id, created_ns)"
    " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)";

constexpr std::string_view kAddCounters =
    "UPDATE run SET samples = samples + ?2, truth_samples = truth_samples + ?3,"
    " first_stamp_ns = min(ifnull(first_stamp_ns, ?4), ?4),"
    " last_stamp_ns = max(ifnull(last_stamp_ns, ?5), ?5),"
    " signals = signals | ?6,"
    " intake_accepted = intake_accepted + ?7,"
    " intake_repeat = intake_repeat + ?8,"
    " intake_late = intake_late + ?9,"
    " intake_superseded = intake_superseded + ?10,"
    " intake_bad_quality = intake_bad_quality + ?11,"
    " intake_not_finite = intake_not_finite + ?12,"
    " intake_range = intake_range + ?13,"
    " intake_unit = intake_unit + ?14,"
    " intake_period = intake_period + ?15"
    " WHERE run_id = ?1";

constexpr std::string_view kInsertTail =
    "INSERT INTO tail (run_id, first, t0_ns, t1_ns, count, codec, crc, bytes)"
    " VALUES (?, ?, ?, ?, ?, ?, ?, ?)";

constexpr std::string_view kInsertChunk =
    "INSERT INTO chunk (run_id, first, t0_ns, t1_ns, count, codec, crc, bytes)"
    " VALUES (?, ?, ?, ?, ?, ?, ?, ?)";

void InsertPacked(Statement& statement, std::int64_t run_id, std::int64_t first,
                  std::span<const StoredSample> samples, ChunkCodec codec,
                  ChunkHints* hints = nullptr) {
  const auto [earliest, latest] =
      std::minmax_element(samples.begin(), samples.end(),
                          [](const StoredSample& a, const StoredSample& b) {
                            return a.sample.stamp_ns < b.sample.stamp_ns;
                          });
  const Chunk chunk = EncodeChunk(samples, codec, hints);
  statement
      .Bind(run_id, first, earliest->sample.stamp_ns, latest->sample.stamp_ns,
            chunk.count, chunk.codec, chunk.crc, chunk.bytes)
      .Run();
}

}  // namespace

std::string NewRunId() {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::random_device random;
  std::string id;
  for (int i = 0; i < 12; ++i) {
    id += kDigits[random() % 16];
  }
  return id;
}

std::int64_t UtcNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

void RunCounters::Count(const StoredSample& stored) {
  ++samples;
  truth_samples += stored.truth ? 1 : 0;
  first_stamp_ns = std::min(first_stamp_ns, stored.sample.stamp_ns);
  last_stamp_ns = std::max(last_stamp_ns, stored.sample.stamp_ns);
  signals = static_cast<SignalMask>(signals | stored.sample.present);
  ++intake[static_cast<std::size_t>(stored.intake)];
}

RunRows::RunRows(Database& database)
    : database_(database),
      insert_run_(database, kInsertRun),
      add_counters_(database, kAddCounters),
      set_state_(database,
                 "UPDATE run SET state = ?, recorder_id = NULL"
                 " WHERE run_id = ?"),
      insert_tail_(database, kInsertTail),
      insert_chunk_(database, kInsertChunk),
      select_tail_(database,
                   "SELECT count, codec, crc, bytes, first FROM tail"
                   " WHERE run_id = ? ORDER BY first"),
      delete_tail_(database, "DELETE FROM tail WHERE run_id = ?") {}

std::int64_t RunRows::InsertRun(const std::string& id, const NewRun& run,
                                std::optional<std::int64_t> recorder) {
  insert_run_
      .Bind(id, run.valve_id, run.source_id, run.start_ns, run.period_s,
            FlowUnitName(run.flow_unit), RunOriginName(run.origin),
            run.scenario, run.seed, run.software,
            RunStateName(recorder ? RunState::kRecording : RunState::kComplete),
            recorder, UtcNow())
      .Run();
  return database_.LastInsertRowid();
}

void RunRows::AddCounters(std::int64_t run_id, const RunCounters& c) {
  const auto& n = c.intake;
  add_counters_
      .Bind(run_id, c.samples, c.truth_samples, c.first_stamp_ns,
            c.last_stamp_ns, c.signals, n[0], n[1], n[2], n[3], n[4], n[5],
            n[6], n[7], n[8])
      .Run();
}

void RunRows::SetState(std::int64_t run_id, RunState state) {
  set_state_.Bind(RunStateName(state), run_id).Run();
}

void RunRows::InsertTail(std::int64_t run_id, std::int64_t first,
                         std::span<const StoredSample> samples) {
  InsertPacked(insert_tail_, run_id, first, samples, ChunkCodec::kPlain);
}

void RunRows::InsertChunk(std::int64_t run_id, std::int64_t first,
                          std::span<const StoredSample> samples,
                          ChunkHints* hints) {
  InsertPacked(insert_chunk_, run_id, first, samples, ChunkCodec::kColumns,
               hints);
}

std::vector<StoredSample> RunRows::TakeTail(std::int64_t run_id) {
  std::vector<StoredSample> samples;
  select_tail_.Bind(run_id);
  while (select_tail_.Step()) {
    const auto part = DecodeChunk(ChunkOf(select_tail_, 0),
                                  "tail row " + select_tail_.Text(4) + " of " +
                                      database_.path().string());
    samples.insert(samples.end(), part.begin(), part.end());
  }
  select_tail_.Reset();
  delete_tail_.Bind(run_id).Run();
  return samples;
}

void RunRows::InsertChunks(std::int64_t run_id, std::int64_t first,
                           std::span<const StoredSample> samples,
                           std::size_t chunk_samples) {
  ChunkHints hints;
  while (!samples.empty()) {
    const auto part = samples.first(std::min(chunk_samples, samples.size()));
    InsertChunk(run_id, first, part, &hints);
    first += static_cast<std::int64_t>(part.size());
    samples = samples.subspan(part.size());
  }
}

Chunk ChunkOf(const Statement& row, int column) {
  Chunk chunk;
  chunk.count = static_cast<std::uint32_t>(row.Int64(column));
  chunk.codec = static_cast<ChunkCodec>(row.Int64(column + 1));
  chunk.crc = static_cast<std::uint32_t>(row.Int64(column + 2));
  chunk.bytes = row.Blob(column + 3);
  return chunk;
}

}  // namespace fdi::storage
