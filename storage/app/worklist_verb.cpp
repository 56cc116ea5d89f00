#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "monitor/planner/health_view.h"
#include "monitor/planner/read_work.h"
#include "storage/app/common.h"
#include "storage/app/verbs.h"
#include "storage/cli/fault_texts.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"

namespace fdi::storage {
namespace {

using cli::Context;
using planner::WorkRow;

struct WorkListOptions {
  std::string valve{"*"};
  std::string since{"90d"};
  std::string discipline;
  std::vector<std::string> limits;
  std::size_t top{10};
  double horizon_days{180.0};
  bool csv{false};
};

planner::WorkQuery QueryOf(const WorkListOptions& options,
                           const Context& context) {
  planner::WorkQuery query;
  query.valve_glob = options.valve;
  query.options.now_ns = cli::NowNs();
  query.options.horizon_days = options.horizon_days;
  query.since_ns = cli::ParseTimeOrAgo(options.since, context.options.utc,
                                       query.options.now_ns);
  query.top = options.top;
  query.discipline = options.discipline;
  if (!query.discipline.empty()) {
    planner::RequireDiscipline(query.discipline);
  }
  for (const std::string& text : options.limits) {
    query.limits.push_back(monitor::ParseHealthLimit(text));
  }
  if (query.limits.empty()) {
    query.limits = planner::DefaultLimits();
  }
  return query;
}

void PrintRows(const std::vector<WorkRow>& rows) {
  if (rows.empty()) {
    std::cout << "Nothing to do.\n";
  }
  for (const WorkRow& row : rows) {
    std::cout << row.rank << ". " << row.work.valve_id << "  ("
              << cli::FormatNumber(row.score, 2) << ")\n   because " << row.why
              << '\n';
    if (!row.work.faults.empty()) {
      const cli::FaultWords& words = row.work.faults.front().words;
      std::cout << "   " << words.discipline << ": " << words.check << '\n';
    }
    if (row.work.service_hours > 0.0) {
      std::cout << "   " << cli::FormatNumber(row.work.travel_strokes, 0)
                << " strokes in "
                << cli::FormatNumber(row.work.service_hours, 0) << " h, "
                << cli::FormatNumber(100.0 * row.work.live_share, 0)
                << " % of it judged\n";
    }
  }
}

int WorkList(const WorkListOptions& options, const Context& context) {
  const planner::WorkQuery query = QueryOf(options, context);
  const cli::FaultTexts texts = cli::LoadFaultTexts(context.options);
  HistoryReader history(DataOf(context).history());
  const std::vector<WorkRow> rows =
      planner::ReadWorkList(history, texts, query);
  if (context.options.json) {
    cli::PrintJson(std::cout, planner::WorkListJson(rows));
  } else if (options.csv) {
    planner::WriteWorkListCsv(std::cout, rows);
  } else {
    PrintRows(rows);
  }
  return cli::kExitOk;
}

}  // namespace

void AddWorkListVerb(cli::Program& program) {
  auto options = std::make_shared<WorkListOptions>();
  CLI::App& verb = program.AddVerb(
      "worklist", "The valves to look at at the next stop, and why",
      [options](const Context& c) { return WorkList(*options, c); });
  verb.add_option("--top", options->top, "So many valves; 0: all");
  verb.add_option("--valve", options->valve, "Ids that match GLOB");
  verb.add_option("--since", options->since,
                  "Episodes and trends from this time on: 90d, 2026-10-01");
  verb.add_option("--discipline", options->discipline,
                  "Only what is for operator, instrument, air or mechanical");
  verb.add_option("--limit", options->limits,
                  "Limits of trends as of `health trend`, may be repeated; "
                  "default F=-10% and F=10%")
      ->type_name("NAME=VALUE");
  verb.add_option("--horizon", options->horizon_days,
                  "Trends that need more days do not count")
      ->check(CLI::Range(1.0, 36500.0))
      ->type_name("DAYS");
  verb.add_flag("--csv", options->csv, "CSV, a line per valve");
}

}  // namespace fdi::storage
