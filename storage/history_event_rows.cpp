#include "storage/history_event_rows.h"

#include <cmath>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/history_rows.h"

namespace fdi::storage {
namespace {

double Finite(double value) {
  return std::isfinite(value) ? value : 0.0;
}

bool IsIsolation(TransitionKind kind) {
  return kind == TransitionKind::kIsolated ||
         kind == TransitionKind::kReisolated;
}

std::optional<std::string> NullIfEmpty(std::string text) {
  return text.empty() ? std::nullopt : std::optional(std::move(text));
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

std::optional<std::int64_t> HistoryEventRows::Add(
    const NewEvent& event, std::optional<std::int64_t> session_id) {
  const Entry entry{EpisodeIdText(EpisodeIdOf(event)), event.transition,
                    event.recorded_ns, FaultNames(*event.models)};
  InsertEpisode(event, entry.id, session_id);
  return Store(entry);
}

void HistoryEventRows::InsertEpisode(const NewEvent& event,
                                     const std::string& id,
                                     std::optional<std::int64_t> session_id) {
  const ModelSet& models = *event.models;
  statements_(
      "INSERT INTO episode (episode_id, session_id, valve_id, source_id, "
      "detected_ns, peak_factor, strength, model_set, model_hash, flow_unit, "
      "channels, faults) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) "
      "ON CONFLICT (episode_id) DO NOTHING")
      .Bind(id, session_id, event.valve_id, event.source_id,
            event.transition.detection_stamp_ns,
            Finite(event.transition.factor), Finite(event.transition.strength),
            models.name + "@" + std::to_string(models.version),
            models.content_hash, FlowUnitName(models.flow_unit),
            JoinNames(ChannelNames(models)), JoinNames(FaultNames(models)))
      .Run();
}

std::optional<std::int64_t> HistoryEventRows::Store(const Entry& entry) {
  if (!InsertEvent(entry)) {
    return std::nullopt;
  }
  const std::int64_t event_id = database_.LastInsertRowid();
  statements_("INSERT INTO event_outbox (event_id) VALUES (?)")
      .Bind(event_id)
      .Run();
  StoreUnknown(entry);
  const Transition& t = entry.transition;
  if (IsIsolation(t.kind)) {
    StoreIsolation(entry);
  } else if (t.kind == TransitionKind::kCleared) {
    statements_("UPDATE episode SET cleared_ns = ? WHERE episode_id = ?")
        .Bind(t.stamp_ns, entry.id)
        .Run();
  } else if (t.kind == TransitionKind::kClosed) {
    const bool cleared = t.reason == EndReason::kCleared;
    statements_(
        "UPDATE episode SET ended_ns = ?, end_reason = ?, "
        "fault = coalesce(fault, 'unknown'), "
        "cleared_ns = coalesce(cleared_ns, ?) WHERE episode_id = ?")
        .Bind(t.stamp_ns, EndReasonName(t.reason),
              cleared ? std::optional(t.stamp_ns) : std::nullopt, entry.id)
        .Run();
  }
  return event_id;
}

// @returns false if it was there already, or its episode has ended.
bool HistoryEventRows::InsertEvent(const Entry& entry) {
  const Transition& t = entry.transition;
  const bool closed = t.kind == TransitionKind::kClosed;
  statements_(
      "INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns, "
      "faults, fault_bits, factor, strength, reason) "
      "SELECT episode_id, ?, ?, ?, ?, ?, ?, ?, ? FROM episode "
      "WHERE episode_id = ? AND ended_ns IS NULL "
      "ON CONFLICT (episode_id, kind, stamp_ns) DO NOTHING")
      .Bind(TransitionName(t.kind), t.stamp_ns, entry.recorded_ns,
            NullIfEmpty(NamesOf(t.faults, entry.names)), t.faults, t.factor,
            t.strength,
            NullIfEmpty(closed ? std::string(EndReasonName(t.reason)) : ""),
            entry.id)
      .Run();
  return database_.Changes() > 0;
}

// Why there is no name; none of an episode that got one.
void HistoryEventRows::StoreUnknown(const Entry& entry) {
  const Transition& t = entry.transition;
  if (t.unknown == Unknown::kNone && !IsIsolation(t.kind)) {
    return;
  }
  const auto kind = t.unknown == Unknown::kNone
                        ? std::nullopt
                        : std::optional<std::string>(UnknownName(t.unknown));
  statements_("UPDATE episode SET unknown_kind = ? WHERE episode_id = ?")
      .Bind(kind, entry.id)
      .Run();
}

void HistoryEventRows::StoreIsolation(const Entry& entry) {
  const Transition& t = entry.transition;
  statements_(
      "UPDATE episode SET isolated_ns = coalesce(isolated_ns, ?), "
      "fault = ?, fault_bits = ?, peak_factor = ?, strength = ? "
      "WHERE episode_id = ?")
      .Bind(t.stamp_ns,
            NullIfEmpty(NamesOf(t.faults, entry.names)).value_or("unknown"),
            t.faults, Finite(t.factor), Finite(t.strength), entry.id)
      .Run();
  statements_("UPDATE episode_fault SET held = 0 WHERE episode_id = ?")
      .Bind(entry.id)
      .Run();
  for (std::size_t bit = 0; bit < entry.names.size(); ++bit) {
    if ((t.faults >> bit & 1U) != 0) {
      statements_(
          "INSERT INTO episode_fault (episode_id, fault, fault_bit, first_ns, "
          "held, detected_ns) SELECT episode_id, ?, ?, ?, 1, detected_ns "
          "FROM episode WHERE episode_id = ? "
          "ON CONFLICT (episode_id, fault) DO UPDATE SET held = 1")
          .Bind(entry.names[bit], bit, t.stamp_ns, entry.id)
          .Run();
    }
  }
}

std::optional<std::int64_t> HistoryEventRows::Close(std::uint64_t episode_id,
                                                    std::int64_t stamp_ns,
                                                    EndReason reason,
                                                    std::int64_t now_ns) {
  Entry entry;
  entry.id = EpisodeIdText(episode_id);
  entry.recorded_ns = now_ns;
  Statement& row = statements_(
      "SELECT detected_ns, fault_bits, peak_factor, strength, faults "
      "FROM episode WHERE episode_id = ?");
  if (!row.Bind(entry.id).Step()) {
    row.Reset();
    throw NotFoundError("no episode " + entry.id);
  }
  entry.transition = {
      TransitionKind::kClosed, stamp_ns,      row.Int64(0), row.Uint64(1),
      row.Double(2),           row.Double(3), reason};
  entry.names = SplitNames(row.Text(4));
  row.Reset();
  return Store(entry);
}

void HistoryEventRows::Resume(std::uint64_t episode_id, std::int64_t stamp_ns,
                              std::int64_t now_ns) {
  const std::string id = EpisodeIdText(episode_id);
  if (!database_.QueryInt64("SELECT 1 FROM episode WHERE episode_id = ?", id)) {
    throw NotFoundError("no episode " + id);
  }
  statements_(
      "INSERT INTO episode_event (episode_id, kind, stamp_ns, recorded_ns) "
      "VALUES (?, 'RESUMED', ?, ?) "
      "ON CONFLICT (episode_id, kind, stamp_ns) DO NOTHING")
      .Bind(id, stamp_ns, now_ns)
      .Run();
}

}  // namespace fdi::storage
