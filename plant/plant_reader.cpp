#include "plant/plant_reader.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <map>
#include <set>
#include <tuple>
#include <type_traits>
#include <utility>

#include "base/printable.h"
#include "base/stamps.h"
#include "base/text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/records/valve_glob.h"
#include "plant/sql.h"
#include "storage/database/record.h"
#include "storage/history/history_reader.h"
#include "storage/history/trace.h"

namespace fdi::storage {
namespace sql = plant_sql;
namespace {

// ---- Values from PostgreSQL's text; NULL as Statement::Read() takes it. The
// schema checks what is written, but who owns it can lift its checks: a value
// that cannot be throws DataError, and Judged() leaves out its row.
[[noreturn]] void RefuseValue(const std::string& text, const char* what) {
  throw DataError("'" + Printable(text) + "' is " + what);
}

void Parse(const std::optional<std::string>& text, std::string& field) {
  field = text.value_or("");
}
void Parse(const std::optional<std::string>& text, double& field) {
  field = text ? std::strtod(text->c_str(), nullptr) : 0.0;
  if (!std::isfinite(field)) {
    RefuseValue(*text, "not finite");
  }
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
        RefuseValue(text.value_or(""), "unknown");
      }
    }
    field = static_cast<T>(i);
  } else {
    // Hashes use all bits, and the sign for the first.
    const auto value = ParseWhole<std::int64_t>(text.value_or("0"));
    if (!value) {
      RefuseValue(*text, "no whole number of 64 bits");
    }
    field = static_cast<T>(*value);
  }
}
template <typename T>
void Parse(const std::optional<std::string>& text, std::optional<T>& field) {
  field.reset();
  if (text) {
    Parse(text, field.emplace());
  }
}

// Parse() of the column `name`. A stamp has a name that ends with _ns.
template <typename T>
void ParseColumn(std::string_view name, const std::optional<std::string>& text,
                 T& field) {
  try {
    Parse(text, field);
    if constexpr (std::is_same_v<T, std::int64_t> ||
                  std::is_same_v<T, std::optional<std::int64_t>>) {
      const std::optional<std::int64_t> value = field;
      if (name.ends_with("_ns") && value && !IsStamp(*value)) {
        RefuseValue(*text, "outside the years 1900 to 2149");
      }
    }
  } catch (const DataError& error) {
    throw DataError(std::string(name) + " " + error.what());
  }
}

template <typename Record>
Record RecordAt(const PlantRows& rows, int row) {
  Record record;
  std::apply(
      [&](const auto&... field) {
        int column = 0;
        (ParseColumn(field.name, rows.Text(row, column++), field(record)), ...);
      },
      kFieldsOf<Record>);
  return record;
}

// Converts each row by `read`; @returns how many it refuses, by reason.
template <typename Record, typename Read>
std::map<std::string, std::int64_t> ReadRows(const PlantRows& rows,
                                             std::vector<Record>& records,
                                             const Read& read) {
  std::map<std::string, std::int64_t> refused;
  for (int r = 0; r < rows.size(); ++r) {
    try {
      records.push_back(read(r));
    } catch (const DataError& error) {
      ++refused[error.what()];
    } catch (const ConfigError& error) {  // An unknown name of a fault.
      ++refused[error.what()];
    }
  }
  return refused;
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

EpisodeLook LookOf(std::uint64_t episode_id, const PlantRows& header,
                   const PlantRows& faults, const PlantRows& simulated) {
  EpisodeLook look;
  look.episode_id = episode_id;
  ParseColumn("first_ns", header.Text(0, 0), look.first_ns);
  ParseColumn("period", header.Text(0, 1), look.period_ns);
  ParseColumn("misfit", header.Text(0, 2), look.misfit);
  if (const auto rival = header.Text(0, 3)) {
    look.rival = LookRival{RequireFinding(*rival), 1.0};
    ParseColumn("times", header.Text(0, 4), look.rival->times);
  }
  for (const std::string& name : SplitNames(header.Text(0, 5).value_or(""))) {
    look.observers.push_back(RequireFinding(name));
  }
  if (look.period_ns <= 0 || look.period_ns > kNsPerDay) {
    RefuseValue(std::to_string(look.period_ns), "no period");
  }
  for (int r = 0; r < faults.size(); ++r) {
    LookFault& f = look.faults.emplace_back();
    f.fault = RequireFinding(faults.Text(r, 0).value_or(""));
    ParseColumn("strength", faults.Text(r, 1), f.strength);
    ParseColumn("lowest", faults.Text(r, 2), f.lowest);
    ParseColumn("highest", faults.Text(r, 3), f.highest);
    ParseColumn("begins_ns", faults.Text(r, 4), f.begins_ns);
    ParseColumn("growing", faults.Text(r, 5), f.growing);
  }
  for (int r = 0; r < simulated.size(); ++r) {
    ParseColumn("x_pct", simulated.Text(r, 0), look.x_pct.emplace_back());
    ParseColumn("flow", simulated.Text(r, 1), look.flow.emplace_back());
  }
  return look;
}

}  // namespace

template <typename Record, typename Read>
std::vector<Record> PlantReader::Judged(const char* what, const PlantRows& rows,
                                        const Read& read) {
  std::vector<Record> records;
  for (const auto& [reason, count] : ReadRows(rows, records, read)) {
    LeaveOut(count, std::string(what) + ": " + reason);
  }
  return records;
}

template <typename Record>
std::vector<Record> PlantReader::Judged(const char* what,
                                        const PlantRows& rows) {
  return Judged<Record>(what, rows,
                        [&rows](int r) { return RecordAt<Record>(rows, r); });
}

PlantReader::PlantReader(const std::string& url, std::string monitor,
                         PlantLimits limits)
    : plant_(url, std::move(limits)), monitor_(std::move(monitor)) {}

PlantReader::~PlantReader() {
  if (const std::string note = TakeNote(); log_ && !note.empty()) {
    log_(LogLevel::kWarning,
         EventLine("plant_rows_left_out", {{"reason", note}}));
  }
}

void PlantReader::SayTo(LogSink log) {
  log_ = std::move(log);
  plant_.SayTo(log_);
}

void PlantReader::FinishWithin(std::chrono::milliseconds time) {
  plant_.FinishBy(std::chrono::steady_clock::now() + time);
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
  // For tables without episodes.
  const std::string valve = IsGlob(filter.valve_glob)
                                ? "valve_id ~ $1"
                                : "($1 = '*' OR valve_id = $1)";
  return plant_.Read(
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
  return plant_.Read(
      std::string(sql) + " " + std::string(sql::of_episode) + order,
      {EpisodeIdText(episode_id), monitor_});
}

std::vector<Episode> PlantReader::List(const EpisodeFilter& filter) {
  return ListWhere("", filter);
}

std::vector<Episode> PlantReader::ListWhere(const std::string& more,
                                            const EpisodeFilter& filter) {
  const std::string list =
      Replaced(std::string(sql::plant_list), "{episodes}", "{episodes}" + more);
  // Rows that are left out count for the limit: more are asked for until there
  // are enough good ones.
  for (std::int64_t limit = filter.limit;; limit *= 2) {
    const PlantRows rows = Query(
        Replaced(list, "{limit}", limit > 0 ? std::to_string(limit) : "ALL"),
        filter);
    std::vector<Episode> episodes;
    const auto refused = ReadRows(rows, episodes, [&rows](int r) {
      auto episode = RecordAt<Episode>(rows, r);
      const auto id = ParseEpisodeId(episode.episode_id);
      if (!id) {
        RefuseValue(episode.episode_id, "no episode_id");
      }
      episode.id = *id;
      episode.host = rows.Text(r, rows.columns() - 2).value_or("");
      episode.monitor = rows.Text(r, rows.columns() - 1).value_or("");
      return episode;
    });
    const std::int64_t too_many = std::ssize(episodes) - filter.limit;
    if (limit <= 0 || too_many >= 0 || rows.size() < limit) {
      for (const auto& [reason, count] : refused) {
        LeaveOut(count, "episode: " + reason);
      }
      if (limit > 0 && too_many > 0) {  // They are the oldest.
        episodes.erase(episodes.begin(), episodes.begin() + too_many);
      }
      return episodes;
    }
  }
}

Episode PlantReader::Show(std::string_view id) {
  if (id == "last") {
    EpisodeFilter newest;
    newest.limit = 1;
    const std::vector<Episode> last = List(newest);
    if (last.empty()) {
      throw NotFoundError("episode 'last' is not in " + plant_.name());
    }
    return Show(last.front().episode_id);
  }
  const PlantRows found =
      plant_.Read(sql::plant_by_prefix, {std::string(id), monitor_});
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
  const std::vector<Episode> shown =
      ListWhere(" AND e.episode_id = '" + EpisodeIdText(*only) + "'", {});
  if (shown.empty()) {
    throw DataError(plant_.name() + ": " + TakeNote());
  }
  return shown.front();
}

std::vector<HistoryEntry> PlantReader::Events(std::uint64_t episode_id) {
  return Judged<HistoryEntry>(
      "event", QueryEpisode(SelectSql<HistoryEntry>("FROM episode_event WHERE"),
                            episode_id, " ORDER BY event_id"));
}

std::optional<EpisodeLook> PlantReader::Look(std::uint64_t episode_id) {
  const PlantRows header = QueryEpisode(sql::plant_look, episode_id);
  if (header.size() == 0) {
    return std::nullopt;
  }
  const PlantRows rows =
      QueryEpisode(sql::plant_look_faults, episode_id, " ORDER BY rank");
  const PlantRows simulated =
      QueryEpisode(sql::plant_look_rows, episode_id, " ORDER BY row");
  // A look with a part left out would say something else.
  const auto looks = Judged<EpisodeLook>(
      "second look", header,
      [&](int /*row*/) { return LookOf(episode_id, header, rows, simulated); });
  return looks.empty() ? std::nullopt : std::optional(looks.front());
}

std::vector<StrengthPoint> PlantReader::Strengths(std::uint64_t episode_id) {
  const PlantRows rows = QueryEpisode(sql::plant_strengths, episode_id,
                                      " ORDER BY stamp_ns, fault");
  return Judged<StrengthPoint>("strength", rows, [&](int r) {
    StrengthPoint p;
    p.episode_id = episode_id;
    p.fault = RequireFinding(rows.Text(r, 0).value_or(""));
    ParseColumn("stamp_ns", rows.Text(r, 1), p.stamp_ns);
    ParseColumn("strength", rows.Text(r, 2), p.strength);
    ParseColumn("lowest", rows.Text(r, 3), p.lowest);
    ParseColumn("highest", rows.Text(r, 4), p.highest);
    p.layer = ParseLayer(rows.Text(r, 5).value_or(""));
    return p;
  });
}

std::vector<TracePoint> PlantReader::Trace(std::uint64_t episode_id) {
  const PlantRows rows =
      QueryEpisode(sql::plant_trace, episode_id, " ORDER BY chunk");
  const std::string name =
      plant_.name() + ": trace of " + EpisodeIdText(episode_id);
  const auto chunks =
      Judged<std::vector<TracePoint>>("evidence", rows, [&](int r) {
        TraceChunk chunk;
        Parse(rows.Text(r, 0), chunk.samples.codec);
        Parse(rows.Text(r, 1), chunk.samples.crc);
        Parse(rows.Text(r, 2), chunk.samples.count);
        chunk.samples.bytes = rows.Bytes(r, 3);
        Parse(rows.Text(r, 4), chunk.vector_crc);
        chunk.vectors = rows.Bytes(r, 5);
        return DecodeTrace(chunk, name);
      });
  std::vector<TracePoint> trace;
  for (const auto& chunk : chunks) {
    trace.insert(trace.end(), chunk.begin(), chunk.end());
  }
  return trace;
}

// Rows that their sums leave out are counted by a query of their own.
void PlantReader::CountUnsound(const char* what, std::string_view sql,
                               std::string_view sound,
                               const EpisodeFilter& filter) {
  const std::int64_t rows =
      Query(Replaced(std::string(sql), "{sound}", sound), filter).Int64(0, 0);
  if (rows > 0) {
    LeaveOut(rows, std::string(what) + ": a number is out of its range");
  }
}

std::vector<DataGap> PlantReader::Gaps(const EpisodeFilter& filter) {
  return Judged<DataGap>(
      "data gap", Query(Replaced(std::string(sql::plant_gaps), "{columns}",
                                 ColumnsOf<DataGap>()),
                        filter));
}

std::vector<CoverageTime> PlantReader::Coverage(const EpisodeFilter& filter) {
  CountUnsound("hours by quality", sql::plant_unsound_days,
               sql::plant_sound_day, filter);
  return Judged<CoverageTime>("hours by quality",
                              Query(Replaced(std::string(sql::plant_coverage),
                                             "{sound}", sql::plant_sound_day),
                                    filter));
}

std::vector<Alarm> PlantReader::AlarmList(std::int64_t now_ns,
                                          std::int64_t limit) {
  // An episode that moved with its valve has a row of both monitors, so `limit`
  // episodes may take twice as many rows.
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
    std::optional<std::int64_t> not_over_at_ns) {
  const auto at = not_over_at_ns
                      ? std::optional(std::to_string(*not_over_at_ns))
                      : std::nullopt;
  return Judged<Shelf>(
      "shelf",
      plant_.Read(SelectSql<Shelf>(sql::plant_shelves), {at, monitor_}));
}

std::vector<HealthHour> PlantReader::Health(const HealthFilter& filter) {
  const PlantRows rows =
      plant_.Read(sql::plant_health,
                  {filter.valve_id, std::to_string(HourFrom(filter.since_ns)),
                   std::to_string(HourFrom(filter.until_ns)), monitor_});
  return Judged<HealthHour>("hour of health", rows, [&](int r) {
    HealthHour hour;
    hour.valve_id = filter.valve_id;
    ParseColumn("hour", rows.Text(r, 0), hour.hour);
    ParseColumn("model_hash", rows.Text(r, 1), hour.model_hash);
    ParseColumn("epoch", rows.Text(r, 2), hour.epoch);
    ParseColumn("live_ms", rows.Text(r, 3), hour.live_ms);
    if (hour.hour < kFirstStampNs / kNsPerHour ||
        hour.hour > kLastStampNs / kNsPerHour) {
      RefuseValue(std::to_string(hour.hour), "no hour");
    }
    UnpackHealth(rows.Bytes(r, 4), hour);
    Parse(rows.Text(r, 5), hour.host);
    Parse(rows.Text(r, 6), hour.monitor);
    return hour;
  });
}

std::vector<std::string> PlantReader::HealthValves(const std::string& glob) {
  const PlantRows rows = plant_.Read(sql::plant_health_valves, {RegexOf(glob)});
  std::vector<std::string> valves;
  for (int r = 0; r < rows.size(); ++r) {
    valves.push_back(rows.Text(r, 0).value_or(""));
  }
  return valves;
}

std::vector<CommonCause> PlantReader::Causes(std::int64_t since_ns) {
  const PlantRows rows =
      plant_.Read(sql::plant_causes, {std::to_string(since_ns)});
  struct Row {
    std::string monitor;
    CommonCause cause;  // With one member.
  };
  const auto read = [&rows](int r) {
    Row row;
    row.monitor = rows.Text(r, 0).value_or("");
    row.cause.cause_id = rows.Text(r, 1).value_or("");
    row.cause.group = rows.Text(r, 2).value_or("");
    ParseColumn("opened_ns", rows.Text(r, 3), row.cause.opened_ns);
    ParseColumn("ended_ns", rows.Text(r, 4), row.cause.ended_ns);
    CauseMember& member = row.cause.members.emplace_back();
    member.episode_id = rows.Text(r, 5).value_or("");
    member.valve_id = rows.Text(r, 6).value_or("");
    member.fault = rows.Text(r, 7).value_or("");
    ParseColumn("isolated_ns", rows.Text(r, 8), member.isolated_ns);
    ParseColumn("ended_ns", rows.Text(r, 9), member.ended_ns);
    return row;
  };
  std::vector<CommonCause> causes;
  std::string last;  // Monitor and cause.
  for (Row& row : Judged<Row>("common cause", rows, read)) {
    const std::string key = row.monitor + ' ' + row.cause.cause_id;
    if (std::exchange(last, key) == key) {
      causes.back().members.push_back(std::move(row.cause.members.front()));
    } else {
      causes.push_back(std::move(row.cause));
    }
  }
  return causes;
}

std::map<std::string, std::int64_t> PlantReader::SeenValves(
    std::int64_t since_ns) {
  const PlantRows rows =
      plant_.Read(sql::plant_seen, {std::to_string(since_ns / kNsPerHour)});
  std::map<std::string, std::int64_t> seen;
  for (int r = 0; r < rows.size(); ++r) {
    seen[rows.Text(r, 0).value_or("")] = rows.Int64(r, 1) * kNsPerHour;
  }
  return seen;
}

// Each shipping sets its time.
std::string PlantReader::Version() {
  return plant_.Read("SELECT sum(shipped_ns) FROM monitor")
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
  return ComputeAlarmStatistics(Judged<AlarmSpan>("episode", spans),
                                filter.since_ns, filter.until_ns, now_ns);
}

}  // namespace fdi::storage
