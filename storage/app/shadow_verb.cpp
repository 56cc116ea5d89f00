#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/app/common.h"
#include "storage/app/episode_text.h"
#include "storage/app/verbs.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/history.h"
#include "storage/shadow.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::Json;

struct ShadowOptions {
  std::string valve{"*"};
  std::string candidate;
  TimeWindow window;
  std::int64_t limit{0};
  bool csv{false};
};

// "ISOLATED f1|f7", "NORMAL".
std::string AnswerText(const std::string& state, const std::string& fault) {
  return fault.empty() ? state : state + " " + fault;
}

Json FaultJson(const std::string& fault) {
  return fault.empty() ? Json() : Json(fault);
}

void PrintShadowJson(const std::vector<ShadowDifference>& stretches) {
  Json list = Json::array();
  for (const ShadowDifference& d : stretches) {
    list.push_back({{"valve_id", d.valve_id},
                    {"source_id", Hex(d.source_id)},
                    {"from_utc", TimeJson(d.from_ns)},
                    {"to_utc", TimeJson(d.to_ns)},
                    {"samples", d.samples},
                    {"active",
                     {{"model_set", d.active_set},
                      {"model_hash", Hex(d.active_hash)},
                      {"state", d.active_state},
                      {"fault", FaultJson(d.active_fault)}}},
                    {"candidate",
                     {{"model_set", d.candidate_set},
                      {"model_hash", Hex(d.candidate_hash)},
                      {"state", d.candidate_state},
                      {"fault", FaultJson(d.candidate_fault)}}}});
  }
  cli::PrintJson(std::cout, {{"differences", std::move(list)}});
}

void PrintShadowCsv(const std::vector<ShadowDifference>& stretches) {
  std::cout << "valve_id,from_utc,to_utc,samples,active_set,active_state,"
               "active_fault,candidate_set,candidate_state,candidate_fault\n";
  for (const ShadowDifference& d : stretches) {
    std::cout << CsvCell(d.valve_id) << ',' << cli::FormatTime(d.from_ns, true)
              << ',' << cli::FormatTime(d.to_ns, true) << ',' << d.samples
              << ',' << d.active_set << ',' << d.active_state << ','
              << d.active_fault << ',' << d.candidate_set << ','
              << d.candidate_state << ',' << d.candidate_fault << '\n';
  }
}

void PrintShadow(const std::vector<ShadowDifference>& stretches,
                 const Context& context) {
  cli::TextTable table({{"valve"},
                        {"from"},
                        {"lasted", Align::kRight},
                        {"samples", Align::kRight},
                        {"active"},
                        {"said"},
                        {"candidate"},
                        {"said"}});
  std::int64_t time_ns = 0;
  for (const ShadowDifference& d : stretches) {
    time_ns += d.to_ns - d.from_ns;
    table.AddRow({d.valve_id, TimeText(d.from_ns, context),
                  cli::FormatDuration(d.to_ns - d.from_ns),
                  std::to_string(d.samples), d.active_set,
                  AnswerText(d.active_state, d.active_fault), d.candidate_set,
                  AnswerText(d.candidate_state, d.candidate_fault)});
  }
  if (table.empty()) {
    std::cout << "no difference is recorded\n";
    return;
  }
  table.Print(std::cout);
  std::cout << stretches.size()
            << (stretches.size() == 1 ? " stretch, " : " stretches, ")
            << cli::FormatDuration(time_ns) << " in all\n";
}

int Shadow(const ShadowOptions& options, const Context& context) {
  if (options.csv && context.options.json) {
    throw ConfigError("--csv and --json exclude each other");
  }
  ShadowFilter filter;
  filter.valve_glob = options.valve;
  filter.candidate = options.candidate;
  filter.since_ns = options.window.since_ns(context);
  filter.until_ns = options.window.until_ns(context);
  filter.limit = options.limit;
  HistoryReader history(DataOf(context).history());
  const auto stretches = ListShadow(history.database(), filter);
  if (options.csv) {
    PrintShadowCsv(stretches);
  } else if (context.options.json) {
    PrintShadowJson(stretches);
  } else {
    PrintShadow(stretches, context);
  }
  return cli::kExitOk;
}

}  // namespace

void AddShadowVerb(cli::Program& program) {
  auto options = std::make_shared<ShadowOptions>();
  CLI::App& verb = program.AddVerb(
      *program.root().get_subcommand("history"), "shadow",
      "List where the candidate of fdi-monitor run --shadow differed",
      [options](const Context& c) { return Shadow(*options, c); });
  verb.add_option("--valve", options->valve, "Glob over valve ids: 'FV-1*'");
  verb.add_option("--candidate", options->candidate, "NAME or NAME@VERSION");
  options->window.AddTo(verb);
  verb.add_option("--limit", options->limit, "The newest so many; 0: all")
      ->check(CLI::NonNegativeNumber);
  verb.add_flag("--csv", options->csv, "One line per stretch");
}

}  // namespace fdi::storage
