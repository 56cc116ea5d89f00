#include "storage/history/retention.h"

#include <algorithm>
#include <limits>
#include <thread>
#include <unordered_set>
#include <vector>

#include "base/time_text.h"
#include "base/time_units.h"
#include "storage/database/locks.h"
#include "storage/history/health.h"
#include "storage/history/history_database.h"
#include "storage/history/sql.h"
#include "storage/runs/runs.h"

namespace fdi::storage {
namespace sql = history_sql;
namespace {

constexpr std::int64_t kEver = std::numeric_limits<std::int64_t>::max();

/// One kind of deletable record.
struct Items {
  const Schema& schema;
  /// Row id, first stamp and stored bytes of unprotected records with a first
  /// stamp from ?1 on that ended before ?2; the oldest ?3 of them.
  std::string_view candidates;
  std::string_view erase;
  std::string_view count_protected;
  int batch;  ///< Deletions per transaction.
};

struct Candidate {
  std::int64_t row{0};
  std::int64_t stamp_ns{0};
  std::uintmax_t bytes{0};
};

class Pruner {
 public:
  Pruner(const std::filesystem::path& path, const Items& items,
         const RetentionLimits& limits)
      : items_(items),
        limits_(limits),
        database_(path, items.schema,
                  limits.dry_run ? Access::kReader : Access::kOccasionalWriter),
        candidates_(database_, items.candidates) {}

  PruneResult Run() {
    result_.bytes_before = database_.UsedBytes();
    result_.bytes_after = result_.bytes_before;
    limits_.dry_run ? Plan() : Delete();
    result_.fits =
        !limits_.max_bytes || result_.bytes_after <= *limits_.max_bytes;
    return result_;
  }

 private:
  bool TooLarge() const {
    return limits_.max_bytes && result_.bytes_after > *limits_.max_bytes;
  }

  std::vector<Candidate> Candidates(std::int64_t from_ns,
                                    std::int64_t before_ns,
                                    std::int64_t limit) {
    std::vector<Candidate> found;
    candidates_.Bind(from_ns, before_ns, limit);
    while (candidates_.Step()) {
      Candidate& item = found.emplace_back();
      candidates_.Read(0, item.row, item.stamp_ns, item.bytes);
    }
    candidates_.Reset();
    return found;
  }

  void CountDeleted(const Candidate& item) {
    ++result_.deleted;
    result_.from_ns = std::min(result_.from_ns.value_or(kEver), item.stamp_ns);
    result_.to_ns =
        std::max(result_.to_ns.value_or(item.stamp_ns), item.stamp_ns);
  }

  void Plan() {
    const Snapshot snapshot(database_);
    result_.kept = database_.QueryInt64(items_.count_protected).value_or(0);
    const auto all = Candidates(-kEver, kEver, -1);
    const auto old = Candidates(-kEver, limits_.before_ns.value_or(-kEver), -1);
    std::unordered_set<std::int64_t> dropped;
    const auto drop = [this, &dropped](const Candidate& item) {
      CountDeleted(item);
      dropped.insert(item.row);
      // This is an estimate: `bytes` has the packed samples or evidence, but
      // neither other columns nor indexes.
      result_.bytes_after -= std::min(result_.bytes_after, item.bytes);
    };
    std::for_each(old.begin(), old.end(), drop);
    for (const Candidate& item : all) {
      if (TooLarge() && !dropped.contains(item.row)) {
        drop(item);
      }
    }
  }

  void Delete() {
    if (limits_.before_ns) {
      DeleteWhile(*limits_.before_ns, [] { return true; });
    }
    DeleteWhile(kEver, [this] { return TooLarge(); });
    result_.kept = database_.QueryInt64(items_.count_protected).value_or(0);
  }

  template <typename Condition>
  void DeleteWhile(std::int64_t before_ns, Condition more) {
    std::int64_t from_ns = -kEver;
    while (more()) {
      // The query is inside the transaction, so that no candidate becomes
      // protected, e.g. by a label, before it is deleted.
      Transaction transaction(database_);
      const auto batch = Candidates(from_ns, before_ns, items_.batch);
      if (batch.empty()) {
        return;
      }
      for (const Candidate& item : batch) {
        database_.Run(items_.erase, item.row);
        CountDeleted(item);
      }
      transaction.Commit();
      // Earlier rows are deleted or protected: without this bound, each batch
      // would pass all protected rows again. The next candidate may have the
      // same stamp, which is therefore included.
      from_ns = batch.back().stamp_ns;
      result_.bytes_after = database_.UsedBytes();
      std::this_thread::sleep_for(limits_.pause);
    }
  }

  Items items_;
  RetentionLimits limits_;
  Database database_;
  Statement candidates_;
  PruneResult result_;
};

// Adds the hours older than `hour` to `result`. @returns the bytes of those
// that may go.
std::uintmax_t CountHealth(Database& database, const std::string& valve,
                           std::int64_t hour, PruneResult& result) {
  Statement row = database.Prepare(sql::old_health);
  row.Bind(valve, hour).Step();
  result.kept += row.Int64(4);
  if (row.Int64(0) == 0) {
    return 0;
  }
  result.deleted += row.Int64(0);
  const std::int64_t from_ns = row.Int64(1) * kNsPerHour;
  const std::int64_t to_ns = row.Int64(2) * kNsPerHour;
  result.from_ns = std::min(result.from_ns.value_or(from_ns), from_ns);
  result.to_ns = std::max(result.to_ns.value_or(to_ns), to_ns);
  return row.Uint64(3);
}

// Runs `prune` on the database. On a full disk, where nothing can be written,
// it works on a copy in the folder for temporary files, and what is left then
// replaces the contents of the file: it is smaller, so that it has room. The
// copy is complete until that is done.
template <typename Prune>
PruneResult PruneInPlaceOrCopy(const std::filesystem::path& path,
                               const Schema& schema, Prune prune) {
  try {
    return prune(path);
  } catch (const NoRoomError&) {
    const auto copy =
        std::filesystem::temp_directory_path() /
        (path.filename().string() + "." + std::to_string(NowNs()) + ".pruned");
    const std::filesystem::path packed = copy.string() + ".packed";
    WriteGate gate(path);
    const GateHolder holder(gate, path);
    Database(path, schema, Access::kReader).BackupTo(copy);
    const PruneResult result = prune(copy);
    Database(copy, schema, Access::kReader).BackupTo(packed);
    if (result.deleted > 0) {
      std::filesystem::copy_file(
          packed, path, std::filesystem::copy_options::overwrite_existing);
    }
    for (const auto& left :
         {packed, copy, std::filesystem::path(copy.string() + ".gate")}) {
      std::filesystem::remove(left);
    }
    return result;
  }
}

PruneResult PruneItems(const std::filesystem::path& path, const Items& items,
                       const RetentionLimits& limits) {
  return PruneInPlaceOrCopy(path, items.schema, [&](const auto& file) {
    return Pruner(file, items, limits).Run();
  });
}

PruneResult PruneHealthOf(const std::filesystem::path& path,
                          const RetentionLimits& limits) {
  Database database(
      path, HistorySchema(),
      limits.dry_run ? Access::kReader : Access::kOccasionalWriter);
  PruneResult result;
  result.bytes_before = database.UsedBytes();
  std::uintmax_t gone = 0;
  // Hour h lies between h and h + 1 hours since 1970: it has ended at the limit
  // t if h + 1 ≤ t, that is, if h < ⌊t⌋.
  const std::int64_t hour =
      limits.before_ns ? *limits.before_ns / kNsPerHour : 0;
  for (const std::string& valve : HealthValves(database, "*")) {
    const std::uintmax_t bytes = CountHealth(database, valve, hour, result);
    gone += bytes;
    if (bytes != 0 && !limits.dry_run) {
      Transaction transaction(database);
      database.Run(sql::delete_old_health, valve, hour);
      transaction.Commit();
      std::this_thread::sleep_for(limits.pause);
    }
  }
  result.bytes_after =
      limits.dry_run ? result.bytes_before - std::min(gone, result.bytes_before)
                     : database.UsedBytes();
  return result;
}

}  // namespace

PruneResult PruneRuns(const std::filesystem::path& path,
                      const RetentionLimits& limits) {
  // One run per transaction: its chunks, 144 for a day at 1 Hz, are deleted
  // with it, and the recorder waits meanwhile.
  return PruneItems(
      path,
      {RunsSchema(), sql::run_candidates, "DELETE FROM run WHERE run_id = ?",
       sql::protected_runs, 1},
      limits);
}

PruneResult PruneHistory(const std::filesystem::path& path,
                         const RetentionLimits& limits) {
  return PruneItems(
      path,
      {HistorySchema(), sql::episode_candidates,
       "DELETE FROM episode WHERE rowid = ?", sql::protected_episodes, 20},
      limits);
}

PruneResult PruneHealth(const std::filesystem::path& path,
                        const RetentionLimits& limits) {
  return PruneInPlaceOrCopy(path, HistorySchema(), [&](const auto& file) {
    return PruneHealthOf(file, limits);
  });
}

}  // namespace fdi::storage
