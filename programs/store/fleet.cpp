// fdi-store report: the state of all loops of a plant.
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "planner/fleet_report.h"
#include "programs/store/loop_audits.h"
#include "programs/store/verbs.h"
#include "report/fault_texts.h"

namespace fdi::storage {
namespace {

constexpr const char* kJsonName = "report.json";
constexpr const char* kHtmlName = "report.html";

struct FleetOptions {
  std::string since{"7d"};
  std::string output;
  std::size_t top{10};
  int audit_windows{3};
  PlantOptions plant;
};

// The document of the last report in the folder; null: there is none.
Json LastReport(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) {
    return {};
  }
  Json last = Json::parse(ReadTextFile(file), nullptr, false);
  if (!last.is_object()) {
    throw DataError(file.string() +
                    " is no report of this program; move it away, or name "
                    "another --output");
  }
  return last;
}

void AddAudits(const LoopAudits& audits, planner::FleetQuery& query) {
  for (const LoopAudits::Window& window : audits.windows) {
    query.audits.push_back({window.loop, window.verdict, window.sure,
                            window.reason, window.band_pct, window.start_ns});
  }
  for (const LoopAudits::Period& period : audits.periods) {
    query.periods.push_back({period.period_s, period.loops});
  }
  query.not_audited = audits.skipped;
}

Report WriteFleet(const FleetOptions& options, const Context& context) {
  const DataDirectory data = DataOf(context);
  const std::filesystem::path folder = options.output;
  planner::FleetQuery query;
  // Whole seconds, as people read them.
  query.now_ns = NowNs() / kNsPerSecond * kNsPerSecond;
  query.since_ns =
      ParseTimeOrAgo(options.since, context.options.utc, query.now_ns);
  if (query.since_ns >= query.now_ns) {
    throw ConfigError("--since " + options.since +
                      " is not in the past; try 7d or 2026-10-01");
  }
  query.top = options.top;
  query.software = context.software;
  if (!options.output.empty()) {
    report::EnsureFolder(folder);
    query.last = LastReport(folder / kJsonName);
    query.last_file = (folder / kJsonName).string();
  }
  std::unique_ptr<History> history;
  const bool of_plant = options.plant.asked();
  // Runs and models are enough for a report. Where there are none either, the
  // missing history is the mistake to tell.
  const bool only_runs = !of_plant &&
                         !std::filesystem::exists(data.history()) &&
                         (std::filesystem::exists(data.runs()) ||
                          std::filesystem::exists(data.models()));
  if (!only_runs) {
    history = OpenHistory(options.plant, context);
  }
  if (!of_plant) {
    query.loops = planner::LoopsOf(data.models());
    AddAudits(AuditStoredRuns(data, query.since_ns, options.audit_windows),
              query);
    if (history) {
      query.causes = planner::CausesOf(data.history(), query.since_ns);
    }
  }
  Report report = planner::FleetReport(
      history.get(), report::LoadFaultTexts(context.options), query);
  if (!options.output.empty()) {
    report::WriteOutput(folder / kHtmlName, [&](std::ostream& out) {
      report.PrintHtml(out, planner::kFleetTitle, {context.options.utc, true});
    });
    // Last, because the next report compares itself with it.
    report::WriteOutput(folder / kJsonName,
                        [&](std::ostream& out) { report.PrintJson(out); });
    report.Line("").Line("written to " + (folder / kHtmlName).string() +
                         " and " + kJsonName);
  }
  return report;
}

}  // namespace

void AddFleetVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, program.root(), "report",
      "The state of all loops: the worst, what they share, what could not be "
      "judged, what has changed, what watches them",
      WriteFleet);
  verb.add_option("--since", options.since,
                  "Episodes, runs and time judged from this time on: 7d, "
                  "2026-10-01");
  verb.add_option("-o,--output", options.output,
                  "Write DIR/report.html and DIR/report.json; the report.json "
                  "found there is what changes are compared with");
  verb.add_option("--top", options.top,
                  "Findings with all their columns; further ones are listed "
                  "below")
      ->check(CLI::Range(1, 1000));
  verb.add_option("--audit-windows", options.audit_windows,
                  "Windows of two hours to audit of each loop's newest stored "
                  "run; 0: none")
      ->check(CLI::Range(0, 100));
  options.plant.AddTo(verb);
  program.AllowCsv(verb, "CSV of the worst, one line per finding");
}

}  // namespace fdi::storage
