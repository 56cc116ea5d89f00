#include "storage/history_query.h"

#include "diagnosis/fault_catalogue.h"
#include "storage/history_rows.h"

namespace fdi::storage {
namespace {

constexpr const char* kUnknown = "unknown";

bool IsExact(const EpisodeFilter& filter) {
  return filter.valve_glob.find_first_of("*?[") == std::string::npos;
}

bool NamesAFault(const EpisodeFilter& filter) {
  return !filter.fault.empty() && filter.fault != kUnknown;
}

bool IsOpen(EpisodeState state) {
  return state == EpisodeState::kOpen || state == EpisodeState::kDetected ||
         state == EpisodeState::kIsolated ||
         state == EpisodeState::kAlarmUnacked ||
         state == EpisodeState::kAlarmAcked;
}

bool IsUnacked(EpisodeState state) {
  return state == EpisodeState::kUnacked ||
         state == EpisodeState::kAlarmReturnedUnacked;
}

std::string FaultOf(const EpisodeFilter& filter) {
  return NamesAFault(filter) ? FaultName(RequireFault(filter.fault))
                             : filter.fault;
}

const char* ValveCondition(const EpisodeFilter& filter) {
  return filter.valve_glob == "*" ? "?1 = '*'"
         : IsExact(filter)        ? "e.valve_id = ?1"
                                  : "e.valve_id GLOB ?1";
}

const char* FaultCondition(const EpisodeFilter& filter) {
  return filter.fault.empty()       ? "?4 = ''"
         : filter.fault == kUnknown ? "e.fault = ?4"
                                    : "EXISTS (SELECT 1 FROM episode_fault f "
                                      "WHERE f.episode_id = e.episode_id AND "
                                      "f.fault = ?4 AND f.held = 1)";
}

const char* StateCondition(EpisodeState state) {
  switch (state) {
    case EpisodeState::kAny:
      return "";
    case EpisodeState::kOpen:
      return " AND e.ended_ns IS NULL";
    case EpisodeState::kDetected:
      return " AND e.ended_ns IS NULL AND e.isolated_ns IS NULL";
    case EpisodeState::kIsolated:
      return " AND e.ended_ns IS NULL AND e.isolated_ns IS NOT NULL";
    case EpisodeState::kClosed:
      return " AND e.ended_ns IS NOT NULL";
    case EpisodeState::kUnacked:
      return " AND e.acked_by IS NULL";
    case EpisodeState::kAlarmUnacked:
      return " AND e.ended_ns IS NULL AND e.cleared_ns IS NULL AND "
             "e.acked_by IS NULL";
    case EpisodeState::kAlarmAcked:
      return " AND e.ended_ns IS NULL AND e.cleared_ns IS NULL AND "
             "e.acked_by IS NOT NULL";
    case EpisodeState::kAlarmReturnedUnacked:
      return " AND e.acked_by IS NULL AND coalesce(e.cleared_ns, e.ended_ns) "
             "IS NOT NULL";
    case EpisodeState::kAlarmNormal:
      return " AND e.acked_by IS NOT NULL AND coalesce(e.cleared_ns, "
             "e.ended_ns) IS NOT NULL";
    case EpisodeState::kAlarmShelved:  // As Covers() and InForce() say.
      return " AND EXISTS (SELECT 1 FROM shelf s WHERE s.valve_id = "
             "e.valve_id AND s.until_ns > ?5 AND s.from_ns <= ?5 AND "
             "(s.ended_ns IS NULL OR s.ended_ns > ?5) AND "
             "(s.fault IS NULL OR s.fault = e.fault))";
  }
  return "";
}

const char* IndexFor(const EpisodeFilter& filter) {
  return IsExact(filter)            ? "episode_by_valve"
         : filter.fault == kUnknown ? "episode_by_fault"
         : IsOpen(filter.state)     ? "episode_open"
         : IsUnacked(filter.state)  ? "episode_unacked"
                                    : "episode_by_time";
}

// The ids, newest first.
std::string NewestIds(const EpisodeFilter& filter) {
  const std::string valve_and_state = std::string(" AND ") +
                                      ValveCondition(filter) +
                                      StateCondition(filter.state);
  if (NamesAFault(filter) && !IsExact(filter)) {
    return "SELECT f.episode_id FROM episode_fault f INDEXED BY "
           "episode_fault_by_fault CROSS JOIN episode e USING (episode_id) "
           "WHERE f.fault = ?4 AND f.held = 1 AND f.detected_ns >= ?2 AND "
           "f.detected_ns < ?3" +
           valve_and_state + " ORDER BY f.detected_ns DESC, e.valve_id DESC";
  }
  return std::string("SELECT e.episode_id FROM episode e INDEXED BY ") +
         IndexFor(filter) +
         " WHERE e.detected_ns >= ?2 AND e.detected_ns < ?3" + valve_and_state +
         " AND " + FaultCondition(filter) +
         " ORDER BY e.detected_ns DESC, e.valve_id DESC";
}

}  // namespace

std::string ListQuery(const EpisodeFilter& filter) {
  return std::string("SELECT ") + kEpisodeColumns +
         " FROM episode e CROSS JOIN fault_history v USING (episode_id) "
         "WHERE e.episode_id IN (" +
         NewestIds(filter) + " LIMIT ?6) ORDER BY e.detected_ns, e.valve_id";
}

std::string StatisticsQuery(const EpisodeFilter& filter) {
  const std::string right =
      "(e.label = 'true' OR instr('|' || coalesce(e.fault, '') || '|', '|' || "
      "e.label || '|') > 0)";
  return std::string(
             "SELECT e.valve_id, coalesce(e.fault, ''), count(*), "
             "sum(e.ended_ns IS NULL), sum(e.acked_by IS NULL), "
             "sum(e.label IS NOT NULL AND ") +
         right + "), sum(e.label IS NOT NULL AND NOT " + right +
         "), "
         "avg((e.isolated_ns - e.detected_ns) * 1e-9), "
         "avg((e.ended_ns - e.detected_ns) * 1e-9), max(e.peak_factor), "
         "max(e.detected_ns) FROM episode e INDEXED BY episode_statistics "
         "WHERE e.detected_ns >= ?2 AND e.detected_ns < ?3 AND " +
         ValveCondition(filter) + StateCondition(filter.state) + " AND " +
         FaultCondition(filter) +
         " GROUP BY e.valve_id, e.fault ORDER BY e.valve_id, e.fault";
}

std::string AlarmSpanQuery(const EpisodeFilter& filter) {
  return std::string(
             "SELECT e.valve_id, coalesce(e.fault, ''), e.detected_ns, "
             "e.ended_ns, e.label, CASE WHEN e.ended_ns IS NULL THEN (SELECT "
             "max(last_ns) FROM episode_trace t WHERE t.episode_id = "
             "e.episode_id) END FROM episode e INDEXED BY episode_statistics "
             "WHERE (e.ended_ns IS NULL OR e.ended_ns >= ?2) AND "
             "e.detected_ns < ?3 AND ") +
         ValveCondition(filter) + " AND " + FaultCondition(filter) +
         " ORDER BY e.detected_ns, e.valve_id";
}

std::string AlarmListQuery() {
  return std::string("SELECT ") + kEpisodeColumns +
         " FROM episode e CROSS JOIN fault_history v USING (episode_id) "
         "WHERE e.episode_id IN (SELECT episode_id FROM ("
         "SELECT episode_id FROM episode INDEXED BY episode_open "
         "WHERE ended_ns IS NULL ORDER BY detected_ns DESC, valve_id DESC "
         "LIMIT ?1) UNION ALL SELECT episode_id FROM ("
         "SELECT episode_id FROM episode INDEXED BY episode_unacked "
         "WHERE acked_by IS NULL AND ended_ns IS NOT NULL "
         "ORDER BY detected_ns DESC, valve_id DESC LIMIT ?1) LIMIT ?1) "
         "ORDER BY e.detected_ns DESC, e.valve_id DESC";
}

void BindListQuery(Statement& statement, const EpisodeFilter& filter) {
  const std::int64_t limit = filter.limit > 0 ? filter.limit : -1;
  statement.Bind(filter.valve_glob, filter.since_ns, filter.until_ns,
                 FaultOf(filter), filter.now_ns, limit);
}

void BindStatisticsQuery(Statement& statement, const EpisodeFilter& filter) {
  if (filter.state == EpisodeState::kAlarmShelved) {
    statement.Bind(filter.valve_glob, filter.since_ns, filter.until_ns,
                   FaultOf(filter), filter.now_ns);
  } else {
    statement.Bind(filter.valve_glob, filter.since_ns, filter.until_ns,
                   FaultOf(filter));
  }
}

}  // namespace fdi::storage
