#include "storage/runs/run_rows.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <random>

#include <fcntl.h>
#include <unistd.h>

#include "base/error.h"
#include "base/time_text.h"
#include "storage/database/record.h"
#include "storage/runs/sql.h"

namespace fdi::storage {
namespace sql = runs_sql;
namespace {

// Locks of the open file description, not of the process: two recorders in one
// process exclude each other, and closing another descriptor releases nothing.
struct flock ByteLock(std::int64_t id) {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  lock.l_start = id;
  lock.l_len = 1;
  return lock;
}

bool IsLocked(int file, std::int64_t id) {
  struct flock lock = ByteLock(id);
  return fcntl(file, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

std::string LivePath(const std::filesystem::path& database) {
  return database.string() + ".live";
}

void InsertPacked(Statement& statement, std::int64_t run_id, std::int64_t first,
                  std::span<const StoredSample> samples, ChunkCodec codec,
                  ChunkHints* hints) {
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

RecorderLiveness::RecorderLiveness(const std::filesystem::path& database)
    : path_(LivePath(database)),
      file_(open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
  if (file_ < 0) {
    throw DataError(path_.string() +
                    " cannot be opened: " + std::strerror(errno));
  }
}

RecorderLiveness::~RecorderLiveness() {
  close(file_);
}

void RecorderLiveness::Claim(std::int64_t id) {
  struct flock lock = ByteLock(id);
  if (fcntl(file_, F_OFD_SETLK, &lock) != 0) {
    throw DataError(path_.string() +
                    " cannot be locked: " + std::strerror(errno));
  }
}

bool RecorderLiveness::IsAlive(std::int64_t id) const {
  return IsLocked(file_, id);
}

bool RecorderLiveness::IsAlive(const std::filesystem::path& database,
                               std::int64_t id) {
  const int file =
      open(LivePath(database).c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    return false;
  }
  const bool alive = IsLocked(file, id);
  close(file);
  return alive;
}

std::vector<std::int64_t> RecorderLiveness::Alive(
    const std::filesystem::path& database) {
  std::vector<std::int64_t> ids;
  const int file =
      open(LivePath(database).c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct flock lock = ByteLock(0);
  while (file >= 0) {
    lock.l_type = F_WRLCK;
    lock.l_len = 0;  // To the end: the first one that is locked.
    lock.l_pid = 0;
    if (fcntl(file, F_OFD_GETLK, &lock) != 0 || lock.l_type == F_UNLCK) {
      close(file);
      break;
    }
    ids.push_back(lock.l_start);
    lock.l_start += 1;
  }
  return ids;
}

std::string NewRunId() {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::random_device random;
  std::string id;
  for (int i = 0; i < 12; ++i) {
    id += kDigits[random() % 16];
  }
  return id;
}

void RunCounters::Count(const StoredSample& stored) {
  ++samples;
  truth_samples += stored.truth ? 1 : 0;
  first_stamp_ns = std::min(first_stamp_ns, stored.sample.stamp_ns);
  last_stamp_ns = std::max(last_stamp_ns, stored.sample.stamp_ns);
  signals = static_cast<SignalMask>(signals | stored.sample.present);
  ++intake[static_cast<std::size_t>(stored.intake)];
}

std::int64_t InsertRun(Database& database, const std::string& id,
                       const NewRun& run,
                       std::optional<std::int64_t> recorder) {
  database.Cached(sql::insert_run)
      .Bind(id, run.valve_id, run.source_id, run.start_ns, run.period_s,
            run.flow_unit, RunOriginName(run.origin), run.scenario, run.seed,
            run.software,
            RunStateName(recorder ? RunState::kRecording : RunState::kComplete),
            recorder, NowNs())
      .Run();
  return database.LastInsertRowid();
}

void AddCounters(Database& database, std::int64_t run_id,
                 const RunCounters& c) {
  const auto& n = c.intake;
  static_assert(kIntakeCount == 9, "the columns intake_* are nine");
  database.Cached(sql::add_counters)
      .Bind(run_id, c.samples, c.truth_samples, c.first_stamp_ns,
            c.last_stamp_ns, c.signals, n[0], n[1], n[2], n[3], n[4], n[5],
            n[6], n[7], n[8])
      .Run();
}

void SetState(Database& database, std::int64_t run_id, RunState state) {
  database.Cached(sql::set_state).Bind(RunStateName(state), run_id).Run();
}

void InsertTail(Database& database, std::int64_t run_id, std::int64_t first,
                std::span<const StoredSample> samples) {
  InsertPacked(database.Cached(sql::insert_tail), run_id, first, samples,
               ChunkCodec::kPlain, nullptr);
}

void InsertChunk(Database& database, std::int64_t run_id, std::int64_t first,
                 std::span<const StoredSample> samples, ChunkHints* hints) {
  InsertPacked(database.Cached(sql::insert_chunk), run_id, first, samples,
               ChunkCodec::kColumns, hints);
}

void InsertChunks(Database& database, std::int64_t run_id, std::int64_t first,
                  std::span<const StoredSample> samples,
                  std::size_t chunk_samples) {
  ChunkHints hints;
  while (!samples.empty()) {
    const auto part = samples.first(std::min(chunk_samples, samples.size()));
    InsertChunk(database, run_id, first, part, &hints);
    first += static_cast<std::int64_t>(part.size());
    samples = samples.subspan(part.size());
  }
}

// The cached statement outlives this call, so it is reset on every way out:
// left open, it would keep a read transaction.
std::vector<StoredSample> TakeTail(Database& database, std::int64_t run_id) {
  std::vector<StoredSample> samples;
  Statement& rows = database.Cached(sql::tail_of_run);
  rows.Bind(run_id);
  try {
    while (rows.Step()) {
      const auto part =
          ReadBundle(rows, database.path().string() + ": tail row of sample ");
      samples.insert(samples.end(), part.begin(), part.end());
    }
  } catch (...) {
    rows.Reset();
    throw;
  }
  rows.Reset();
  database.Cached(sql::delete_tail).Bind(run_id).Run();
  return samples;
}

std::vector<StoredSample> ReadBundle(const Statement& row,
                                     const std::string& where) {
  Chunk chunk;
  std::string first;
  row.Read(0, chunk.count, chunk.codec, chunk.crc, chunk.bytes, first);
  return DecodeChunk(chunk, where + first);
}

}  // namespace fdi::storage
