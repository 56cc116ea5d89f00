#include "storage/retention.h"

#include <algorithm>
#include <limits>
#include <thread>
#include <unordered_set>
#include <vector>

#include "storage/history_schema.h"
#include "storage/runs.h"

namespace fdi::storage {
namespace {

constexpr std::int64_t kEver = std::numeric_limits<std::int64_t>::max();

/// One kind of item that can be deleted.
struct Items {
  const Schema& schema;
  /// Row id, first stamp and stored bytes of what is not protected; first stamp
  /// from ?1 on, ended before ?2, the oldest ?3.
  const char* candidates;
  const char* erase;
  const char* count;  ///< All there are.
  const char* count_free;
  int batch;
};

const Items& Runs() {
  static const Items items{
      RunsSchema(),
      "SELECT run_id, start_ns, (SELECT coalesce(sum(length(bytes)), 0) FROM "
      "chunk c WHERE c.run_id = r.run_id) FROM run r WHERE start_ns >= ?1 AND "
      "max(created_ns, coalesce(last_stamp_ns, 0)) < ?2 AND "
      "state <> 'recording' AND origin = 'recorded' AND NOT EXISTS (SELECT 1 "
      "FROM run_label l WHERE l.run_id = r.run_id) ORDER BY start_ns LIMIT ?3",
      "DELETE FROM run WHERE run_id = ?",
      "SELECT count(*) FROM run",
      "SELECT count(*) FROM run r WHERE state <> 'recording' AND "
      "origin = 'recorded' AND NOT EXISTS (SELECT 1 FROM run_label l WHERE "
      "l.run_id = r.run_id)",
      1};
  return items;
}

const Items& Episodes() {
  static const Items items{
      HistorySchema(),
      "SELECT rowid, detected_ns, (SELECT coalesce(sum(length(samples) + "
      "length(vectors)), 0) FROM episode_trace t WHERE t.episode_id = "
      "e.episode_id) FROM episode e WHERE detected_ns >= ?1 AND ended_ns < ?2 "
      "AND acked_by IS NOT NULL AND label IS NULL AND NOT EXISTS (SELECT 1 "
      "FROM event_outbox JOIN episode_event v USING (event_id) WHERE "
      "v.episode_id = e.episode_id) ORDER BY detected_ns LIMIT ?3",
      "DELETE FROM episode WHERE rowid = ?",
      "SELECT count(*) FROM episode",
      "SELECT count(*) FROM episode e WHERE ended_ns IS NOT NULL AND "
      "acked_by IS NOT NULL AND label IS NULL AND NOT EXISTS (SELECT 1 FROM "
      "event_outbox JOIN episode_event v USING (event_id) WHERE "
      "v.episode_id = e.episode_id)",
      20};
  return items;
}

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
  std::int64_t Count(const char* sql) {
    return database_.QueryInt64(sql).value_or(0);
  }
  bool TooLarge() const {
    return limits_.max_bytes && result_.bytes_after > *limits_.max_bytes;
  }

  std::vector<Candidate> Candidates(std::int64_t from_ns,
                                    std::int64_t before_ns,
                                    std::int64_t limit) {
    std::vector<Candidate> found;
    candidates_.Bind(from_ns, before_ns, limit);
    while (candidates_.Step()) {
      found.push_back(
          {candidates_.Int64(0), candidates_.Int64(1), candidates_.Uint64(2)});
    }
    candidates_.Reset();
    return found;
  }

  void Note(const Candidate& item) {
    ++result_.deleted;
    result_.from_ns = std::min(result_.from_ns.value_or(kEver), item.stamp_ns);
    result_.to_ns =
        std::max(result_.to_ns.value_or(item.stamp_ns), item.stamp_ns);
  }

  void Plan() {
    const Snapshot snapshot(database_);
    result_.kept = Count(items_.count) - Count(items_.count_free);
    const auto all = Candidates(-kEver, kEver, -1);
    const auto old = Candidates(-kEver, limits_.before_ns.value_or(-kEver), -1);
    std::unordered_set<std::int64_t> dropped;
    const auto drop = [this, &dropped](const Candidate& item) {
      Note(item);
      dropped.insert(item.row);
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
    result_.kept = Count(items_.count) - Count(items_.count_free);
  }

  template <typename Condition>
  void DeleteWhile(std::int64_t before_ns, Condition more) {
    std::int64_t from_ns = -kEver;
    while (more()) {
      Transaction transaction(database_);
      const auto batch = Candidates(from_ns, before_ns, items_.batch);
      if (batch.empty()) {
        return;
      }
      for (const Candidate& item : batch) {
        database_.Run(items_.erase, item.row);
        Note(item);
      }
      transaction.Commit();
      from_ns = batch.back().stamp_ns;
      result_.bytes_after = database_.UsedBytes();
      std::this_thread::sleep_for(limits_.pause);
    }
  }

  const Items& items_;
  RetentionLimits limits_;
  Database database_;
  Statement candidates_;
  PruneResult result_;
};

}  // namespace

PruneResult PruneRuns(const std::filesystem::path& path,
                      const RetentionLimits& limits) {
  return Pruner(path, Runs(), limits).Run();
}

PruneResult PruneHistory(const std::filesystem::path& path,
                         const RetentionLimits& limits) {
  return Pruner(path, Episodes(), limits).Run();
}

}  // namespace fdi::storage
