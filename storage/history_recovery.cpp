#include "storage/history_recovery.h"

#include <optional>
#include <string>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/history_rows.h"

namespace fdi::storage {
namespace {

std::optional<TransitionKind> KindOf(std::string_view name) {
  for (int k = 0; k <= static_cast<int>(TransitionKind::kClosed); ++k) {
    if (TransitionName(static_cast<TransitionKind>(k)) == name) {
      return static_cast<TransitionKind>(k);
    }
  }
  return std::nullopt;
}

EndReason ReasonOf(std::string_view name) {
  for (int r = 0; r < static_cast<int>(EndReason::kUnknown); ++r) {
    if (EndReasonName(static_cast<EndReason>(r)) == name) {
      return static_cast<EndReason>(r);
    }
  }
  return EndReason::kUnknown;
}

}  // namespace

std::vector<UnsentEvent> ReadUnsentEvents(Database& database) {
  std::vector<UnsentEvent> events;
  Statement row = database.Prepare(
      "SELECT v.event_id, v.episode_id, e.valve_id, e.source_id, v.kind, "
      "v.stamp_ns, e.detected_ns, v.fault_bits, v.factor, v.strength, "
      "coalesce(v.reason, ''), coalesce(v.faults, ''), e.model_set, "
      "e.model_hash FROM event_outbox o JOIN episode_event v USING (event_id) "
      "JOIN episode e USING (episode_id) ORDER BY v.event_id");
  while (row.Step()) {
    UnsentEvent event;
    event.event_id = row.Int64(0);
    event.episode_id = std::stoull(row.Text(1), nullptr, 16);
    event.valve_id = row.Text(2);
    event.source_id = row.Uint64(3);
    const auto kind = KindOf(row.Text(4));
    if (!kind) {
      throw DataError("event " + std::to_string(event.event_id) +
                      ": unknown transition " + row.Text(4));
    }
    const EndReason reason =
        row.Text(10).empty() ? EndReason::kNone : ReasonOf(row.Text(10));
    event.transition = {*kind,         row.Int64(5),  row.Int64(6),
                        row.Uint64(7), row.Double(8), row.Double(9),
                        reason};
    for (const std::string& name : SplitNames(row.Text(11))) {
      event.faults.push_back(ParseFault(name).value_or(0));
    }
    event.model_set = row.Text(12);
    event.model_hash = row.Uint64(13);
    events.push_back(std::move(event));
  }
  return events;
}

std::vector<Episode> ReadOpenEpisodes(Database& database) {
  std::vector<Episode> episodes;
  Statement row = database.Prepare(
      std::string("SELECT ") + kEpisodeColumns +
      " FROM episode e CROSS JOIN fault_history v USING (episode_id) "
      "WHERE e.ended_ns IS NULL ORDER BY e.detected_ns, e.valve_id");
  while (row.Step()) {
    episodes.push_back(ReadEpisode(row));
  }
  return episodes;
}

}  // namespace fdi::storage
