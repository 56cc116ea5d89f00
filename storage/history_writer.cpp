#include "storage/history_writer.h"

#include <utility>

#include "diagnosis/error.h"
#include "storage/health_rows.h"
#include "storage/history_event_rows.h"
#include "storage/history_recovery.h"
#include "storage/history_schema.h"
#include "storage/history_trace_writer.h"

namespace fdi::storage {
namespace {

constexpr std::int64_t kAliveEveryNs = 10'000'000'000;

}  // namespace

class HistoryWriter::Impl {
 public:
  explicit Impl(const std::filesystem::path& path)
      : database_(path, HistorySchema(), Access::kWriter) {}

  SessionStart BeginSession(std::int64_t now_ns, const std::string& software,
                            const std::string& config);
  void EndSession(std::int64_t now_ns, bool clean);
  void Together(const std::function<void()>& records);
  std::optional<std::int64_t> Record(const NewEvent& event);
  void Resume(std::uint64_t episode_id, std::int64_t stamp_ns,
              std::int64_t now_ns);
  std::optional<std::int64_t> Close(std::uint64_t episode_id,
                                    std::int64_t stamp_ns, EndReason reason,
                                    std::int64_t now_ns);
  HistoryTraceWriter& traces() { return traces_; }
  void AddGap(const DataGap& gap) { gaps_.push_back(gap); }
  void MarkSent(std::int64_t event_id) { sent_.push_back(event_id); }
  void Commit(std::int64_t now_ns);
  bool HasPending() const;
  Database& database() { return database_; }

 private:
  // What is pending and `work` in one transaction.
  template <typename Work>
  void Write(Work&& work);
  void StorePending();
  // Forgets what is in the file now.
  void Settle();

  Database database_;
  StatementCache cached_{database_};
  HistoryEventRows rows_{database_, cached_};
  HistoryTraceWriter traces_{database_, cached_};
  std::optional<std::int64_t> session_id_;
  std::int64_t alive_ns_{0};
  std::vector<DataGap> gaps_;
  std::vector<std::int64_t> sent_;
  bool together_{false};  // Within Together().
  bool failed_{false};    // The last transaction did.
};

template <typename Work>
void HistoryWriter::Impl::Write(Work&& work) {
  failed_ = true;
  Transaction transaction(database_);
  StorePending();
  work();
  transaction.Commit();
  failed_ = false;
  Settle();
}

SessionStart HistoryWriter::Impl::BeginSession(std::int64_t now_ns,
                                               const std::string& software,
                                               const std::string& config) {
  SessionStart start;
  Transaction transaction(database_);
  start.died_ns = database_.QueryInt64(
      "SELECT max(alive_ns) FROM monitor_session WHERE stop_ns IS NULL");
  database_.Run(
      "UPDATE monitor_session SET stop_ns = alive_ns, clean = 0 "
      "WHERE stop_ns IS NULL");
  database_.Run(
      "INSERT INTO monitor_session (start_ns, alive_ns, software, config) "
      "VALUES (?, ?, ?, ?)",
      now_ns, now_ns, software, config);
  start.session_id = database_.LastInsertRowid();
  transaction.Commit();
  session_id_ = start.session_id;
  alive_ns_ = now_ns;
  return start;
}

void HistoryWriter::Impl::EndSession(std::int64_t now_ns, bool clean) {
  traces_.EndAll();
  Write([&] {
    database_.Run(
        "UPDATE monitor_session SET alive_ns = ?, stop_ns = ?, clean = ? "
        "WHERE session_id = ?",
        now_ns, now_ns, clean, session_id_);
  });
  session_id_.reset();
  database_.Checkpoint();
}

void HistoryWriter::Impl::Together(const std::function<void()>& records) {
  if (together_) {
    records();
    return;
  }
  together_ = true;
  try {
    Write(records);
  } catch (...) {
    together_ = false;
    throw;
  }
  together_ = false;
}

std::optional<std::int64_t> HistoryWriter::Impl::Record(const NewEvent& event) {
  Require(event.models != nullptr, "HistoryWriter::Record: models is null");
  Require(!event.valve_id.empty(), "HistoryWriter::Record: no valve");
  std::optional<std::int64_t> event_id;
  Together([&] { event_id = rows_.Add(event, session_id_); });
  const Transition& t = event.transition;
  if (t.kind == TransitionKind::kIsolated ||
      t.kind == TransitionKind::kReisolated) {
    traces_.SetIsolated(EpisodeIdOf(event), t.faults);
  }
  return event_id;
}

void HistoryWriter::Impl::Resume(std::uint64_t episode_id,
                                 std::int64_t stamp_ns, std::int64_t now_ns) {
  Together([&] { rows_.Resume(episode_id, stamp_ns, now_ns); });
}

std::optional<std::int64_t> HistoryWriter::Impl::Close(std::uint64_t episode_id,
                                                       std::int64_t stamp_ns,
                                                       EndReason reason,
                                                       std::int64_t now_ns) {
  std::optional<std::int64_t> event_id;
  traces_.End(episode_id);
  Together(
      [&] { event_id = rows_.Close(episode_id, stamp_ns, reason, now_ns); });
  return event_id;
}

void HistoryWriter::Impl::StorePending() {
  traces_.Store();
  for (const DataGap& gap : gaps_) {
    const auto valve = gap.valve_id.empty()
                           ? std::nullopt
                           : std::optional<std::string>(gap.valve_id);
    cached_(
        "INSERT OR IGNORE INTO data_gap (valve_id, from_ns, to_ns, reason, "
        "session_id) VALUES (?, ?, ?, ?, ?)")
        .Bind(valve, gap.from_ns, gap.to_ns, gap.reason, session_id_)
        .Run();
  }
  for (const std::int64_t event_id : sent_) {
    cached_("DELETE FROM event_outbox WHERE event_id = ?").Bind(event_id).Run();
  }
}

void HistoryWriter::Impl::Settle() {
  gaps_.clear();
  sent_.clear();
  traces_.Settle();
}

bool HistoryWriter::Impl::HasPending() const {
  return !gaps_.empty() || !sent_.empty() || traces_.HasPending();
}

void HistoryWriter::Impl::Commit(std::int64_t now_ns) {
  const bool alive = session_id_ && now_ns - alive_ns_ >= kAliveEveryNs;
  if (!HasPending() && !alive && !failed_) {
    return;
  }
  Write([&] {
    if (session_id_) {
      cached_("UPDATE monitor_session SET alive_ns = ? WHERE session_id = ?")
          .Bind(now_ns, session_id_)
          .Run();
    }
  });
  alive_ns_ = now_ns;
}

HistoryWriter::HistoryWriter(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {}

HistoryWriter::~HistoryWriter() = default;

SessionStart HistoryWriter::BeginSession(std::int64_t now_ns,
                                         const std::string& software,
                                         const std::string& config) {
  return impl_->BeginSession(now_ns, software, config);
}

void HistoryWriter::EndSession(std::int64_t now_ns, bool clean) {
  impl_->EndSession(now_ns, clean);
}

void HistoryWriter::Together(const std::function<void()>& records) {
  impl_->Together(records);
}

std::optional<std::int64_t> HistoryWriter::Record(const NewEvent& event) {
  return impl_->Record(event);
}

void HistoryWriter::Resume(std::uint64_t episode_id, std::int64_t stamp_ns,
                           std::int64_t now_ns) {
  impl_->Resume(episode_id, stamp_ns, now_ns);
}

std::optional<std::int64_t> HistoryWriter::Close(std::uint64_t episode_id,
                                                 std::int64_t stamp_ns,
                                                 EndReason reason,
                                                 std::int64_t now_ns) {
  return impl_->Close(episode_id, stamp_ns, reason, now_ns);
}

bool HistoryWriter::AppendTrace(std::uint64_t episode_id,
                                std::span<const TraceInstant> instants) {
  return impl_->traces().Append(episode_id, instants);
}

void HistoryWriter::EndTrace(std::uint64_t episode_id) {
  impl_->traces().End(episode_id);
}

void HistoryWriter::Keep(std::span<const CoverageCount> counts,
                         std::span<const StoredAccumulator> accumulators,
                         std::span<const HealthHour> health) {
  impl_->Together([&] {
    StoreCoverage(impl_->database(), counts);
    StoreAccumulators(impl_->database(), accumulators);
    StoreHealth(impl_->database(), health);
  });
}

std::vector<StoredAccumulator> HistoryWriter::Accumulators() {
  return ReadAccumulators(impl_->database());
}

void HistoryWriter::AddGap(const DataGap& gap) {
  impl_->AddGap(gap);
}

void HistoryWriter::MarkSent(std::int64_t event_id) {
  impl_->MarkSent(event_id);
}

void HistoryWriter::Commit(std::int64_t now_ns) {
  impl_->Commit(now_ns);
}

bool HistoryWriter::HasPending() const {
  return impl_->HasPending();
}

std::vector<UnsentEvent> HistoryWriter::UnsentEvents() {
  return ReadUnsentEvents(impl_->database());
}

std::vector<Episode> HistoryWriter::OpenEpisodes() {
  return ReadOpenEpisodes(impl_->database());
}

Database& HistoryWriter::database() {
  return impl_->database();
}

}  // namespace fdi::storage
