#include "plant/plant_reader.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <set>
#include <tuple>
#include <type_traits>
#include <utility>

#include "diagnosis/fault_catalogue.h"
#include "diagnosis/records/valve_glob.h"
#include "plant/sql.h"
#include "storage/database/record.h"
#include "storage/history/history_reader.h"
#include "storage/history/trace.h"

namespace fdi::storage {
namespace sql = plant_sql;
namespace {

// ---- Values from PostgreSQL's text; NULL as Statement::Read() takes it.
void Parse(const std::optional<std::string>& text, std::string& field) {
  field = text.value_or("");
}
void Parse(const std::optional<std::string>& text, double& field) {
  field = text ? std::strtod(text->c_str(), nullptr) : 0.0;
}
void Parse(const std::optional<std::string>& text,
           std::vector<std::string>& names) {
  names = SplitNames(text.value_or(""));
}
template <typename T>
requires std::is_integral_v<T> || std::is_enum_v<T>
void Parse(const std::optional<std::string>& text, T& field) {
  if constexpr (requires { EnumText<T>::last; }) {
    int i = 0;
    while (EnumText<T>::name(static_cast<T>(i)) != text) {
      if (++i > static_cast<int>(EnumText<T>::last)) {
        RefuseName(text.value_or(""));
      }
    }
    field = static_cast<T>(i);
  } else {
    field = static_cast<T>(text ? std::atoll(text->c_str()) : 0);
  }
}
template <typename T>
void Parse(const std::optional<std::string>& text, std::optional<T>& field) {
  field.reset();
  if (text) {
    Parse(text, field.emplace());
  }
}

template <typename Record>
Record RecordAt(const PlantRows& rows, int row) {
  Record record;
  std::apply(
      [&](const auto&... field) {
        int column = 0;
        (Parse(rows.Text(row, column++), field(record)), ...);
      },
      kFieldsOf<Record>);
  return record;
}

template <typename Record>
std::vector<Record> Records(const PlantRows& rows) {
  std::vector<Record> records;
  for (int r = 0; r < rows.size(); ++r) {
    records.push_back(RecordAt<Record>(rows, r));
  }
  return records;
}

// ---- Statements.
std::string Replaced(std::string text, std::string_view what,
                     std::string_view by) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos;
       at += by.size()) {
    text.replace(at, what.size(), by);
  }
  return text;
}

// A character in a regular expression. A backslash makes a letter or digit
// special in PostgreSQL (\d, \m), and anything else plain, also in a set.
std::string Plain(std::string_view character) {
  const auto first = static_cast<unsigned char>(character.front());
  const bool is_plain =
      std::isalnum(first) != 0 || first == '_' || (first & 0x80U) != 0;
  return (is_plain ? "" : "\\") + std::string(character);
}

// The regular expression that matches what GlobMatches() does. PostgreSQL
// refuses empty sets and ranges, and ranges that share an end (a-c-e).
std::string RegexOf(std::string_view glob) {
  std::string regex = "^";
  while (!glob.empty()) {
    const std::string_view character = TakeCharacter(glob);
    if (character == "*" || character == "?") {
      regex += character == "*" ? ".*" : ".";
    } else if (character == "[") {
      std::string members;
      const auto negated =
          TakeGlobSet(glob, [&](std::string_view low, std::string_view high) {
            if (low <= high) {
              members += Plain(low) + (low == high ? "" : '-' + Plain(high));
            }
          });
      if (!negated || (members.empty() && !*negated)) {
        return "$.";  // Matches nothing.
      }
      regex += members.empty() ? "." : (*negated ? "[^" : "[") + members + ']';
    } else {
      regex += Plain(character);
    }
  }
  return regex + "$";
}

bool IsGlob(const std::string& valve) {
  return valve != "*" && valve.find_first_of("*?[") != std::string::npos;
}

}  // namespace

PlantReader::PlantReader(const std::string& url, std::string monitor)
    : plant_(url), monitor_(std::move(monitor)) {
  plant_.Run("SET search_path = fdi, pg_catalog");
}

// Runs `sql` with its {episodes} or {valve}, the condition of the filter.
PlantRows PlantReader::Query(std::string_view sql,
                             const EpisodeFilter& filter) {
  // The condition is that of SQLite, with what the two write differently
  // replaced in its text. No value is in that text: all of them are parameters.
  const EpisodeCondition condition = ConditionOf(filter);
  // The index of what is open goes by end_reason, the column of the view.
  const std::string open =
      Replaced(condition.sql, "e.ended_ns IS NULL", "e.end_reason IS NULL");
  // The indices are on utc(), in whole milliseconds, hence <=; the condition
  // has the exact times. PostgreSQL refuses a parameter whose type it cannot
  // tell, so each one has to occur.
  const std::string episodes =
      Replaced(Replaced(open, "GLOB", "~"), "?", "$") +
      " AND utc(e.detected_ns) >= utc($2) AND utc(e.detected_ns) <= utc($3)"
      " AND $5::bigint IS NOT NULL AND ($6 = '' OR e.monitor = $6)";
  // Of tables without episodes.
  const std::string valve = IsGlob(filter.valve_glob)
                                ? "valve_id ~ $1"
                                : "($1 = '*' OR valve_id = $1)";
  return plant_.Run(
      Replaced(Replaced(std::string(sql), "{episodes}", episodes), "{valve}",
               valve),
      {IsGlob(filter.valve_glob) ? RegexOf(filter.valve_glob)
                                 : filter.valve_glob,
       std::to_string(filter.since_ns), std::to_string(filter.until_ns),
       condition.fault, std::to_string(filter.now_ns), monitor_});
}

// Runs `sql`, which ends with WHERE, for the rows of one episode.
PlantRows PlantReader::QueryEpisode(std::string_view sql,
                                    std::uint64_t episode_id,
                                    const char* order) {
  return plant_.Run(
      std::string(sql) + " " + std::string(sql::of_episode) + order,
      {EpisodeIdText(episode_id), monitor_});
}

std::vector<Episode> PlantReader::List(const EpisodeFilter& filter) {
  return ListWhere("", filter);
}

std::vector<Episode> PlantReader::ListWhere(const std::string& more,
                                            const EpisodeFilter& filter) {
  std::string list(sql::plant_list);
  list = Replaced(list, "{limit}",
                  filter.limit > 0 ? std::to_string(filter.limit) : "ALL");
  const PlantRows rows =
      Query(Replaced(list, "{episodes}", "{episodes}" + more), filter);
  auto episodes = Records<Episode>(rows);
  for (int r = 0; r < rows.size(); ++r) {
    Episode& episode = episodes[static_cast<std::size_t>(r)];
    episode.id = ParseEpisodeId(episode.episode_id).value_or(0);
    episode.host = rows.Text(r, rows.columns() - 2).value_or("");
    episode.monitor = rows.Text(r, rows.columns() - 1).value_or("");
  }
  return episodes;
}

Episode PlantReader::Show(std::string_view id) {
  const PlantRows found =
      id == "last"
          ? plant_.Run(sql::plant_newest, {monitor_})
          : plant_.Run(sql::plant_by_prefix, {std::string(id), monitor_});
  const auto only = found.size() == 1
                        ? ParseEpisodeId(found.Text(0, 0).value_or(""))
                        : std::nullopt;
  if (!only) {
    throw NotFoundError(
        "episode '" + std::string(id) +
        (found.size() > 1 ? "' is not unique in " : "' is not in ") +
        plant_.name());
  }
  // In the text of the statement, because it was made from the number.
  return ListWhere(" AND e.episode_id = '" + EpisodeIdText(*only) + "'", {})
      .at(0);
}

std::vector<HistoryEntry> PlantReader::Events(std::uint64_t episode_id) {
  return Records<HistoryEntry>(
      QueryEpisode(SelectSql<HistoryEntry>("FROM episode_event WHERE"),
                   episode_id, " ORDER BY event_id"));
}

std::optional<EpisodeLook> PlantReader::Look(std::uint64_t episode_id) {
  const PlantRows header = QueryEpisode(sql::plant_look, episode_id);
  if (header.size() == 0) {
    return std::nullopt;
  }
  EpisodeLook look;
  look.episode_id = episode_id;
  Parse(header.Text(0, 0), look.first_ns);
  Parse(header.Text(0, 1), look.period_ns);
  Parse(header.Text(0, 2), look.misfit);
  const PlantRows rows =
      QueryEpisode(sql::plant_look_faults, episode_id, " ORDER BY rank");
  for (int r = 0; r < rows.size(); ++r) {
    LookFault& f = look.faults.emplace_back();
    f.fault = RequireFault(rows.Text(r, 0).value_or(""));
    Parse(rows.Text(r, 1), f.strength);
    Parse(rows.Text(r, 2), f.lowest);
    Parse(rows.Text(r, 3), f.highest);
    Parse(rows.Text(r, 4), f.begins_ns);
    Parse(rows.Text(r, 5), f.growing);
  }
  const PlantRows simulated =
      QueryEpisode(sql::plant_look_rows, episode_id, " ORDER BY row");
  for (int r = 0; r < simulated.size(); ++r) {
    Parse(simulated.Text(r, 0), look.x_pct.emplace_back());
    Parse(simulated.Text(r, 1), look.flow.emplace_back());
  }
  return look;
}

std::vector<StrengthPoint> PlantReader::Strengths(std::uint64_t episode_id) {
  const PlantRows rows = QueryEpisode(sql::plant_strengths, episode_id,
                                      " ORDER BY stamp_ns, fault");
  std::vector<StrengthPoint> points;
  for (int r = 0; r < rows.size(); ++r) {
    StrengthPoint& p = points.emplace_back();
    p.episode_id = episode_id;
    p.fault = RequireFault(rows.Text(r, 0).value_or(""));
    Parse(rows.Text(r, 1), p.stamp_ns);
    Parse(rows.Text(r, 2), p.strength);
    Parse(rows.Text(r, 3), p.lowest);
    Parse(rows.Text(r, 4), p.highest);
    p.layer = rows.Text(r, 5) == LayerName(Layer::kPhysics) ? Layer::kPhysics
                                                            : Layer::kObservers;
  }
  return points;
}

std::vector<TracePoint> PlantReader::Trace(std::uint64_t episode_id) {
  const PlantRows rows =
      QueryEpisode(sql::plant_trace, episode_id, " ORDER BY chunk");
  std::vector<TracePoint> trace;
  for (int r = 0; r < rows.size(); ++r) {
    TraceChunk chunk;
    Parse(rows.Text(r, 0), chunk.samples.codec);
    Parse(rows.Text(r, 1), chunk.samples.crc);
    Parse(rows.Text(r, 2), chunk.samples.count);
    chunk.samples.bytes = rows.Bytes(r, 3);
    Parse(rows.Text(r, 4), chunk.vector_crc);
    chunk.vectors = rows.Bytes(r, 5);
    auto part = DecodeTrace(
        chunk, plant_.name() + ": trace of " + EpisodeIdText(episode_id));
    std::ranges::move(part, std::back_inserter(trace));
  }
  return trace;
}

std::vector<EpisodeStatistics> PlantReader::Statistics(
    const EpisodeFilter& filter) {
  return Records<EpisodeStatistics>(Query(sql::plant_statistics, filter));
}

std::vector<DataGap> PlantReader::Gaps(const EpisodeFilter& filter) {
  return Records<DataGap>(Query(
      Replaced(std::string(sql::plant_gaps), "{columns}", ColumnsOf<DataGap>()),
      filter));
}

std::vector<CoverageTime> PlantReader::Coverage(const EpisodeFilter& filter) {
  return Records<CoverageTime>(Query(sql::plant_coverage, filter));
}

std::vector<Alarm> PlantReader::AlarmList(std::int64_t now_ns,
                                          std::int64_t limit) {
  // Both of a pair have an episode, so `limit` of them may take twice as many
  // rows.
  EpisodeFilter filter;
  filter.limit = 2 * limit;
  std::vector<Episode> episodes;
  std::set<std::uint64_t> seen;
  const auto by_time = [](const Episode& e) {
    return std::tie(e.detected_ns, e.valve_id);
  };
  const auto add_newest = [&](std::vector<Episode> rows) {
    std::ranges::stable_sort(rows, std::greater{}, by_time);
    for (Episode& row : rows) {
      if (std::ssize(episodes) < limit && seen.insert(row.id).second) {
        episodes.push_back(std::move(row));
      }
    }
  };
  // Open ones first: the limit must not leave them out for newer ones that have
  // ended.
  filter.state = EpisodeState::kOpen;
  add_newest(List(filter));
  filter.state = EpisodeState::kAny;
  add_newest(ListWhere(" AND e.unconfirmed_ns IS NOT NULL", filter));
  if (std::ssize(episodes) < limit) {
    filter.state = EpisodeState::kAlarmReturnedUnacked;
    add_newest(ListWhere(" AND e.end_reason IS NOT NULL", filter));
  }
  std::ranges::stable_sort(episodes, std::greater{}, by_time);
  return Alarms(std::move(episodes), now_ns);
}

std::vector<Shelf> PlantReader::Shelves(
    std::optional<std::int64_t> in_force_at_ns) {
  const auto at = in_force_at_ns
                      ? std::optional(std::to_string(*in_force_at_ns))
                      : std::nullopt;
  return Records<Shelf>(
      plant_.Run(SelectSql<Shelf>(sql::plant_shelves), {at, monitor_}));
}

std::vector<HealthHour> PlantReader::Health(const HealthFilter& filter) {
  const PlantRows rows =
      plant_.Run(sql::plant_health,
                 {filter.valve_id, std::to_string(HourFrom(filter.since_ns)),
                  std::to_string(HourFrom(filter.until_ns)), monitor_});
  std::vector<HealthHour> hours(static_cast<std::size_t>(rows.size()));
  for (int r = 0; r < rows.size(); ++r) {
    HealthHour& hour = hours[static_cast<std::size_t>(r)];
    hour.valve_id = filter.valve_id;
    Parse(rows.Text(r, 0), hour.hour);
    Parse(rows.Text(r, 1), hour.model_hash);
    Parse(rows.Text(r, 2), hour.epoch);
    Parse(rows.Text(r, 3), hour.live_ms);
    UnpackHealth(rows.Bytes(r, 4), hour);
    Parse(rows.Text(r, 5), hour.host);
    Parse(rows.Text(r, 6), hour.monitor);
  }
  return hours;
}

std::vector<std::string> PlantReader::HealthValves(const std::string& glob) {
  const PlantRows rows = plant_.Run(sql::plant_health_valves, {RegexOf(glob)});
  std::vector<std::string> valves;
  for (int r = 0; r < rows.size(); ++r) {
    valves.push_back(rows.Text(r, 0).value_or(""));
  }
  return valves;
}

// Each shipping sets its time.
std::string PlantReader::Version() {
  return plant_.Run("SELECT sum(shipped_ns) FROM monitor")
      .Text(0, 0)
      .value_or("");
}

// Episodes that touch the time: those that begin in it and those that are open
// at its beginning.
AlarmStatistics PlantReader::AlarmFigures(const EpisodeFilter& filter,
                                          std::int64_t now_ns) {
  EpisodeFilter any = filter;
  any.state = EpisodeState::kAny;
  any.since_ns = EpisodeFilter{}.since_ns;
  const PlantRows spans =
      Query(Replaced(std::string(sql::plant_spans), "{since}",
                     "'" + std::to_string(filter.since_ns) + "'::bigint"),
            any);
  return ComputeAlarmStatistics(Records<AlarmSpan>(spans), filter.since_ns,
                                filter.until_ns, now_ns);
}

}  // namespace fdi::storage
