#include "report/plot/episode_text.h"

#include <string_view>
#include <utility>

#include "base/time_text.h"
#include "report/text_table.h"
#include "storage/history/certainty.h"

namespace fdi::plot {
namespace {

using report::Column;
using report::Json;
using storage::Alarm;
using storage::Episode;

std::string ShownTime(std::optional<std::int64_t> stamp_ns, bool utc) {
  return stamp_ns ? FormatTime(*stamp_ns, utc) : "-";
}

Column Field(std::string heading, std::string text) {
  Column column;
  column.heading = std::move(heading);
  column.text = [text = std::move(text)](const Json&) { return text; };
  column.wraps = true;
  return column;
}

// "likely: Flow transmitter wrong (f19), named by simulation of the valve: f19
// explains it 40 times better than f2, the observers agree"
std::string FaultLine(const Episode& e, const std::string& name) {
  std::string line(CertaintyName(storage::CertaintyOf(e)));
  line += ": " + name;
  if (!storage::IsNamed(e)) {
    return line;
  }
  line += " (" + *e.fault + ")";
  for (const std::string& other : storage::LookAlikesOf(e)) {
    line += " or " + other;
  }
  if (const std::string witness = storage::WitnessText(e); !witness.empty()) {
    line += ", " + witness;
  }
  if (e.second) {
    line += ", and " + (*e.second == "unknown" ? "a second fault without a name"
                                               : *e.second);
  }
  return line;
}

std::string AlarmLine(const Alarm& alarm, bool utc) {
  std::string line(AlarmStateName(alarm.state));
  if (const auto since = alarm.episode.unconfirmed_ns) {
    line += ", not confirmed since " + ShownTime(since, utc);
  }
  if (alarm.shelf) {
    const storage::Shelf& shelf = *alarm.shelf;
    line += ", shelved by " + shelf.who + " until " +
            ShownTime(shelf.until_ns, utc) +
            (shelf.comment.empty() ? "" : ": " + shelf.comment);
  }
  return line;
}

// "0.42 (0.38 to 0.46), 0.55 at its worst"
std::string StrengthLine(const Episode& e) {
  if (!storage::IsNamed(e)) {
    return "-";
  }
  std::string line = e.lowest && e.highest
                         ? IntervalText(e.strength, *e.lowest, *e.highest, 3)
                         : report::FormatNumber(e.strength, 3);
  if (e.worst_strength && *e.worst_strength != e.strength) {
    line += ", " + report::FormatNumber(*e.worst_strength, 3) + " at its worst";
  }
  return line;
}

// "by anna at 2026-11-20T15:02:11+01:00: on my way"
std::string AckLine(const Episode& e, bool utc) {
  return !e.acked_by
             ? "-"
             : "by " + *e.acked_by + " at " + ShownTime(e.acked_ns, utc) +
                   (e.ack_comment ? ": " + *e.ack_comment : "");
}

}  // namespace

std::string IntervalText(double value, double lowest, double highest,
                         int decimals, const std::string& unit) {
  const auto number = [decimals](double x) {
    return report::FormatNumber(x, decimals);
  };
  const std::string from = number(lowest);
  const std::string to = number(highest);
  return number(value) + unit +
         (lowest < highest && from != to ? " (" + from + " to " + to + ")"
                                         : "");
}

std::vector<Column> EpisodeFields(const Alarm& alarm,
                                  const report::FaultTexts& texts, bool utc) {
  const Episode& e = alarm.episode;
  const report::FaultWords words =
      texts.Words(e.fault.value_or(""), e.strength, e.priority);
  const auto when = [&](std::optional<std::int64_t> stamp_ns) {
    return ShownTime(stamp_ns, utc) +
           (stamp_ns ? ", after " + FormatDuration(*stamp_ns - e.detected_ns)
                     : "");
  };
  return {{"episode", "episode_id"},
          {"valve", "valve_id"},
          {"source", "source_id"},
          Field("fault", FaultLine(e, PlainName(e, texts))),
          Field("check", words.check),
          Field("severity", std::string(SeverityName(words.severity)) +
                                ", priority " +
                                std::to_string(PriorityOf(words.severity)) +
                                " (" + words.discipline + "; NAMUR NE 107 " +
                                std::string(NamurName(words.namur)) + ")"),
          Field("alarm", AlarmLine(alarm, utc)),
          {"detected", "detected_utc", report::Format::kTime},
          Field("named",
                when(e.isolated_ns) + (e.isolated_ns && !storage::IsNamed(e)
                                           ? ", withdrawn since"
                                           : "")),
          Field("cleared", when(e.cleared_ns)),
          Field("ended", ShownTime(e.ended_ns, utc) + " " +
                             e.end_reason.value_or("(open)")),
          Field("strength", StrengthLine(e)),
          Field("model set",
                e.model_set + " " + storage::EpisodeIdText(e.model_hash)),
          {"label", "label"},
          Field("acknowledged", AckLine(e, utc)),
          {.heading = "trace", .text = [](const Json& episode) {
             return episode["trace_instants"].dump() + " instants";
           }}};
}

std::string PlainName(const Episode& episode, const report::FaultTexts& texts) {
  const std::string_view no_name = storage::NoNameText(episode);
  return no_name.empty() ? texts.Words(episode.fault.value_or(""), 0.0).name
                         : std::string(no_name);
}

}  // namespace fdi::plot
