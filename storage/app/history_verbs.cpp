#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/fault_catalogue.h"
#include "storage/app/common.h"
#include "storage/app/history_options.h"
#include "storage/app/verbs.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/history.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::FormatNumber;
using cli::Json;

Json OptionalJson(const std::optional<std::string>& text) {
  return text ? Json(*text) : Json();
}

// The columns of fault_history.
Json EpisodeJson(const Episode& episode) {
  return {{"episode_id", episode.episode_id},
          {"valve_id", episode.valve_id},
          {"detected_utc", episode.detected_utc},
          {"isolated_utc", OptionalJson(episode.isolated_utc)},
          {"cleared_utc", OptionalJson(episode.cleared_utc)},
          {"fault", OptionalJson(episode.fault)},
          {"peak_factor", episode.peak_factor},
          {"model_set", episode.model_set},
          {"end_reason", OptionalJson(episode.end_reason)},
          {"label", OptionalJson(episode.label)},
          {"acked_by", OptionalJson(episode.acked_by)}};
}

int List(const HistoryOptions& options, const Context& context) {
  const auto episodes =
      HistoryReader(DataOf(context).history()).List(options.Filter(context));
  if (context.options.json) {
    Json list = Json::array();
    for (const Episode& episode : episodes) {
      list.push_back(EpisodeJson(episode));
    }
    cli::PrintJson(std::cout, {{"episodes", list}});
    return cli::kExitOk;
  }
  cli::TextTable table({{"episode"},
                        {"valve"},
                        {"detected"},
                        {"isolated"},
                        {"cleared"},
                        {"fault"},
                        {"peak [-]", Align::kRight},
                        {"model set"},
                        {"end"},
                        {"label"},
                        {"acked by"}});
  for (const Episode& e : episodes) {
    table.AddRow({e.episode_id, e.valve_id, TimeText(e.detected_ns, context),
                  TimeText(e.isolated_ns, context),
                  TimeText(e.cleared_ns, context), e.fault.value_or("-"),
                  FormatNumber(e.peak_factor, 3), e.model_set,
                  e.end_reason.value_or("open"), e.label.value_or("-"),
                  e.acked_by.value_or("-")});
  }
  table.Print(std::cout);
  return cli::kExitOk;
}

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
  }
  return object;
}

// "unknown (outside_known)": why there is no name.
std::string FaultText(const Episode& e) {
  const std::string why = e.unknown_kind ? " (" + *e.unknown_kind + ")" : "";
  return e.fault ? *e.fault + why : "- (not isolated yet)" + why;
}

void PrintEpisode(const Episode& e, std::size_t instants,
                  const Context& context) {
  PrintFields(std::cout, {{"episode", e.episode_id},
                          {"valve", e.valve_id},
                          {"source", Hex(e.source_id)},
                          {"fault", FaultText(e)},
                          {"detected", TimeText(e.detected_ns, context)},
                          {"isolated", TimeText(e.isolated_ns, context)},
                          {"cleared", TimeText(e.cleared_ns, context)},
                          {"ended", TimeText(e.ended_ns, context) + " " +
                                        e.end_reason.value_or("(open)")},
                          {"peak factor", FormatNumber(e.peak_factor, 3)},
                          {"strength", FormatNumber(e.strength, 3)},
                          {"model set", e.model_set + " " + Hex(e.model_hash)},
                          {"label", e.label.value_or("-")},
                          {"acked by", e.acked_by.value_or("-")},
                          {"trace", std::to_string(instants) + " instants"}});
}

int Show(const std::string& id, const Context& context) {
  HistoryReader reader(DataOf(context).history());
  const Episode episode = reader.Show(id);
  const auto events = reader.Events(episode.id);
  const auto trace = reader.Trace(episode.id);
  if (context.options.json) {
    Json object = EpisodeJson(episode);
    object["source_id"] = Hex(episode.source_id);
    object["model_hash"] = Hex(episode.model_hash);
    object["strength"] = episode.strength;
    object["unknown_kind"] = OptionalJson(episode.unknown_kind);
    object["ended_utc"] = TimeJson(episode.ended_ns);
    object["trace_instants"] = trace.size();
    object["events"] = Json::array();
    for (const EpisodeEvent& event : events) {
      object["events"].push_back(EventJson(event));
    }
    cli::PrintJson(std::cout, object);
    return cli::kExitOk;
  }
  PrintEpisode(episode, trace.size(), context);
  cli::TextTable table({{"event"},
                        {"at"},
                        {"faults"},
                        {"factor [-]", Align::kRight},
                        {"strength [-]", Align::kRight},
                        {"note"}});
  for (const EpisodeEvent& event : events) {
    const bool by_hand = !event.who.empty();
    const std::string note =
        by_hand ? event.value + (event.value.empty() ? "" : " ") + "by " +
                      event.who +
                      (event.comment.empty() ? "" : ": " + event.comment)
                : event.reason;
    table.AddRow({event.kind, TimeText(event.stamp_ns, context), event.faults,
                  by_hand ? "" : FormatNumber(event.factor, 3),
                  by_hand ? "" : FormatNumber(event.strength, 3), note});
  }
  table.Print(std::cout);
  return cli::kExitOk;
}

Json StatisticsJson(const EpisodeStatistics& s) {
  const auto number = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json();
  };
  return {{"valve_id", s.valve_id},
          {"fault", s.fault.empty() ? Json() : Json(s.fault)},
          {"episodes", s.episodes},
          {"open", s.open},
          {"unacked", s.unacked},
          {"labelled_true", s.labelled_true},
          {"labelled_false", s.labelled_false},
          {"mean_isolation_s", number(s.mean_isolation_s)},
          {"mean_duration_s", number(s.mean_duration_s)},
          {"peak_factor", s.peak_factor},
          {"last_detected_utc", TimeJson(s.last_detected_ns)}};
}

int Statistics(const HistoryOptions& options, const Context& context) {
  HistoryReader reader(DataOf(context).history());
  const auto statistics = reader.Statistics(options.Filter(context));
  const auto gaps = reader.Gaps(options.Filter(context));
  const auto coverage = reader.Coverage(options.Filter(context));
  std::int64_t gap_ns = 0;
  for (const DataGap& gap : gaps) {
    gap_ns += gap.to_ns - gap.from_ns;
  }
  if (context.options.json) {
    Json list = Json::array();
    for (const EpisodeStatistics& s : statistics) {
      list.push_back(StatisticsJson(s));
    }
    cli::PrintJson(std::cout, {{"statistics", list},
                               {"hours", HoursJson(coverage)},
                               {"gaps", gaps.size()},
                               {"gaps_s", static_cast<double>(gap_ns) * 1e-9}});
    return cli::kExitOk;
  }
  cli::TextTable table({{"valve"},
                        {"fault"},
                        {"episodes", Align::kRight},
                        {"open", Align::kRight},
                        {"unacked", Align::kRight},
                        {"right", Align::kRight},
                        {"wrong", Align::kRight},
                        {"isolation [s]", Align::kRight},
                        {"duration [s]", Align::kRight},
                        {"peak [-]", Align::kRight},
                        {"last detected"}});
  for (const EpisodeStatistics& s : statistics) {
    const auto number = [](const std::optional<double>& value) {
      return value ? FormatNumber(*value, 1) : std::string("-");
    };
    table.AddRow({s.valve_id, s.fault.empty() ? "-" : s.fault,
                  std::to_string(s.episodes), std::to_string(s.open),
                  std::to_string(s.unacked), std::to_string(s.labelled_true),
                  std::to_string(s.labelled_false), number(s.mean_isolation_s),
                  number(s.mean_duration_s), FormatNumber(s.peak_factor, 3),
                  TimeText(s.last_detected_ns, context)});
  }
  table.Print(std::cout);
  PrintHours(std::cout, coverage);
  std::cout << gaps.size() << " data gaps, " << cli::FormatDuration(gap_ns)
            << " in all\n";
  return cli::kExitOk;
}

struct NoteOptions {
  std::string id;
  std::string label;
  std::string who{UserName()};
  std::string comment;
};

int Note(const NoteOptions& options, const Context& context) {
  const auto path = DataOf(context).history();
  HistoryReader reader(path);  // It must be there: an editor would make it.
  HistoryEditor editor(path);
  const OperatorNote note{options.who, options.comment, Origin(), cli::NowNs()};
  if (options.label.empty()) {
    editor.Acknowledge(options.id, note);
  } else {
    editor.Label(options.id, options.label, note);
  }
  const Episode episode = reader.Show(options.id);
  if (context.options.json) {
    cli::PrintJson(std::cout, EpisodeJson(episode));
  } else {
    std::cout << episode.episode_id
              << (options.label.empty()
                      ? " acknowledged by " + options.who
                      : " labelled " + episode.label.value_or(""))
              << '\n';
  }
  return cli::kExitOk;
}

CLI::App& AddNote(cli::Program& program, CLI::App& group, const char* name,
                  const char* description,
                  const std::shared_ptr<NoteOptions>& options) {
  CLI::App& verb = program.AddVerb(
      group, name, description,
      [options](const Context& c) { return Note(*options, c); });
  verb.add_option("episode", options->id,
                  "ID, a unique beginning of it, or last")
      ->required();
  verb.add_option("--by", options->who, "Who says so");
  verb.add_option("--comment", options->comment, "Why");
  return verb;
}

}  // namespace

void HistoryOptions::AddTo(CLI::App& verb) {
  verb.add_option("--valve", valve, "Glob over valve ids");
  verb.add_option("--fault", fault,
                  std::string(kFaultNames) + ", paper1..paper5 or unknown");
  window.AddTo(verb);
  verb.add_option("--state", state,
                  "any, open, detected, isolated, closed or unacked");
  verb.add_option("--limit", limit, "The newest so many; 0: all")
      ->check(CLI::NonNegativeNumber);
}

EpisodeFilter HistoryOptions::Filter(const Context& context) const {
  EpisodeFilter filter;
  filter.valve_glob = valve;
  filter.fault = fault;
  filter.since_ns = window.since_ns(context);
  filter.until_ns = window.until_ns(context);
  filter.state = ParseEpisodeState(state);
  filter.limit = limit;
  return filter;
}

void AddHistoryVerbs(cli::Program& program) {
  CLI::App& group = program.AddGroup("history", "Fault episodes");
  auto list_options = std::make_shared<HistoryOptions>();
  CLI::App& list = program.AddVerb(
      group, "list", "List the episodes",
      [list_options](const Context& c) { return List(*list_options, c); });
  list_options->AddTo(list);

  auto id = std::make_shared<std::string>();
  program
      .AddVerb(group, "show", "Show an episode and its events",
               [id](const Context& c) { return Show(*id, c); })
      .add_option("episode", *id, "ID, a unique beginning of it, or last")
      ->required();

  auto stats_options = std::make_shared<HistoryOptions>();
  CLI::App& stats =
      program.AddVerb(group, "stats", "Count episodes by valve and fault",
                      [stats_options](const Context& c) {
                        return Statistics(*stats_options, c);
                      });
  stats_options->AddTo(stats);

  AddNote(program, group, "ack", "Acknowledge an episode",
          std::make_shared<NoteOptions>());
  auto label = std::make_shared<NoteOptions>();
  AddNote(program, group, "label", "Say what an episode really was", label)
      .add_option("label", label->label, "true, false, or the fault it was")
      ->required();
}

}  // namespace fdi::storage
