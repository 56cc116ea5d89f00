#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/app/episode_text.h"
#include "storage/app/history_options.h"
#include "storage/app/verbs.h"
#include "storage/cli/fault_texts.h"
#include "storage/cli/time_text.h"
#include "storage/history.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::FormatNumber;

struct ListOptions {
  HistoryOptions filter;
  bool csv{false};
};

// "20 s", or "-" while it has not happened.
std::string After(std::int64_t from_ns, std::optional<std::int64_t> to_ns) {
  return to_ns ? cli::FormatDuration(*to_ns - from_ns) : "-";
}

void PrintAlarms(const std::vector<Alarm>& alarms, const Context& context) {
  const cli::FaultTexts texts = cli::LoadFaultTexts(context.options);
  cli::TextTable table({{"episode"},
                        {"valve"},
                        {"detected"},
                        {"alarm"},
                        {"fault"},
                        {"which is", Align::kLeft, 2},
                        {"peak [-]", Align::kRight, 4},
                        {"isolated after", Align::kRight, 5},
                        {"lasted", Align::kRight, 3},
                        {"end", Align::kLeft, 1},
                        {"label", Align::kLeft, 6},
                        {"acked by", Align::kLeft, 7},
                        {"model set", Align::kLeft, 8}});
  for (const Alarm& alarm : alarms) {
    const Episode& e = alarm.episode;
    const AlarmState state = ShownState(alarm);
    table.AddRow(
        {e.episode_id, e.valve_id, TimeText(e.detected_ns, context),
         std::string(AlarmStateName(state)), e.fault.value_or("-"),
         e.fault ? texts.Words(*e.fault, e.strength).name : "-",
         FormatNumber(e.peak_factor, 3), After(e.detected_ns, e.isolated_ns),
         After(e.detected_ns, e.ended_ns), e.end_reason.value_or("open"),
         e.label.value_or("-"), e.acked_by.value_or("-"), e.model_set});
    table.SetTone(3, ToneOf(state));
  }
  table.Print(std::cout, cli::StdoutStyle());
  if (table.empty()) {
    std::cout << "no episode matches\n";
  }
}

int List(const ListOptions& options, const Context& context) {
  if (options.csv && context.options.json) {
    throw ConfigError("--csv and --json exclude each other");
  }
  HistoryReader reader(DataOf(context).history());
  auto episodes = reader.List(options.filter.Filter(context));
  if (options.csv) {
    WriteEpisodes(episodes, std::cout);
  } else if (context.options.json) {
    cli::PrintJson(std::cout, EpisodesJson(episodes));
  } else {
    PrintAlarms(reader.Alarms(std::move(episodes), cli::NowNs()), context);
  }
  return cli::kExitOk;
}

}  // namespace

void HistoryOptions::AddTo(CLI::App& verb) {
  verb.add_option("--valve", valve, "Glob over valve ids: 'FV-1*'");
  verb.add_option("--fault", fault,
                  std::string(kFaultNames) + ", paper1..paper5 or unknown");
  window.AddTo(verb);
  verb.add_option("--state", state,
                  "any; of the episode open, detected, isolated or closed; of "
                  "the alarm unack, acked, rtn_unack, normal or shelved; "
                  "unacked: unack or rtn_unack");
  verb.add_option("--limit", limit, "The newest so many; 0: all")
      ->check(CLI::NonNegativeNumber);
}

EpisodeFilter HistoryOptions::Filter(const Context& context) const {
  if (!fault.empty() && fault != "unknown" && !ParseFault(fault)) {
    throw ConfigError("--fault: unknown fault '" + fault + "'" +
                      DidYouMeanFault(fault, {"unknown"}) + ": expected " +
                      std::string(kFaultNames) + ", paper1..paper5 or unknown");
  }
  EpisodeFilter filter;
  filter.valve_glob = valve;
  filter.fault = fault;
  filter.since_ns = window.since_ns(context);
  filter.until_ns = window.until_ns(context);
  filter.state = ParseEpisodeState(state);
  filter.limit = limit;
  filter.now_ns = cli::NowNs();
  return filter;
}

void AddEpisode(CLI::App& verb, std::string& id, bool required) {
  verb.add_option("episode", id, "ID, a unique beginning of it, or last")
      ->required(required);
}

void AddHistoryLists(cli::Program& program, CLI::App& group) {
  auto options = std::make_shared<ListOptions>();
  CLI::App& list = program.AddVerb(
      group, "list", "List the episodes, the newest last",
      [options](const Context& c) { return List(*options, c); });
  options->filter.AddTo(list);
  list.add_flag("--csv", options->csv, "The columns of fault_history as CSV");
}

void AddHistoryVerbs(cli::Program& program) {
  CLI::App& group = program.AddGroup(
      "history", "Fault episodes: what happened, how sure, who knows of it");
  AddHistoryLists(program, group);
  AddHistoryShow(program, group);
  AddHistoryStatistics(program, group);
  AddHistoryActions(program, group);
  AddHistoryShelf(program, group);
}

}  // namespace fdi::storage
