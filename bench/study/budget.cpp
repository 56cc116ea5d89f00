#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/time_units.h"
#include "bench/study/csv_rows.h"
#include "bench/study/study_detectors.h"
#include "bench/study/verbs.h"
#include "diagnosis/decision/alarm_budget.h"
#include "diagnosis/decision/decision.h"
#include "diagnosis/decision/look_answer.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/output_folder.h"
#include "report/program.h"
#include "report/text_table.h"
#include "simulator/scenario/scenario_toml.h"
#include "simulator/second_look/second_look.h"
#include "simulator/valve_simulation.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"

// How often a budget of alarms is overdrawn, and what it costs in delay.
// `hours` lets a simulated valve be judged for days and writes the largest
// share of each hour and of each episode; `budget` weighs these as the monitor
// does, each day by the hours before it.
namespace fdi::trainer::study {
namespace {

namespace fs = std::filesystem;

constexpr double kSecondsPerDay = 86400.0;
constexpr double kSecondsPerHour = 3600.0;
constexpr double kPauseS = 60.0;  // Between days, so that each is a new source.
constexpr double kJudged = 0.9;   // Of an hour, as ReadHealthyHours().

struct HoursOptions {
  std::string model_set;
  StudySelection selection;
  fs::path scenario;
  int first_day{0};
  int days{1};
  fs::path output;
};

enum Column : std::size_t { kKind, kAt, kShare, kWhat };
const std::vector<std::string> kHeads{"kind", "at_s", "share", "what"};

// Follows one valve. Writes a row for each hour without an episode, each time
// an episode's largest share or the whole hours that it lasts grow, and where
// the truth of a run begins.
class Book {
 public:
  Book(std::ostream& out, const std::shared_ptr<const ModelSet>& models)
      : out_(out),
        models_(models),
        decision_(
            EngineParts(models),
            models->physics.empty()
                ? nullptr
                : std::make_shared<const simulator::ValveLooker>(*models)) {
    WriteCsvLine(out_, kHeads);
  }

  void Take(double at_s, const Sample& sample, int truth) {
    if (at_s >= hour_s_ + kSecondsPerHour) {
      EndHour();
      hour_s_ = at_s - std::fmod(at_s, kSecondsPerHour);
    }
    if (truth != 0 && !faulty_) {
      faulty_ = true;
      Row("fault", at_s, 0.0, FaultName(truth));
    }
    const Verdict& verdict = decision_.Step(sample);
    for (const LookTask& task : decision_.TakeDue()) {
      if (auto answer = fdi::TakeLook(*decision_.simulation(), task)) {
        decision_.Answer(task, std::move(*answer));
      }
    }
    ++samples_;
    live_ += verdict.quality == Quality::kLive ? 1 : 0;
    if (decision_.episode_open()) {
      TakeEpisode(at_s, verdict);
    } else {
      Close(at_s);
      hour_share_ = std::max(hour_share_, verdict.share);
    }
  }

  void End(double at_s) {
    decision_.End(EndReason::kStreamEnded);
    Close(at_s);
    EndHour();
  }

 private:
  void TakeEpisode(double at_s, const Verdict& verdict) {
    spoilt_ = true;
    if (!open_) {
      open_ = true;
      share_ = verdict.share;
      open_s_ = at_s;
      lasted_ = 0;
      name_ = 0;
      Row("open", at_s, share_, "");
    } else if (const int lasted =
                   verdict.share > 1.0 || share_ <= 1.0
                       ? static_cast<int>((at_s - open_s_) / kSecondsPerHour)
                       : 0;
               verdict.share > share_ || lasted > lasted_) {
      share_ = std::max(share_, verdict.share);
      lasted_ = std::max(lasted_, lasted);
      Row("rise", at_s, share_, "");
    }
    name_ = verdict.isolated != 0 ? verdict.isolated : name_;
  }

  void Close(double at_s) {
    if (open_) {
      open_ = false;
      Row("close", at_s, share_, FaultSetName(*models_, name_));
    }
  }

  void EndHour() {
    if (!spoilt_ && samples_ > 0 &&
        static_cast<double>(live_) >= kJudged * static_cast<double>(samples_)) {
      Row("hour", hour_s_, hour_share_, "");
    }
    live_ = samples_ = 0;
    hour_share_ = 0.0;
    spoilt_ = open_;
  }

  void Row(const char* kind, double at_s, double share,
           const std::string& what) {
    WriteCsvLine(out_, {kind, report::FormatNumber(at_s, 1),
                        report::FormatNumber(share, 6), what});
  }

  std::ostream& out_;
  std::shared_ptr<const ModelSet> models_;
  Decision decision_;
  bool faulty_{false};
  bool open_{false};
  bool spoilt_{false};
  double share_{0.0};
  double open_s_{0.0};
  int lasted_{0};  // Whole hours [h], as EpisodeTracker counts them.
  double hour_share_{0.0};
  double hour_s_{0.0};
  int samples_{0};
  int live_{0};
  FaultSet name_{0};
};

void WriteSimulated(const HoursOptions& options, Book& book) {
  simulator::Scenario scenario;
  simulator::ApplyScenarioFile(options.scenario, scenario);
  for (int day = options.first_day; day < options.first_day + options.days;
       ++day) {
    simulator::ValveSimulationConfig config = scenario.config;
    config.seed += static_cast<std::uint64_t>(day);
    config.source_id = static_cast<std::uint64_t>(day) + 1;
    config.duration_s = kSecondsPerDay - kPauseS;
    const double begin_s = kSecondsPerDay * day;
    config.start_ns = static_cast<std::int64_t>(begin_s) * kNsPerSecond;
    simulator::ValveSimulation valve(config);
    double at_s = begin_s;
    for (; !valve.finished(); at_s += config.period_s) {
      const LabelledSample labelled = valve.Step();
      book.Take(at_s, labelled.sample,
                labelled.truth ? labelled.truth->fault : 0);
    }
    book.End(at_s);
  }
}

void WriteRun(const storage::StoredRun& run, Book& book) {
  const std::int64_t start_ns = run.samples.front().sample.stamp_ns;
  double at_s = 0.0;
  for (const storage::StoredSample& stored : run.samples) {
    at_s = 1e-9 * static_cast<double>(stored.sample.stamp_ns - start_ns);
    book.Take(at_s, stored.sample, stored.truth ? stored.truth->fault : 0);
  }
  book.End(at_s);
}

report::Report Hours(const HoursOptions& options,
                     const report::Context& context) {
  storage::ModelStore store(
      storage::DataDirectory{context.options.data_dir}.models());
  const auto models =
      std::make_shared<const ModelSet>(store.Load(options.model_set));
  const auto write = [&](const fs::path& path, const auto& fill) {
    report::WriteOutput(path, [&](std::ostream& out) {
      Book book(out, models);
      fill(book);
    });
  };
  if (!options.scenario.empty()) {
    write(options.output, [&](Book& book) { WriteSimulated(options, book); });
    return {};
  }
  const Detector detector = EngineDetector(models);
  const std::vector<ScoredRun> runs = LoadScoredRuns(
      options.selection, detector.required, detector.flow, context);
  fs::create_directory(options.output);
  for (const ScoredRun& run : runs) {
    std::string name = fs::path(run.name).filename().string();
    name += name.ends_with(".csv") ? "" : ".csv";
    write(options.output / name, [&](Book& book) { WriteRun(run.run, book); });
  }
  return {};
}

struct BudgetOptions {
  std::vector<fs::path> hours;
  std::vector<std::string> faults;
  double taught{170.0};
  std::string budget{"1/day"};
  double valves{300.0};
  bool labelled{false};
};

struct Episode {
  double open_s{0.0};
  double close_s{0.0};
  std::vector<std::pair<double, double>> shares;  // At [s], ascending.
  std::string name;
};

int WholeHours(const Episode& episode, double until_s) {
  return static_cast<int>((until_s - episode.open_s) / kSecondsPerHour);
}

struct ValveRows {
  std::string id;
  std::vector<std::pair<double, double>> hours;  // At [s], share.
  std::vector<Episode> episodes;
  std::optional<double> fault_s;
};

// Further parts are of later days.
void ReadRows(const fs::path& path, ValveRows& valve) {
  const CsvRows rows(path, kHeads);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const std::string& kind = rows.Cell(r, kKind);
    const double at_s = rows.Number(r, kAt);
    const double share = rows.Number(r, kShare);
    if (kind == "hour") {
      valve.hours.emplace_back(at_s, share);
    } else if (kind == "fault") {
      valve.fault_s = at_s;
    } else if (kind == "open") {
      valve.episodes.push_back({at_s, at_s, {{at_s, share}}, ""});
    } else if (valve.episodes.empty()) {
      rows.Refuse(r, "no episode is open");
    } else if (kind == "rise") {
      valve.episodes.back().shares.emplace_back(at_s, share);
    } else {
      valve.episodes.back().close_s = at_s;
      valve.episodes.back().name = rows.Cell(r, kWhat);
    }
  }
}

// VALVE.csv, VALVE.00.csv, VALVE.01.csv, ... in order of names.
std::vector<ValveRows> ReadValves(std::vector<fs::path> files) {
  std::ranges::sort(files);
  std::vector<ValveRows> valves;
  for (const fs::path& file : files) {
    const std::string name = file.filename().string();
    const std::string id = name.substr(0, name.find('.'));
    if (valves.empty() || valves.back().id != id) {
      valves.push_back({.id = id});
    }
    ReadRows(file, valves.back());
  }
  return valves;
}

// As ReadHealthyHours(), of what was before an instant. Episodes are labelled
// false, or nobody has judged them.
std::vector<HealthyHours> HoursBefore(const std::vector<ValveRows>& valves,
                                      double until_s, bool labelled) {
  std::vector<HealthyHours> all;
  for (const ValveRows& rows : valves) {
    HealthyHours valve;
    valve.valve_id = rows.id;
    std::set<int> days;
    for (const auto& [at_s, share] : rows.hours) {
      if (at_s + kSecondsPerHour <= until_s) {
        valve.hours.push_back(
            {static_cast<std::int64_t>(at_s / kSecondsPerHour), share});
        days.insert(static_cast<int>(at_s / kSecondsPerDay));
      }
    }
    valve.days = static_cast<int>(days.size());
    for (const Episode& episode : rows.episodes) {
      if (episode.close_s > until_s) {
        continue;
      }
      const int lasted = WholeHours(episode, episode.close_s);
      if (episode.shares.front().second > 1.0) {
        const double share = episode.shares.back().second;
        valve.hours.push_back(
            {static_cast<std::int64_t>(episode.open_s / kSecondsPerHour),
             labelled ? share : 1.0, lasted, !labelled});
      } else {
        ++valve.others;
        valve.others_lasted += lasted;
      }
    }
    all.push_back(std::move(valve));
  }
  return all;
}

// When the episode becomes an alarm; nothing: never.
std::optional<double> AlarmAt(const AlarmBudget& budget, const std::string& id,
                              const Episode& episode) {
  for (const auto& [at_s, share] : episode.shares) {
    if (!budget.Weigh(id, share, WholeHours(episode, at_s)).notice) {
      return at_s;
    }
  }
  return std::nullopt;
}

struct Counts {
  double hours{0.0};
  int episodes{0};
  int alarms{0};
};

void CountDay(const std::vector<ValveRows>& valves, double from_s,
              const AlarmBudget& budget, std::map<std::string, Counts>& counts,
              report::Report& report) {
  const double until_s = from_s + kSecondsPerDay;
  for (const ValveRows& valve : valves) {
    Counts& count = counts[valve.id];
    count.hours += static_cast<double>(
        std::ranges::count_if(valve.hours, [&](const auto& hour) {
          return hour.first >= from_s && hour.first < until_s;
        }));
    for (const Episode& episode : valve.episodes) {
      if (episode.open_s < from_s || episode.open_s >= until_s) {
        continue;
      }
      ++count.episodes;
      const bool alarm = AlarmAt(budget, valve.id, episode).has_value();
      count.alarms += alarm ? 1 : 0;
      report.Line(valve.id + ": " +
                  report::FormatNumber(episode.open_s / kSecondsPerHour, 2) +
                  " h, share " +
                  report::FormatNumber(episode.shares.back().second, 2) + ", " +
                  (alarm ? "alarm " : "notice ") + episode.name);
    }
  }
}

// The first episode from the fault on: its detection and its alarm [s] after
// it.
void TellFault(const std::string& valve, const fs::path& file,
               const AlarmBudget& budget, report::Report& report) {
  ValveRows run;
  run.id = file.stem().string();
  ReadRows(file, run);
  if (!run.fault_s) {
    return;
  }
  std::string detected = "-";
  std::string raised = "-";
  for (const Episode& episode : run.episodes) {
    if (episode.close_s < *run.fault_s) {
      continue;
    }
    if (detected == "-") {
      detected = report::FormatNumber(episode.open_s - *run.fault_s, 0);
    }
    if (const auto at_s = AlarmAt(budget, valve, episode)) {
      raised = report::FormatNumber(*at_s - *run.fault_s, 0);
      break;
    }
  }
  report.Line("fault," + valve + ',' + run.id + ',' + detected + ',' + raised);
}

report::Report Budget(const BudgetOptions& options) {
  const std::vector<ValveRows> valves = ReadValves(options.hours);
  double end_s = 0.0;
  for (const ValveRows& valve : valves) {
    end_s =
        std::max(end_s, valve.hours.empty() ? 0.0 : valve.hours.back().first);
  }
  // The real number of valves would need this of each of these.
  const double between_h = ParseAlarmBudget(options.budget) * options.valves /
                           static_cast<double>(valves.size());
  report::Report report;
  std::map<std::string, Counts> counts;
  double from_s = options.taught * kSecondsPerHour;
  std::optional<AlarmBudget> budget;
  for (; from_s < end_s; from_s += kSecondsPerDay) {
    budget.emplace(between_h, HoursBefore(valves, from_s, options.labelled));
    CountDay(valves, from_s, *budget, counts, report);
  }
  Counts all;
  for (const auto& [id, count] : counts) {
    all.hours += count.hours;
    all.episodes += count.episodes;
    all.alarms += count.alarms;
    report.Line("valve," + id + ',' + report::FormatNumber(count.hours, 0) +
                ',' + std::to_string(count.episodes) + ',' +
                std::to_string(count.alarms));
  }
  if (!budget) {
    throw DataError("no hour is after the first " +
                    report::FormatNumber(options.taught, 0));
  }
  const AlarmBudget::Promise promise = budget->Now();
  const double allowed = all.hours / promise.needed_hours;
  report.Line(
      "all: " + report::FormatNumber(all.hours, 0) + " h, " +
      std::to_string(all.episodes) + " episodes, " +
      std::to_string(all.alarms) + " alarms (95 %: at most " +
      report::FormatNumber(PoissonBound(all.alarms), 1) + "); budget " +
      report::FormatNumber(allowed, 2) +
      (PoissonAtLeast(all.alarms, allowed) < 0.05 ? ", exceeded"
       : PoissonBound(all.alarms) > allowed       ? ", not shown"
                                                  : ", kept") +
      "; q " +
      report::FormatNumber(
          ShareTails(HoursBefore(valves, from_s, options.labelled)).goes_on(),
          3) +
      "; valves with return periods " + std::to_string(promise.ready) +
      ", longest " + report::FormatNumber(promise.longest_hours, 0) + " h");
  for (const std::string& pair : options.faults) {
    const std::size_t equals = pair.find('=');
    for (const auto& entry : fs::directory_iterator(pair.substr(equals + 1))) {
      TellFault(pair.substr(0, equals), entry.path(), *budget, report);
    }
  }
  return report;
}

}  // namespace

void AddBudgetVerbs(report::Program& program) {
  auto hours = std::make_shared<HoursOptions>();
  CLI::App& write = program.AddVerb(
      "hours", "Write the largest share of a limit in each hour and episode",
      [hours](const report::Context& context) -> report::Report {
        return Hours(*hours, context);
      });
  write.add_option("--model-set", hours->model_set, "NAME or NAME@VERSION")
      ->required()
      ->type_name("NAME");
  hours->selection.AddTo(write);
  write
      .add_option("--scenario", hours->scenario,
                  "A simulated valve, each day with the next seed")
      ->type_name("FILE.toml");
  write.add_option("--days", hours->days, "Of the scenario")->type_name("N");
  write
      .add_option("--first-day", hours->first_day,
                  "Number of the first one: seeds and times go on from there")
      ->type_name("N");
  write
      .add_option("-o,--output", hours->output,
                  "File of the scenario, or folder of the runs")
      ->required()
      ->type_name("PATH");
  auto weigh = std::make_shared<BudgetOptions>();
  CLI::App& verb = program.AddVerb(
      "budget", "Count what a budget of alarms lets through, and when",
      [weigh](const report::Context&) -> report::Report {
        return Budget(*weigh);
      });
  verb.add_option("hours", weigh->hours,
                  "VALVE.csv, or parts VALVE.*.csv, of the verb hours")
      ->required()
      ->type_name("FILE.csv");
  verb.add_option("--faults", weigh->faults,
                  "Runs with faults by the models of a valve; repeatable")
      ->type_name("VALVE=FOLDER");
  verb.add_option("--taught-hours", weigh->taught, "Before anything is counted")
      ->type_name("H");
  verb.add_option("--budget", weigh->budget, "NUMBER/day, /week, ...")
      ->type_name("BUDGET");
  verb.add_flag("--labelled", weigh->labelled, "Episodes are labelled false");
  verb.add_option("--valves", weigh->valves, "Of the plant")->type_name("N");
}

}  // namespace fdi::trainer::study
