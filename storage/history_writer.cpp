#include "storage/history_writer.h"

#include <cmath>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/history_recovery.h"
#include "storage/history_rows.h"
#include "storage/history_schema.h"
#include "storage/history_trace_writer.h"

namespace fdi::storage {
namespace {

constexpr std::int64_t kAliveEveryNs = 10'000'000'000;

/// A transition on its way into the tables.
struct Entry {
  std::uint64_t episode_id{0};
  Transition transition;
  std::int64_t recorded_ns{0};
  std::vector<std::string> names;  ///< Of the faults, by bit.
};

double Finite(double value) {
  return std::isfinite(value) ? value : 0.0;
}

bool IsIsolation(TransitionKind kind) {
  return kind == TransitionKind::kIsolated ||
         kind == TransitionKind::kReisolated;
}

std::vector<std::string> FaultNames(const ModelSet& models) {
  std::vector<std::string> names;
  for (const int fault : models.faults) {
    names.push_back(FaultName(fault));
  }
  return names;
}

std::vector<std::string> ChannelNames(const ModelSet& models) {
  std::vector<std::string> names;
  for (const ChannelSpec& channel : models.channels) {
    names.push_back(channel.name);
  }
  return names;
}

}  // namespace

class HistoryWriter::Impl {
 public:
  explicit Impl(const std::filesystem::path& path)
      : database_(path, HistorySchema(), Access::kWriter) {}

  SessionStart BeginSession(std::int64_t now_ns, const std::string& software,
                            const std::string& config);
  void EndSession(std::int64_t now_ns, bool clean);
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
  std::optional<std::int64_t> Store(const Entry& entry);
  void StoreIsolation(const Entry& entry, const std::string& id);
  void StoreUnknown(const Transition& t, const std::string& id);
  void InsertEpisode(const NewEvent& event, std::uint64_t episode_id);
  void RequireEpisode(std::uint64_t episode_id);
  void StorePending();
  // Forgets what is in the file now.
  void Settle();

  Database database_;
  StatementCache cached_{database_};
  HistoryTraceWriter traces_{database_, cached_};
  std::optional<std::int64_t> session_id_;
  std::int64_t alive_ns_{0};
  std::vector<DataGap> gaps_;
  std::vector<std::int64_t> sent_;
};

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
  Transaction transaction(database_);
  StorePending();
  database_.Run(
      "UPDATE monitor_session SET alive_ns = ?, stop_ns = ?, clean = ? "
      "WHERE session_id = ?",
      now_ns, now_ns, clean, session_id_);
  transaction.Commit();
  Settle();
  session_id_.reset();
  database_.Checkpoint();
}

void HistoryWriter::Impl::InsertEpisode(const NewEvent& event,
                                        std::uint64_t episode_id) {
  const ModelSet& models = *event.models;
  cached_(
      "INSERT INTO episode (episode_id, session_id, valve_id, source_id, "
      "detected_ns, peak_factor, strength, model_set, model_hash, flow_unit, "
      "channels, faults) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) "
      "ON CONFLICT (episode_id) DO NOTHING")
      .Bind(EpisodeIdText(episode_id), session_id_, event.valve_id,
            event.source_id, event.transition.detection_stamp_ns,
            Finite(event.transition.factor), Finite(event.transition.strength),
            models.name + "@" + std::to_string(models.version),
            models.content_hash, FlowUnitName(models.flow_unit),
            JoinNames(ChannelNames(models)), JoinNames(FaultNames(models)))
      .Run();
}

std::optional<std::int64_t> HistoryWriter::Impl::Record(const NewEvent& event) {
  Require(event.models != nullptr, "HistoryWriter::Record: models is null");
  Require(!event.valve_id.empty(), "HistoryWriter::Record: no valve");
  const Entry entry{EpisodeIdOf(event), event.transition, event.recorded_ns,
                    FaultNames(*event.models)};
  Transaction transaction(database_);
  StorePending();
  InsertEpisode(event, entry.episode_id);
  const auto event_id = Store(entry);
  transaction.Commit();
  Settle();
  if (IsIsolation(entry.transition.kind)) {
    traces_.SetIsolated(entry.episode_id, entry.transition.faults);
  }
  return event_id;
}

std::optional<std::int64_t> HistoryWriter::Impl::Store(const Entry& entry) {
  const Transition& t = entry.transition;
  const std::string id = EpisodeIdText(entry.episode_id);
  const std::string faults = NamesOf(t.faults, entry.names);
  const auto text = [](const std::string& s) {
    return s.empty() ? std::nullopt : std::optional<std::string>(s);
  };
  const bool closed = t.kind == TransitionKind::kClosed;
  cached_(
      "INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns, "
      "faults, fault_bits, factor, strength, reason) "
      "SELECT episode_id, ?, ?, ?, ?, ?, ?, ?, ? FROM episode "
      "WHERE episode_id = ? AND ended_ns IS NULL "
      "ON CONFLICT (episode_id, kind, stamp_ns) DO NOTHING")
      .Bind(TransitionName(t.kind), t.stamp_ns, entry.recorded_ns, text(faults),
            t.faults, t.factor, t.strength,
            text(closed ? std::string(EndReasonName(t.reason)) : ""), id)
      .Run();
  if (database_.Changes() == 0) {
    return std::nullopt;
  }
  const std::int64_t event_id = database_.LastInsertRowid();
  cached_("INSERT INTO event_outbox (event_id) VALUES (?)")
      .Bind(event_id)
      .Run();
  StoreUnknown(t, id);
  if (IsIsolation(t.kind)) {
    StoreIsolation(entry, id);
  } else if (t.kind == TransitionKind::kCleared) {
    cached_("UPDATE episode SET cleared_ns = ? WHERE episode_id = ?")
        .Bind(t.stamp_ns, id)
        .Run();
  } else if (closed) {
    const bool cleared = t.reason == EndReason::kCleared;
    cached_(
        "UPDATE episode SET ended_ns = ?, end_reason = ?, "
        "cleared_ns = coalesce(cleared_ns, ?) WHERE episode_id = ?")
        .Bind(t.stamp_ns, EndReasonName(t.reason),
              cleared ? std::optional(t.stamp_ns) : std::nullopt, id)
        .Run();
  }
  return event_id;
}

// Why there is no name; none of an episode that got one.
void HistoryWriter::Impl::StoreUnknown(const Transition& t,
                                       const std::string& id) {
  if (t.unknown == Unknown::kNone && !IsIsolation(t.kind)) {
    return;
  }
  const auto kind = t.unknown == Unknown::kNone
                        ? std::nullopt
                        : std::optional<std::string>(UnknownName(t.unknown));
  cached_("UPDATE episode SET unknown_kind = ? WHERE episode_id = ?")
      .Bind(kind, id)
      .Run();
}

void HistoryWriter::Impl::StoreIsolation(const Entry& entry,
                                         const std::string& id) {
  const Transition& t = entry.transition;
  cached_(
      "UPDATE episode SET isolated_ns = coalesce(isolated_ns, ?), "
      "fault_bits = ?, peak_factor = ?, strength = ? WHERE episode_id = ?")
      .Bind(t.stamp_ns, t.faults, Finite(t.factor), Finite(t.strength), id)
      .Run();
  cached_("UPDATE episode_fault SET held = 0 WHERE episode_id = ?")
      .Bind(id)
      .Run();
  for (std::size_t bit = 0; bit < entry.names.size(); ++bit) {
    if ((t.faults >> bit & 1U) != 0) {
      cached_(
          "INSERT INTO episode_fault (episode_id, fault, fault_bit, first_ns, "
          "held) VALUES (?, ?, ?, ?, 1) "
          "ON CONFLICT (episode_id, fault) DO UPDATE SET held = 1")
          .Bind(id, entry.names[bit], bit, t.stamp_ns)
          .Run();
    }
  }
}

void HistoryWriter::Impl::RequireEpisode(std::uint64_t episode_id) {
  const std::string id = EpisodeIdText(episode_id);
  if (!database_.QueryInt64("SELECT 1 FROM episode WHERE episode_id = ?", id)) {
    throw NotFoundError("no episode " + id);
  }
}

void HistoryWriter::Impl::Resume(std::uint64_t episode_id,
                                 std::int64_t stamp_ns, std::int64_t now_ns) {
  RequireEpisode(episode_id);
  Transaction transaction(database_);
  StorePending();
  cached_(
      "INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns) "
      "VALUES (?, 'RESUMED', ?, ?) "
      "ON CONFLICT (episode_id, kind, stamp_ns) DO NOTHING")
      .Bind(EpisodeIdText(episode_id), stamp_ns, now_ns)
      .Run();
  transaction.Commit();
  Settle();
}

std::optional<std::int64_t> HistoryWriter::Impl::Close(std::uint64_t episode_id,
                                                       std::int64_t stamp_ns,
                                                       EndReason reason,
                                                       std::int64_t now_ns) {
  Statement row = database_.Prepare(
      "SELECT detected_ns, fault_bits, peak_factor, strength, faults "
      "FROM episode WHERE episode_id = ?");
  if (!row.Bind(EpisodeIdText(episode_id)).Step()) {
    throw NotFoundError("no episode " + EpisodeIdText(episode_id));
  }
  Entry entry;
  entry.episode_id = episode_id;
  entry.recorded_ns = now_ns;
  entry.transition = {
      TransitionKind::kClosed, stamp_ns,      row.Int64(0), row.Uint64(1),
      row.Double(2),           row.Double(3), reason};
  entry.names = SplitNames(row.Text(4));
  row.Reset();
  traces_.End(episode_id);
  Transaction transaction(database_);
  StorePending();
  const auto event_id = Store(entry);
  transaction.Commit();
  Settle();
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
  if (!HasPending() && !alive) {
    return;
  }
  Transaction transaction(database_);
  StorePending();
  if (session_id_) {
    cached_("UPDATE monitor_session SET alive_ns = ? WHERE session_id = ?")
        .Bind(now_ns, session_id_)
        .Run();
  }
  transaction.Commit();
  alive_ns_ = now_ns;
  Settle();
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
                         std::span<const StoredAccumulator> accumulators) {
  Transaction transaction(impl_->database());
  StoreCoverage(impl_->database(), counts);
  StoreAccumulators(impl_->database(), accumulators);
  transaction.Commit();
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
