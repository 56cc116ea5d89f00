#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "storage/app/episode_text.h"
#include "storage/app/history_options.h"
#include "storage/cli/fault_texts.h"
#include "storage/cli/time_text.h"
#include "storage/history.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::FormatNumber;
using cli::Json;

Json EventJson(const EpisodeEvent& event) {
  Json object = {{"kind", event.kind},
                 {"stamp_utc", TimeJson(event.stamp_ns)},
                 {"recorded_utc", TimeJson(event.recorded_ns)}};
  if (event.who.empty()) {
    object["faults"] = event.faults;
    object["factor"] = event.factor;
    object["strength"] = event.strength;
    object["reason"] = event.reason;
  } else {
    object["who"] = event.who;
    object["value"] = event.value;
    object["comment"] = event.comment;
    object["origin"] = event.origin;
  }
  return object;
}

Json ShownJson(const Alarm& alarm, const std::vector<EpisodeEvent>& events,
               std::size_t instants) {
  const Episode& episode = alarm.episode;
  Json object = EpisodeJson(episode);
  object["source_id"] = Hex(episode.source_id);
  object["model_hash"] = Hex(episode.model_hash);
  object["strength"] = episode.strength;
  object["unknown_kind"] =
      episode.unknown_kind ? Json(*episode.unknown_kind) : Json();
  object["ended_utc"] = TimeJson(episode.ended_ns);
  object["acked_utc"] = TimeJson(episode.acked_ns);
  object["alarm_state"] = AlarmStateName(alarm.state);
  object["shelf"] = alarm.shelf ? ShelfJson(*alarm.shelf) : Json();
  object["trace_instants"] = instants;
  object["events"] = Json::array();
  for (const EpisodeEvent& event : events) {
    object["events"].push_back(EventJson(event));
  }
  return object;
}

// "f19: Flow transmitter wrong", "unknown (outside_known): ...".
std::string FaultLine(const Episode& e, const std::string& name) {
  const std::string why = e.unknown_kind ? " (" + *e.unknown_kind + ")" : "";
  return e.fault ? *e.fault + why + ": " + name : "- (not isolated yet)" + why;
}

std::string AlarmLine(const Alarm& alarm, const Context& context) {
  std::string line(AlarmStateName(alarm.state));
  if (alarm.shelf) {
    const Shelf& shelf = *alarm.shelf;
    line += ", shelved by " + shelf.who + " until " +
            TimeText(shelf.until_ns, context) +
            (shelf.comment.empty() ? "" : ": " + shelf.comment);
  }
  return line;
}

void PrintEpisode(const Alarm& alarm, std::size_t instants,
                  const Context& context) {
  const Episode& e = alarm.episode;
  const cli::FaultWords words = cli::LoadFaultTexts(context.options)
                                    .Words(e.fault.value_or(""), e.strength);
  const auto after = [&e](std::optional<std::int64_t> stamp_ns) {
    return stamp_ns
               ? ", after " + cli::FormatDuration(*stamp_ns - e.detected_ns)
               : std::string();
  };
  PrintFields(
      std::cout,
      {{"episode", e.episode_id},
       {"valve", e.valve_id},
       {"source", Hex(e.source_id)},
       {"fault", FaultLine(e, words.name)},
       {"check", words.check},
       {"severity", std::string(SeverityName(words.severity)) + " (" +
                        words.discipline + "; NAMUR NE 107 " +
                        std::string(NamurName(words.namur)) + ")"},
       {"alarm", AlarmLine(alarm, context)},
       {"detected", TimeText(e.detected_ns, context)},
       {"isolated", TimeText(e.isolated_ns, context) + after(e.isolated_ns)},
       {"cleared", TimeText(e.cleared_ns, context) + after(e.cleared_ns)},
       {"ended",
        TimeText(e.ended_ns, context) + " " + e.end_reason.value_or("(open)")},
       {"peak factor", FormatNumber(e.peak_factor, 3)},
       {"strength", FormatNumber(e.strength, 3)},
       {"model set", e.model_set + " " + Hex(e.model_hash)},
       {"label", e.label.value_or("-")},
       {"acked by", e.acked_by.value_or("-")},
       {"trace", std::to_string(instants) + " instants"}});
}

std::string Note(const EpisodeEvent& event) {
  if (event.who.empty()) {
    return event.reason;
  }
  return event.value + (event.value.empty() ? "" : " ") + "by " + event.who +
         (event.origin.empty() ? "" : " (" + event.origin + ")") +
         (event.comment.empty() ? "" : ": " + event.comment);
}

void PrintEvents(const std::vector<EpisodeEvent>& events,
                 const Context& context) {
  cli::TextTable table({{"event"},
                        {"at"},
                        {"faults"},
                        {"factor [-]", Align::kRight},
                        {"strength [-]", Align::kRight},
                        {"note"}});
  for (const EpisodeEvent& event : events) {
    const bool by_hand = !event.who.empty();
    table.AddRow({event.kind, TimeText(event.stamp_ns, context), event.faults,
                  by_hand ? "" : FormatNumber(event.factor, 3),
                  by_hand ? "" : FormatNumber(event.strength, 3), Note(event)});
  }
  table.Print(std::cout, cli::StdoutStyle());
}

int Show(const std::string& id, const Context& context) {
  HistoryReader reader(DataOf(context).history());
  const Alarm alarm = reader.Alarms({reader.Show(id)}, cli::NowNs()).front();
  const auto events = reader.Events(alarm.episode.id);
  const std::size_t instants = reader.Trace(alarm.episode.id).size();
  if (context.options.json) {
    cli::PrintJson(std::cout, ShownJson(alarm, events, instants));
  } else {
    PrintEpisode(alarm, instants, context);
    PrintEvents(events, context);
  }
  return cli::kExitOk;
}

}  // namespace

void AddHistoryShow(cli::Program& program, CLI::App& group) {
  auto id = std::make_shared<std::string>();
  AddEpisode(program.AddVerb(group, "show",
                             "Show an episode, what to check, and its events",
                             [id](const Context& c) { return Show(*id, c); }),
             *id);
}

}  // namespace fdi::storage
