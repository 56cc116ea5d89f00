#include "storage/history/history_writer.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <system_error>

#include "base/error.h"
#include "base/text.h"
#include "diagnosis/decision/certainty.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/database/record.h"
#include "storage/history/certainty.h"
#include "storage/history/episode.h"
#include "storage/history/health.h"
#include "storage/history/history_database.h"
#include "storage/history/sql.h"
#include "storage/history/strength.h"

namespace fdi::storage {

template <>
struct EnumText<TransitionKind> {
  static constexpr auto name = TransitionName;
  static constexpr auto last = TransitionKind::kRaised;
};

namespace sql = history_sql;
namespace {

// The gap that a crash leaves in the record begins at the last heartbeat, hence
// at most about this much too early.
constexpr std::int64_t kAliveEveryNs = 10'000'000'000;

// NaN would be bound as NULL, which the NOT NULL columns of an episode refuse.
double Finite(double value) {
  return std::isfinite(value) ? value : 0.0;
}

std::optional<Severity> ReadSeverity(const Statement& row, int column) {
  return row.IsNull(column) ? std::nullopt : SeverityOf(row.Int64(column));
}

EndReason ReasonOf(std::string_view name) {
  for (int r = 0; r < static_cast<int>(EndReason::kUnknown); ++r) {
    if (EndReasonName(static_cast<EndReason>(r)) == name) {
      return static_cast<EndReason>(r);
    }
  }
  return EndReason::kUnknown;
}

/// A transition on its way into the tables.
struct Entry {
  std::string id;
  Transition transition;
  std::int64_t recorded_ns{0};
  std::vector<std::string> names;  ///< Of the faults, by bit.

  std::string NamesOf(FaultSet faults) const {
    std::vector<std::string> named;
    for (std::size_t bit = 0; bit < names.size(); ++bit) {
      if (Has(faults, bit)) {
        named.push_back(names[bit]);
      }
    }
    return JoinText(named, "|");
  }

  std::string IsolatedNames() const { return NamesOf(transition.faults); }

  std::string Value() const {
    const SecondFault& second = transition.second;
    return transition.kind == TransitionKind::kSecond
               ? SecondValue(second, NamesOf(second.faults))
           : IsIsolation(transition.kind) ? DriftValue(transition.drift)
                                          : "";
  }
};

Entry InsertEpisode(Database& database, const FaultEvent& event,
                    std::optional<std::int64_t> session_id) {
  const ModelSet& models = *event.models;
  const Transition& t = event.transition;
  Entry entry{EpisodeIdText(event.episode_id), t, 0, {}};
  for (const int fault : models.faults) {
    entry.names.push_back(FaultName(fault));
  }
  std::vector<std::string> channels;
  for (const ChannelSpec& channel : models.channels) {
    channels.push_back(channel.name);
  }
  // Every transition offers the row of its episode, so that one whose DETECTED
  // was not stored has an episode, too; a row that exists stays as it is.
  database.Cached(sql::insert_episode)
      .Bind(entry.id, session_id, event.valve_id, event.source_id,
            t.detection_stamp_ns, Finite(t.factor), Finite(t.strength),
            models.name + "@" + std::to_string(models.version),
            models.content_hash, FlowUnitName(models.flow_unit),
            JoinText(channels, "|"), JoinText(entry.names, "|"),
            JoinText(KnownFaults(models.faults, models.observers), "|"),
            PriorityOf(t.severity))
      .Run();
  return entry;
}

// The end of an episode that no engine knows any more: its faults are those
// that were isolated last. @throws NotFoundError
Entry EndOfStored(Database& database, const FaultEvent& event) {
  Entry entry{EpisodeIdText(event.episode_id), event.transition, 0, {}};
  Statement row = database.Prepare(sql::faults_of_episode);
  if (!row.Bind(entry.id).Step()) {
    throw NotFoundError("no episode " + entry.id);
  }
  Transition& t = entry.transition;
  t.unknown = Unknown::kNone;
  row.Read(0, t.faults, t.factor, t.strength, t.detection_stamp_ns,
           entry.names);
  t.severity = ReadSeverity(row, 5);
  return entry;
}

void StoreIsolation(Database& database, const Entry& entry) {
  const Transition& t = entry.transition;
  const std::string names = entry.IsolatedNames();
  // The peak begins anew, because it is that of the set isolated last. Every
  // fault that was ever isolated keeps its row in episode_fault; only those
  // with held = 1 are in the present set.
  database.Cached(sql::set_isolated)
      .Bind(t.stamp_ns, names.empty() ? "unknown" : names, t.faults,
            Finite(t.factor), LayerName(t.layer), entry.id)
      .Run();
  database.Cached(sql::release_faults).Bind(entry.id).Run();
  for (std::size_t bit = 0; bit < entry.names.size(); ++bit) {
    if (Has(t.faults, bit)) {
      database.Cached(sql::hold_fault)
          .Bind(entry.names[bit], bit, t.stamp_ns, entry.id)
          .Run();
    }
  }
}

// "8:0.93:0.5:1", see event_outbox. Numbers are read back to the bit.
std::string CandidateText(const FaultCandidate& candidate) {
  const auto number = [](double value) {
    std::array<char, 32> text{};
    const auto end =
        std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    return std::string(text.data(), end);
  };
  return std::to_string(candidate.fault) + ":" + number(candidate.factor) +
         ":" + number(candidate.strength) + (candidate.isolated ? ":1" : ":0");
}

// @throws DataError
FaultCandidate ParseCandidate(const std::string& text) {
  FaultCandidate candidate;
  int isolated = 0;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto read = [&](auto& field) {
    const auto [next, error] = std::from_chars(at, end, field);
    at = next < end ? next + 1 : end;
    if (error != std::errc{}) {
      throw DataError("damaged candidate: " + text);
    }
  };
  read(candidate.fault);
  read(candidate.factor);
  read(candidate.strength);
  read(isolated);
  candidate.isolated = isolated != 0;
  return candidate;
}

// As the catalogue of faults has it; a finding of the floor has none.
std::optional<std::string_view> DescriptionOf(std::string_view name) {
  const std::optional<int> fault = ParseFault(name);
  return fault ? std::optional(FaultFactsOf(*fault).description) : std::nullopt;
}

// To be published again as it is published now, should nobody acknowledge it.
void StoreUnsent(Database& database, const FaultEvent& event) {
  std::vector<std::string> candidates;
  for (const FaultCandidate& candidate : event.candidates) {
    candidates.push_back(CandidateText(candidate));
  }
  const Transition& t = event.transition;
  database.Cached(sql::insert_unsent)
      .Bind(database.LastInsertRowid(), event.seq, event.source_id, t.faults,
            t.factor, t.strength, JoinText(candidates, "|"))
      .Run();
}

// @returns false if the event was there already, or its episode has ended.
bool StoreEvent(Database& database, const Entry& entry,
                const FaultEvent& event) {
  const Transition& t = entry.transition;
  const bool closed = t.kind == TransitionKind::kClosed;
  database.Cached(sql::insert_event)
      .Bind(t.kind, t.stamp_ns, entry.recorded_ns, entry.IsolatedNames(),
            t.faults, t.factor, t.strength,
            closed ? EndReasonName(t.reason) : std::string_view(),
            IsIsolation(t.kind) ? LayerName(t.layer) : std::string_view(),
            PriorityOf(t.severity), entry.Value(), entry.id)
      .Run();
  // Nothing else is changed unless the event is new, so that repeating it after
  // an error does no harm. Triggers insert into `change` meanwhile; SQLite
  // counts that neither in Changes() nor in LastInsertRowid().
  if (database.Changes() == 0) {
    return false;
  }
  if (!t.notice) {
    StoreUnsent(database, event);
  }
  database.Cached(sql::set_share)
      .Bind(t.share, t.return_hours, t.notice, entry.id)
      .Run();
  if (t.unknown != Unknown::kNone) {
    database.Cached(sql::set_unknown_kind)
        .Bind(UnknownName(t.unknown), entry.id)
        .Run();
  } else if (IsIsolation(t.kind)) {
    database.Cached(sql::set_unknown_kind).Bind(std::nullopt, entry.id).Run();
  }
  if (IsIsolation(t.kind)) {
    StoreIsolation(database, entry);
  }
  // A second fault wants an answer, whatever its priority; its end does not.
  const bool second = t.kind == TransitionKind::kSecond && t.second.open;
  if (second || t.kind == TransitionKind::kRaised) {
    database.Cached(sql::raise_alarm).Bind(entry.id, true, std::nullopt).Run();
  } else if (IsIsolation(t.kind) || t.kind == TransitionKind::kChanged) {
    // Before the new priority replaces the one that was acknowledged.
    database.Cached(sql::raise_alarm)
        .Bind(entry.id, t.kind == TransitionKind::kChanged,
              PriorityOf(t.severity))
        .Run();
    StoreStrengthNow(database, entry.id, {t.strength, t.lowest, t.highest},
                     t.severity);
  } else if (t.kind == TransitionKind::kCleared) {
    database.Cached(sql::set_cleared).Bind(t.stamp_ns, entry.id).Run();
  } else if (closed) {
    const bool cleared = t.reason == EndReason::kCleared;
    database.Cached(sql::set_ended)
        .Bind(t.stamp_ns, EndReasonName(t.reason),
              cleared ? std::optional(t.stamp_ns) : std::nullopt,
              LeavesUnconfirmed(t.reason) ? std::optional(t.stamp_ns)
                                          : std::nullopt,
              entry.id)
        .Run();
  }
  StoreCertainty(database, entry.id);
  return true;
}

void StoreCoverage(Database& database, std::span<const CoverageDay> days) {
  Statement& row = database.Cached(sql::add_coverage);
  for (const CoverageDay& day : days) {
    for (std::size_t i = 0; i < kQualityCount; ++i) {
      const auto quality = static_cast<Quality>(i);
      const std::uint64_t samples = day.samples[quality];
      if (samples != 0) {
        row.Bind(day.valve_id, day.day, QualityName(quality), samples,
                 static_cast<double>(samples) * day.period_s)
            .Run();
      }
    }
  }
}

void StoreAccumulators(Database& database,
                       std::span<const Accumulator> accumulators) {
  if (accumulators.empty()) {
    return;
  }
  Statement& row = database.Cached(InsertSql<Accumulator>(
      "accumulator",
      "ON CONFLICT (valve_id) DO UPDATE SET source_id = excluded.source_id, "
      "model_hash = excluded.model_hash, stamp_ns = excluded.stamp_ns, "
      "bytes = excluded.bytes"));
  for (const Accumulator& accumulator : accumulators) {
    BindRecord(row, accumulator).Run();
  }
}

// "NAME@VERSION"; version 0 if there is none.
void SplitModelSet(const std::string& text, std::string& name, int& version) {
  const std::size_t at = text.rfind('@');
  name = text.substr(0, at);
  if (at != std::string::npos) {
    std::from_chars(text.data() + at + 1, text.data() + text.size(), version);
  }
}

// The members of `faults` with what was estimated of all of them.
std::vector<FaultCandidate> IsolatedCandidates(
    const std::vector<std::string>& names, double factor, double strength) {
  std::vector<FaultCandidate> candidates;
  for (const std::string& name : names) {
    if (const auto fault = ParseFinding(name)) {
      candidates.push_back({*fault, factor, strength, true});
    }
  }
  return candidates;
}

std::uint64_t RequireEpisodeId(const Statement& row, int column) {
  const auto id = ParseEpisodeId(row.Text(column));
  if (!id) {
    throw DataError("episode id '" + row.Text(column) +
                    "' is damaged: it is not 16 hex digits");
  }
  return *id;
}

FaultEvent ReadUnsent(const Statement& row) {
  FaultEvent event;
  Transition& t = event.transition;
  std::string reason;
  std::string model_set;
  std::vector<std::string> candidates;
  event.episode_id = RequireEpisodeId(row, 1);
  row.Read(2, t.kind, event.valve_id, event.source_id, event.seq, t.stamp_ns,
           t.detection_stamp_ns, t.faults, t.factor, t.strength, reason,
           candidates, model_set, event.model_hash);
  t.reason = reason.empty() ? EndReason::kNone : ReasonOf(reason);
  t.severity = ReadSeverity(row, 15);
  std::ranges::transform(candidates, std::back_inserter(event.candidates),
                         ParseCandidate);
  SplitModelSet(model_set, event.model_set, event.model_version);
  event.persisted = true;
  event.resent = true;
  return event;
}

OpenEpisode ReadOpen(const Statement& row) {
  OpenEpisode episode;
  std::string model_set;
  std::string layer;
  std::vector<std::string> names;
  double factor = 0.0;
  double strength = 0.0;
  episode.episode_id = RequireEpisodeId(row, 0);
  row.Read(1, episode.valve_id, episode.source_id, episode.detection_stamp_ns,
           episode.last_stamp_ns, episode.faults, episode.isolated, layer,
           model_set, episode.model_hash, names, factor, strength);
  episode.layer = ParseLayer(layer);
  std::vector<std::string> isolated;
  for (std::size_t bit = 0; bit < names.size(); ++bit) {
    if (Has(episode.faults, bit)) {
      isolated.push_back(names[bit]);
    }
  }
  episode.candidates = IsolatedCandidates(isolated, factor, strength);
  episode.severity = ReadSeverity(row, 13);
  episode.second = ParseSecond(row.Text(14), names);
  row.Read(15, episode.share, episode.notice);
  SplitModelSet(model_set, episode.model_set, episode.model_version);
  return episode;
}

// All rows but the damaged ones, which begin with `what` and their first
// column in messages.
template <typename Read>
auto ReadUndamaged(Statement& rows, const std::string& what, Read read,
                   std::vector<std::string>* damaged) {
  std::vector<decltype(read(rows))> records;
  while (rows.Step()) {
    try {
      records.push_back(read(rows));
    } catch (const DataError& error) {
      const std::string message =
          what + " " + rows.Text(0) + ": " + error.what();
      if (damaged == nullptr) {
        throw DataError(message);
      }
      damaged->push_back(message);
    }
  }
  return records;
}

}  // namespace

HistoryWriter::HistoryWriter(const std::filesystem::path& path)
    : database_(path, HistorySchema(), Access::kWriter) {}

bool HistoryWriter::Refresh() {
  if (!database_.Refresh()) {
    return false;
  }
  traces_.DropPending();
  session_id_.reset();
  return true;
}

SessionStart HistoryWriter::BeginSession(
    std::int64_t now_ns, const std::string& software, const std::string& config,
    const std::map<std::string, std::string>& fault_names) {
  SessionStart start;
  Transaction transaction(database_);
  // This is read before the next statement gives the dead session an end.
  start.died_ns = database_.QueryInt64(sql::last_sign_of_life);
  if (start.died_ns) {
    start.died_ns = std::min(*start.died_ns, now_ns);
  }
  database_.Run(sql::end_dead_sessions);
  database_.Run(sql::insert_session, now_ns, software, config);
  start.session_id = database_.LastInsertRowid();
  for (const auto& [fault, name] : fault_names) {
    database_.Cached(sql::put_fault_name)
        .Bind(ParseFinding(fault).value_or(0), fault, name,
              DescriptionOf(fault))
        .Run();
  }
  transaction.Commit();
  session_id_ = start.session_id;
  began_ns_ = alive_ns_ = now_ns;
  return start;
}

void HistoryWriter::EndSession(std::int64_t now_ns, bool clean) {
  traces_.EndAll();
  CommitBatch([&] {
    // There is none if the file was replaced and did not take another one.
    if (session_id_) {
      database_.Run(sql::end_session, clean, StoreSignOfLife(now_ns));
    }
  });
  session_id_.reset();
  database_.Checkpoint();
}

// A clock that was set back to before the session began ends it at its last
// sign of life and begins another one, so that none ends before it begins.
std::int64_t HistoryWriter::StoreSignOfLife(std::int64_t now_ns) {
  if (now_ns >= began_ns_) {
    database_.Cached(sql::set_alive).Bind(now_ns, *session_id_).Run();
    return *session_id_;
  }
  database_.Run(sql::insert_next_session, now_ns, *session_id_);
  const std::int64_t next = database_.LastInsertRowid();
  database_.Run(sql::end_session, true, *session_id_);
  return next;
}

// What was pending before is stored first: the trace of an episode is in the
// file when its next event is. Only a commit makes it forgotten, so that a
// full disk costs nothing but time.
void HistoryWriter::CommitBatch(const std::function<void()>& batch) {
  // Transactions do not nest: a call from within a batch joins it.
  if (in_batch_) {
    batch();
    return;
  }
  in_batch_ = true;
  // Until a transaction succeeds, Commit() tries again even if nothing is
  // pending, which shows when the disk works again.
  failed_ = true;
  try {
    Transaction transaction(database_);
    StorePending();
    batch();
    transaction.Commit();
  } catch (...) {
    in_batch_ = false;
    throw;
  }
  in_batch_ = false;
  failed_ = false;
  DiscardCommitted();
}

bool HistoryWriter::Record(const FaultEvent& event, std::int64_t now_ns) {
  const Transition& t = event.transition;
  if (event.models == nullptr) {
    Require(t.kind == TransitionKind::kClosed,
            "HistoryWriter::Record: only an end goes without a model set");
    traces_.End(event.episode_id);
  } else {
    Require(!event.valve_id.empty(), "HistoryWriter::Record: no valve");
  }
  bool is_new = false;
  CommitBatch([&] {
    Entry entry = event.models != nullptr
                      ? InsertEpisode(database_, event, session_id_)
                      : EndOfStored(database_, event);
    entry.recorded_ns = now_ns;
    is_new = StoreEvent(database_, entry, event);
    // A notice takes the place of no alarm.
    if (is_new && !t.notice &&
        (t.kind == TransitionKind::kDetected ||
         t.kind == TransitionKind::kRaised)) {
      database_.Cached(sql::end_unconfirmed)
          .Bind(event.valve_id, entry.id)
          .Run();
    }
  });
  if (IsIsolation(t.kind)) {
    traces_.SetIsolated(event.episode_id, t.faults);
  }
  return is_new;
}

bool HistoryWriter::Has(const FaultEvent& event) {
  return database_
      .QueryInt64(sql::has_event, EpisodeIdText(event.episode_id),
                  event.transition.kind, event.transition.stamp_ns)
      .has_value();
}

void HistoryWriter::ConfirmNormal(const std::string& valve_id,
                                  std::int64_t stamp_ns) {
  CommitBatch([&] {
    database_.Cached(sql::confirm_normal).Bind(stamp_ns, valve_id).Run();
  });
}

void HistoryWriter::StoreSilence(const std::string& valve_id,
                                 std::optional<std::int64_t> since_ns) {
  CommitBatch([&] {
    database_.Cached(sql::set_silence).Bind(since_ns, valve_id).Run();
  });
}

void HistoryWriter::RequireEpisode(const std::string& id) {
  if (!database_.QueryInt64("SELECT 1 FROM episode WHERE episode_id = ?", id)) {
    throw NotFoundError("no episode " + id);
  }
}

void HistoryWriter::Resume(std::uint64_t episode_id, std::int64_t stamp_ns,
                           std::int64_t now_ns) {
  const std::string id = EpisodeIdText(episode_id);
  CommitBatch([&] {
    RequireEpisode(id);
    database_.Cached(sql::insert_resumed).Bind(id, stamp_ns, now_ns).Run();
  });
}

void HistoryWriter::CommitCheckpoint(const Checkpoint& checkpoint) {
  CommitBatch([&] {
    // Coverage and health are added to what is stored. All of it is in one
    // transaction, so that after an error the caller can merge this checkpoint
    // into the next one.
    StoreCoverage(database_, checkpoint.coverage);
    StoreAccumulators(database_, checkpoint.accumulators);
    StoreHealth(database_, checkpoint.health);
  });
}

std::vector<Accumulator> HistoryWriter::Accumulators() {
  Statement rows = database_.Prepare(
      SelectSql<Accumulator>("FROM accumulator ORDER BY valve_id"));
  return ReadRecords<Accumulator>(rows);
}

void HistoryWriter::MarkSent(const FaultEvent& event) {
  sent_.push_back(
      {event.episode_id, event.transition.kind, event.transition.stamp_ns});
}

void HistoryWriter::StorePending() {
  traces_.Store();
  for (const DataGap& gap : gaps_) {
    database_.Cached(sql::insert_gap)
        .Bind(gap.valve_id, gap.from_ns, gap.to_ns, gap.reason, session_id_)
        .Run();
  }
  // A crash before this commit lets the event be sent again, so subscribers may
  // receive it twice; it is never lost.
  for (const SentEvent& event : sent_) {
    database_.Cached(sql::delete_unsent)
        .Bind(EpisodeIdText(event.episode_id), event.kind, event.stamp_ns)
        .Run();
  }
}

void HistoryWriter::DiscardCommitted() {
  gaps_.clear();
  sent_.clear();
  traces_.DiscardCommitted();
}

void HistoryWriter::DropPending() {
  gaps_.clear();
  sent_.clear();
  traces_.DropPending();
}

bool HistoryWriter::HasPending() const {
  return !gaps_.empty() || !sent_.empty() || traces_.HasPending();
}

void HistoryWriter::Commit(std::int64_t now_ns) {
  // A clock that was set back has no sign of life of its own yet.
  const bool alive = session_id_ && (now_ns - alive_ns_ >= kAliveEveryNs ||
                                     now_ns < alive_ns_);
  if (!HasPending() && !alive && !failed_) {
    return;
  }
  std::optional<std::int64_t> session = session_id_;
  CommitBatch([&] {
    if (session_id_) {
      session = StoreSignOfLife(now_ns);
    }
  });
  // Only now is a next session in the file.
  session_id_ = session;
  began_ns_ = std::min(began_ns_, now_ns);
  alive_ns_ = now_ns;
}

std::vector<FaultEvent> HistoryWriter::UnsentEvents(
    std::vector<std::string>* damaged) {
  Statement rows = database_.Prepare(sql::unsent_events);
  return ReadUndamaged(rows, "event_outbox, event", ReadUnsent, damaged);
}

std::vector<OpenEpisode> HistoryWriter::OpenEpisodes(
    std::vector<std::string>* damaged) {
  Statement rows = database_.Prepare(sql::open_episodes);
  return ReadUndamaged(rows, "episode", ReadOpen, damaged);
}

}  // namespace fdi::storage
