#include <iostream>
#include <memory>
#include <random>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/app/common.h"
#include "storage/app/runs_json.h"
#include "storage/cli/logging.h"
#include "storage/cli/tag_map.h"
#include "storage/cli/time_text.h"
#include "storage/csv.h"
#include "storage/runs.h"

namespace fdi::storage {

void AddImportVerb(cli::Program& program, CLI::App& group);

namespace {

using cli::Context;
using cli::Json;

constexpr std::int64_t kSecond = 1'000'000'000;

struct ImportOptions {
  std::string file;
  std::string valve;
  std::string map;
  std::string start;
  std::string signals{"CV,P1,P2,T1,X,F"};
  double period_s{0.0};
  bool split_gaps{false};
  bool assume_normal{false};
};

CsvTable Read(const ImportOptions& options, std::int64_t start_ns) {
  CsvOptions csv;
  csv.start_ns = start_ns;
  if (!options.map.empty()) {
    csv.map = cli::ReadTagMap(options.map);
  }
  csv.required = ParseSignals(options.signals);
  csv.split_gaps = options.split_gaps;
  csv.period_s = options.period_s;
  if (options.file == "-") {
    csv.source = "stdin";
    return ReadCsv(std::cin, csv);
  }
  if (!std::filesystem::exists(options.file)) {
    throw NotFoundError("no file " + options.file);
  }
  return ReadCsvFile(options.file, csv);
}

std::uint64_t RandomSource() {
  std::random_device device;
  return (std::uint64_t{device()} << 32U) | device();
}

void Notice(const CsvTable& table, const Context& context) {
  std::string ignored;
  for (const std::string& column : table.header.ignored_columns) {
    ignored += (ignored.empty() ? "" : ",") + column;
  }
  if (!ignored.empty()) {
    context.log(LogLevel::kInfo,
                cli::EventLine("columns_ignored", {{"columns", ignored}}));
  }
}

int Import(const ImportOptions& options, const Context& context) {
  const std::int64_t start_ns =
      options.start.empty()
          ? cli::NowNs() / kSecond * kSecond
          : cli::ParseTime(options.start, context.options.utc);
  const CsvTable table = Read(options, start_ns);
  if (options.assume_normal && table.header.has_truth) {
    throw ConfigError("--assume-normal: " + options.file +
                      " carries its own truth");
  }
  NewRun run;
  run.valve_id = options.valve;
  run.source_id = RandomSource();
  run.start_ns = start_ns;
  run.origin = RunOrigin::kImported;
  run.scenario = options.file;
  run.software = context.software;
  Notice(table, context);
  RunStore store(WritableDataOf(context).runs(), Access::kOccasionalWriter);
  const std::vector<std::string> ids = store.Import(table, run);
  Json runs = Json::array();
  std::int64_t samples = 0;
  for (const std::string& id : ids) {
    if (options.assume_normal) {
      store.Label(id, 0, 0.0);
    }
    const RunInfo info = store.Info(id);
    samples += info.samples;
    runs.push_back(RunJson(info));
    if (!context.options.json) {
      std::cout << "run " << id << ": " << info.samples << " samples of "
                << info.run.valve_id << '\n';
    }
  }
  if (context.options.json) {
    Json object = runs.front();
    object["samples"] = samples;
    object["ignored_columns"] = table.header.ignored_columns;
    object["runs"] = runs;
    cli::PrintJson(std::cout, object);
  }
  return cli::kExitOk;
}

}  // namespace

void AddImportVerb(cli::Program& program, CLI::App& group) {
  auto options = std::make_shared<ImportOptions>();
  CLI::App& verb = program.AddVerb(
      group, "import", "Store a CSV file as a run; all of it or nothing",
      [options](const Context& c) { return Import(*options, c); });
  verb.add_option("file", options->file, "CSV file, or - for stdin")
      ->required();
  verb.add_option("--valve", options->valve, "Id of the valve")->required();
  verb.add_option("--map", options->map,
                  "TOML file: names, units, scale, offset, sense of columns")
      ->type_name("FILE.toml");
  verb.add_option("--start", options->start, "UTC of t = 0 (default: now)");
  verb.add_option("--signals", options->signals, "Signals that must be there");
  verb.add_option("--period", options->period_s,
                  "Sample period in s (0: the most usual step)")
      ->check(CLI::NonNegativeNumber);
  verb.add_flag("--split-gaps", options->split_gaps,
                "A gap starts a new run instead of being refused");
  verb.add_flag("--assume-normal", options->assume_normal,
                "Label the run as free of faults");
}

}  // namespace fdi::storage
