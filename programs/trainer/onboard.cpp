#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "import/tag_map.h"
#include "programs/trainer/model_report.h"
#include "programs/trainer/onboard_plant.h"
#include "programs/trainer/verbs.h"
#include "report/help.h"
#include "report/program.h"
#include "report/progress.h"
#include "report/report.h"
#include "report/signal_list.h"
#include "report/stop_signals.h"
#include "simulator/fault_effects.h"
#include "storage/database/data_directory.h"
#include "storage/models/model_codec.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/fleet/valve_types.h"
#include "trainer/learning/labelled_episodes.h"
#include "trainer/onboarding/onboarding.h"
#include "trainer/onboarding/record_checks.h"
#include "trainer/onboarding/record_verdict.h"
#include "trainer/rule_text.h"
#include "trainer/scoring/evaluated_run.h"

// The verb `onboard` makes difference observers for a valve type: from the data
// of a valve, or, to say what could be seen of one, from a simulation.

namespace fdi::trainer {
namespace {

constexpr auto kPlain = report::Format::kPlain;
// The fit needs several times the memory of the rows.
constexpr std::size_t kMaxPackedOnboarding = 200'000;
using report::Align;
using report::FormatNumber;
using report::Json;

struct OnboardOptions {
  std::vector<std::string> signals;
  std::string type{"lublin-actuator-3"};
  OnboardingOptions onboarding;
  int jobs{0};
  std::string valve;
  std::vector<std::string> runs;
  std::vector<std::string> files;
  importer::TableOptions table;
  std::string save_type;
  bool dry_run{false};
  PlantVerbOptions plant;
};

Json CoverageJson(const CoverageTable& table) {
  Json json = {{"signals", report::SignalsJson(table.signals)},
               {"seconds", table.seconds},
               {"parts", table.parts},
               {"alarmed", table.alarmed},
               {"judged", table.judged},
               {"faults", Json::array()}};
  for (const FaultCoverage& coverage : table.faults) {
    const double direction = coverage.negative ? -1.0 : 1.0;
    const auto strength = [direction](const std::optional<double>& smallest) {
      return smallest ? Json(direction * *smallest) : Json();
    };
    json["faults"].push_back(
        {{"fault", FaultName(coverage.fault)},
         {"description", FaultFactsOf(coverage.fault).description},
         {"direction", coverage.negative ? -1 : 1},
         {"detectable_from", strength(coverage.detectable)},
         {"isolable_from", strength(coverage.isolable)},
         {"look_alikes", FaultsJson(coverage.look_alikes)}});
  }
  return json;
}

// Shows the CoverageJson() that stands at `path` of the document.
void AddCoverage(const CoverageTable& table, const std::string& path,
                 report::Report& report) {
  const auto directed = [](const Json& row) {
    return row["fault"].get<std::string>() +
           (row["direction"] == -1 ? " (-)" : "");
  };
  report.Line("coverage with " + report::SignalsText(table.signals) +
              ", each fault given " + FormatNumber(table.seconds, 0) +
              " s to show in " +
              (table.parts == 1 ? std::string("data")
                                : "each of " + std::to_string(table.parts) +
                                      " parts of the record") +
              " that the models did not see; smallest strength");
  report.Table(path + "faults",
               {{.heading = "fault", .key = "fault", .text = directed},
                {"description", "description"},
                {"detected from", "detectable_from"},
                {"isolated from", "isolable_from"},
                {"looks like", "look_alikes"}});
  report.Line("isolated: named in a set of at most two");
}

Json OnboardingJson(const Onboarding& onboarding,
                    const std::optional<ModelSet>& of_type) {
  Json json = ModelsJson(onboarding.models);
  json["hours"] = onboarding.hours;
  json["size"] = onboarding.size;
  json["position_as_command"] = onboarding.models.position_as_command;
  json["fault_observers_of"] =
      onboarding.transferred ? Json(NameOf(*of_type)) : Json();
  json["parameters"] = Json::array();
  if (onboarding.fit) {
    for (const simulator::FittedParameter& value : onboarding.fit->values) {
      json["parameters"].push_back({{"name", value.name},
                                    {"nominal", value.nominal},
                                    {"value", value.value},
                                    {"relative_sd", value.relative_sd},
                                    {"identified", value.identified}});
    }
  }
  json["fit"] = Json::array();
  for (const ChannelFit& fit : onboarding.channels) {
    json["fit"].push_back(
        {{"channel", fit.name},
         {"unit", UnitOf(fit.output, onboarding.models.flow_unit)},
         {"rmse", fit.rmse},
         {"bias", fit.bias},
         {"vaf", VafJson(fit.vaf)},
         {"naive_rmse", fit.naive_rmse},
         {"seen_from", fit.seen_from}});
  }
  if (onboarding.coverage) {
    json["coverage"] = CoverageJson(*onboarding.coverage);
  }
  return json;
}

// That show the errors of a valve of any size: 3 from 1 t/h on, more below.
int FlowDecimals(const simulator::ValveParameters& valve) {
  const double range = std::clamp(valve.instruments.flow.high, 1e-9, 1.0);
  return 3 - static_cast<int>(std::floor(std::log10(range)));
}

void AddFit(const simulator::ValveFit& fit, report::Report& report) {
  const int decimals = FlowDecimals(fit.parameters);
  // Coefficients of a relay are small, pressures large.
  const auto significant = [](const char* heading, const char* key) {
    return report::Column{
        .heading = heading,
        .key = key,
        .text = [key](const Json& row) { return Digits(row[key], 4); },
        .align = Align::kRight};
  };
  report.Table("parameters", {{"parameter", "name"},
                              significant("nominal", "nominal"),
                              significant("fitted", "value"),
                              {"sd", "relative_sd", report::Format::kPercent},
                              {"identified", "identified"}});
  report.Line(std::string("What is not identified stays nominal. Command ") +
              (fit.interpolated_command ? "interpolated" : "held") +
              " from sample to sample, acting " +
              std::to_string(fit.command_delay) +
              " samples after its stamp; simulation against record: X RMSE " +
              FormatNumber(fit.nominal.x_rmse_pct, 3) + " -> " +
              FormatNumber(fit.fitted.x_rmse_pct, 3) + " %, F RMSE " +
              FormatNumber(fit.nominal.flow_rmse, decimals) + " -> " +
              FormatNumber(fit.fitted.flow_rmse, decimals) + "\n");
}

// The least lasting change of F that is beyond a limit, where F is all that
// shows the valve.
std::string LeastFlowChange(const Onboarding& onboarding) {
  double share = 1.0;
  for (const ChannelFit& fit : onboarding.channels) {
    if (fit.output == Signal::kF && fit.mean > 0.0) {
      share = std::min(share, fit.seen_from / fit.mean);
    }
  }
  return FormatNumber(100.0 * share, 0);
}

std::vector<int> FaultsOfRodAlone() {
  std::vector<int> faults;
  for (int fault = 1; fault <= kLastFault; ++fault) {
    if (simulator::ShowsInRodAlone(fault) &&
        IsVisibleIn(fault, kBasicSignals)) {
      faults.push_back(fault);
    }
  }
  return faults;
}

// Faults and changes that the signals and period of the record do not show.
std::vector<std::string> LimitsOfRecord(const Onboarding& onboarding) {
  std::vector<std::string> lines;
  const bool at_position = onboarding.models.position_as_command;
  const double period_s = onboarding.models.sample_period_s;
  const auto has = [&](Signal signal) {
    return (onboarding.signals & MaskOf(signal)) != 0;
  };
  if (at_position) {
    lines.push_back(
        "judged at the position: one sample in " + FormatNumber(period_s, 0) +
        " s is too slow for this command, which says nothing of X, while F "
        "follows X. Not seen is how the rod follows the command (" +
        FaultsText(FaultsOfRodAlone()) +
        "): that takes a sample a second. A stuck or wrong X (f13) is seen in "
        "F alone");
  } else if (!has(Signal::kX)) {
    lines.push_back(
        "no position (X): faults of the rod, the trim, the flow meter and the "
        "pressures are seen in F alone, which tells few of them apart; play, "
        "friction and the position transmitter are not told at all");
  }
  if (at_position || !has(Signal::kX)) {
    lines.push_back("a change of F by less than " +
                    LeastFlowChange(onboarding) +
                    " % of its mean is within the limits: the healthy record "
                    "varies by as much. More hours, or P1 and P2, make them "
                    "narrower");
  }
  if (has(Signal::kF) && !(has(Signal::kP1) && has(Signal::kP2))) {
    lines.push_back(
        "no pressures on both sides (P1, P2): a change of pressure is taken "
        "for a change of the flow at the same opening (f2, f3, f17, f19)" +
        std::string(at_position || !Contains(onboarding.models.faults,
                                             kDiaphragmPerforation)
                        ? ""
                        : ", and the force on the rod is not known "
                          "(f1, f10, f16)"));
  }
  if (period_s >= kSlowS) {
    lines.push_back(
        "one sample in " + FormatNumber(period_s, 0) +
        " s: how the rod moves between two samples is not seen (f4, f8, f9, "
        "f15); what lasts is: F and X at rest. An episode is looked at by "
        "simulation " +
        FormatNumber(20.0 * period_s / 60.0, 0) + " min after its detection");
  }
  return lines;
}

void AddChannels(int decimals, report::Report& report) {
  report.Table(
      "fit",
      {{"channel", "channel"},
       {"unit", "unit"},
       {.heading = "RMSE", .key = "rmse", .decimals = decimals},
       {.heading = "bias", .key = "bias", .decimals = decimals},
       {.heading = "VAF [%]", .key = "vaf", .decimals = 1},
       {.heading = "naive RMSE", .key = "naive_rmse", .decimals = decimals},
       {.heading = "seen from", .key = "seen_from", .decimals = decimals}});
  report.Line(
      "normal observer on data it was not fitted to; naive: X = CV, else the "
      "mean; seen from: the smallest lasting change that is beyond the "
      "limits\n");
}

// Physical parameters, fit of the normal observer against a naive model, model
// set, coverage.
report::Report ReportOf(const Onboarding& onboarding,
                        const std::optional<ModelSet>& of_type,
                        const RecordVerdict& verdict,
                        const std::string& title) {
  const ModelSet& models = onboarding.models;
  report::Report report;
  report.document = OnboardingJson(onboarding, of_type);
  report.document["verdict"] = verdict.word;
  report.document["verdict_text"] = verdict.sentence;
  report.Line(title + "\n" + verdict.sentence + "\n");
  if (onboarding.fit) {
    AddFit(*onboarding.fit, report);
  }
  const int decimals = FlowDecimals(onboarding.type.parameters);
  AddChannels(decimals, report);
  report.Line("model set " + NameOf(models) + ", hash " +
              Hex16(models.content_hash) + ", " +
              std::to_string(models.observers.size()) + " observers");
  if (of_type) {
    report.Line("fault observers: " +
                (onboarding.transferred
                     ? "those of " + NameOf(*of_type) + ", the type's set"
                     : "simulated, since " + NameOf(*of_type) +
                           ", the type's set, is of another size, has other "
                           "channels or was made for other commands, pressures "
                           "or temperatures"));
  }
  if (onboarding.size != 1.0) {
    const simulator::Instrumentation& i =
        onboarding.type.parameters.instruments;
    report.Line("the valve has " + FormatNumber(onboarding.size, 3) +
                " times the size of its type; the flow transmitter is taken to "
                "end at " +
                FormatNumber(i.flow.high, decimals - 2) + ' ' +
                std::string(FlowUnitName(i.flow_unit)) +
                ": --type FILE.toml states another end");
  }
  for (const std::string& line : LimitsOfRecord(onboarding)) {
    report.Line(line);
  }
  report.Line(AlarmRateText(models));
  if (onboarding.left_out_s > 0.0) {
    report.Line(FormatNumber(onboarding.left_out_s, 0) +
                " s of the record with X at a stop, and the minute after, were "
                "left out");
  }
  for (const std::string& channel : onboarding.unread) {
    report.Line(channel +
                " has fewer than 100 readings: filled in as an input, "
                "not watched");
  }
  report.Line("not told apart: " + GroupsText(models) +
              "; not seen at half their strengths: " +
              FaultsText(models.undetectable) + "\n");
  if (onboarding.coverage) {
    AddCoverage(*onboarding.coverage, "coverage/", report);
  } else if (!onboarding.unscored.empty()) {
    report.Line(
        "no coverage table: with a part left out for scoring, the rest "
        "is too short: " +
        onboarding.unscored);
  }
  return report;
}

// Runs in several flow units are converted to that of the first, by the type's
// medium.
std::vector<TrainingRun> LoadRuns(const OnboardOptions& options,
                                  const ValveType& type,
                                  const report::Context& context) {
  if (options.runs.empty() && options.files.empty()) {
    throw ConfigError("healthy data are needed: --runs ID,... or --file CSV");
  }
  if (options.files.empty() && options.table.given()) {
    throw ConfigError("--map, --zone and --resample are of --file");
  }
  const simulator::Medium& medium = type.parameters.medium;
  importer::CsvOptions csv{.map = options.table.Read(context.options.utc),
                           .log = context.log};
  importer::CheckGasFlow(csv.map, simulator::MolarMass(medium));
  csv.required = MaskOf(Signal::kCv);
  csv.max_packed_rows = kMaxPackedOnboarding;
  std::vector<storage::StoredRun> stored = LoadRunsAndFiles(
      options.runs, options.files, {context.options.data_dir}, csv);
  std::vector<TrainingRun> runs;
  for (storage::StoredRun& run : stored) {
    ConvertFlow(
        run, simulator::FlowTarget{stored.front().info.run.flow_unit, medium},
        context.log);
    runs.push_back(ToTrainingRun(run, true));
    run.samples = {};
    if (!options.signals.empty()) {
      runs.back() =
          WithSignals(std::move(runs.back()),
                      report::ParseSignals(options.signals, kBasicSignals));
    }
  }
  return runs;
}

// Ctrl-C is answered within a second, whatever step the work is at.
constexpr std::chrono::milliseconds kOnboardPatience{800};

Onboarding OnboardOrSayWhyNot(const std::vector<TrainingRun>& runs,
                              const OnboardingOptions& settings,
                              const Progress& progress) {
  try {
    return Onboard(runs, settings, progress);
  } catch (const DataError& error) {
    throw DataError(std::string("not usable: ") + error.what());
  }
}

// The data and settings by which the valve is onboarded.
struct OnboardingJob {
  std::vector<TrainingRun> runs;
  OnboardingOptions settings;
};

std::string NameOfSet(const OnboardOptions& options) {
  return options.onboarding.name.empty() ? options.valve
                                         : options.onboarding.name;
}

OnboardingJob NewJob(const OnboardOptions& options, storage::ModelStore& store,
                     const report::Context& context) {
  const FoundType found = FindType(options.type, &store);
  OnboardingJob job{LoadRuns(options, found.type, context), options.onboarding};
  job.settings.name = NameOfSet(options);
  job.settings.threads = options.jobs;
  job.settings.type = found.type;
  job.settings.fit = job.settings.fit && !found.stored;
  job.settings.of_type = SetOf(found, store);
  return job;
}

report::Report OnboardValve(const OnboardOptions& options,
                            const report::Context& context) {
  if (options.valve.empty()) {
    throw ConfigError("onboard: --valve ID or --plant FILE is needed");
  }
  RequireStorable(NameOfSet(options), "--name");
  if (!options.save_type.empty()) {
    RequireStorable(options.save_type, "--save-type");
  }
  const storage::DataDirectory directory{context.options.data_dir};
  storage::EnsureExists(directory);
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  auto [runs, settings] = NewJob(options, store, context);
  settings.software = context.software;
  settings.created_ns = NowNs();
  report::StopSignals signals;
  signals.EndWithin(kOnboardPatience,
                    "\nfdi-trainer: error: interrupted: nothing was stored\n");
  report::Progress bar("onboard");
  const auto start = std::chrono::steady_clock::now();
  Onboarding onboarding =
      OnboardOrSayWhyNot(runs, settings, Reporting(bar, signals));
  bar.Finish();
  signals.EndWithin(std::chrono::milliseconds(0));
  onboarding.models =
      *store.Store(ResultOf(options.valve, onboarding, options.save_type));
  const std::chrono::duration<double> seconds =
      std::chrono::steady_clock::now() - start;
  if (onboarding.models.position_as_command) {
    std::ranges::transform(runs, runs.begin(), AtPosition);
  }
  report::Report report = ReportOf(
      onboarding, settings.of_type,
      JudgeRecord(runs, onboarding.hours,
                  onboarding.coverage ? &*onboarding.coverage : nullptr),
      "valve " + options.valve + ": " + FormatNumber(onboarding.hours, 2) +
          " h of healthy data, onboarded in " +
          std::to_string(std::lround(seconds.count())) + " s");
  return report;
}

// Reports which faults of a valve of the type these signals could show.
report::Report Assess(const OnboardOptions& options,
                      const report::Context& context) {
  if (options.signals.empty() || !options.runs.empty() ||
      !options.files.empty()) {
    throw ConfigError(
        "onboard --dry-run: --plant FILE says what would be done, --signals "
        "without data what could be seen");
  }
  const SignalMask signals =
      report::ParseSignals(options.signals, kBasicSignals);
  const storage::DataDirectory directory{context.options.data_dir};
  // Only read, if there is one: types may also come from elsewhere.
  std::optional<storage::ModelStore> store;
  if (std::filesystem::exists(directory.models())) {
    store.emplace(directory.models());
  }
  OnboardingOptions settings = options.onboarding;
  settings.name = "coverage";
  settings.threads = options.jobs;
  report::StopSignals stop;
  stop.EndWithin(kOnboardPatience, "\nfdi-trainer: error: interrupted\n");
  report::Progress bar("coverage");
  const CoverageTable table =
      AssessType(FindType(options.type, store ? &*store : nullptr).type,
                 signals, settings, Reporting(bar, stop));
  bar.Finish();
  report::Report report;
  report.document = CoverageJson(table);
  AddCoverage(table, "", report);
  return report;
}

void AddOptions(CLI::App& verb, OnboardOptions& options) {
  verb.add_option("--valve", options.valve,
                  "Id of the valve that the set is assigned to; with --plant, "
                  "rows with matching names only")
      ->type_name("ID|GLOB");
  options.plant.AddTo(verb);
  verb.add_flag("--dry-run", options.dry_run,
                "Store nothing. With --plant: list matched, unmatched and "
                "ambiguous tags and what is wrong with a row. With --signals "
                "and without data: simulate the type, and show which faults "
                "could be seen");
  verb.add_option("--jobs", options.jobs,
                  "Threads, or with --plant rows at a time; 0: one per core")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
  verb.add_option("--runs", options.runs,
                  "Healthy runs, or stretches of them [s]")
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  verb.add_option("--file", options.files,
                  "Healthy CSV file, not stored; repeatable")
      ->type_name("FILE.csv[@from:to]");
  options.table.AddTo(verb);
  verb.add_option("--type", options.type,
                  "Valve type: a stored one, whose fault effects are taken as "
                  "they are, or parameters that are fitted to the valve")
      ->type_name("NAME|FILE.toml")
      ->capture_default_str();
  verb.add_option("--signals", options.signals,
                  "Use these signals alone, as if the others were not measured")
      ->delimiter(',')
      ->type_name("CV,X,...");
  verb.add_option("--save-type", options.save_type,
                  "Store the fitted parameters as a valve type for others of "
                  "its kind")
      ->type_name("NAME");
  verb.add_option("--name", options.onboarding.name,
                  "Name of the model set (default: the id of the valve)")
      ->type_name("NAME");
  verb.add_option("--false-alarms-per-hour",
                  options.onboarding.false_alarms_per_hour,
                  "Rate that the thresholds are set for")
      ->check(CLI::Range(1e-9, 3600.0))
      ->type_name("R");
  verb.add_flag("!--no-coverage", options.onboarding.assess,
                "Leave out the table of faults that can be detected");
  report::ShowInHelpAll(verb, {"--resample", "--save-type",
                               "--false-alarms-per-hour", "--no-coverage"});
}

}  // namespace

void AddOnboardVerb(report::Program& program) {
  auto options = std::make_shared<OnboardOptions>();
  CLI::App& verb = program.AddVerb(
      "onboard",
      "Make models for a valve that has only ever been healthy, and assign "
      "them",
      [options](const report::Context& context) -> report::Report {
        if (!options->plant.plant.empty()) {
          PlantVerbOptions plant = options->plant;
          plant.jobs = options->jobs;
          plant.dry_run = options->dry_run;
          plant.valve = options->valve.empty() ? "*" : options->valve;
          return OnboardFromTable(plant, options->files, options->table,
                                  options->onboarding, context);
        }
        return options->dry_run ? Assess(*options, context)
                                : OnboardValve(*options, context);
      });
  AddOptions(verb, *options);
  // The rows of a table state these, or leave nothing to choose: a type is
  // fitted once, and no row gets a table of faults.
  for (const char* option : {"--runs", "--type", "--signals", "--save-type",
                             "--name", "--no-coverage"}) {
    verb.get_option("--plant")->excludes(verb.get_option(option));
  }
  program.AddExamples(
      {{"onboard",
        {{"A valve of the plant that has only ever been healthy",
          "fdi-trainer onboard --valve FV-101 --runs 1a2b,3c4d"},
         {"From a CSV file",
          "fdi-trainer onboard --valve FV-101 --file fv101.csv"},
         {"All loops of a plant: what the table matches, then the work",
          "fdi-trainer onboard --plant plant.toml --dry-run"},
         {"What could be seen of a valve with three transmitters",
          "fdi-trainer onboard --dry-run --signals CV,X,F"},
         {"The work; after an interruption the same command goes on",
          "fdi-trainer onboard --plant plant.toml"}}}});
}

}  // namespace fdi::trainer
