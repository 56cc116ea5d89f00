// fdi-trainer relearn: what is known of a valve since its set was made becomes
// the next version of the set. The lessons of labels and healthy hours are
// decided in trainer/learning; here the steps follow each other, and it reports
// what changes.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <span>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "import/tag_map.h"
#include "programs/trainer/model_report.h"
#include "programs/trainer/verbs.h"
#include "report/help.h"
#include "report/models/lineage_text.h"
#include "report/program.h"
#include "report/progress.h"
#include "report/report.h"
#include "report/stop_signals.h"
#include "report/verb_options.h"
#include "storage/database/data_directory.h"
#include "storage/models/model_codec.h"
#include "storage/models/models.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/fleet/valve_types.h"
#include "trainer/learning/extension.h"
#include "trainer/learning/relearning.h"
#include "trainer/onboarding/onboarding.h"
#include "trainer/onboarding/record_verdict.h"
#include "trainer/rule_text.h"
#include "trainer/training.h"

namespace fdi::trainer {
namespace {

using report::FormatNumber;
using report::Json;

struct RelearnOptions {
  std::string valve;
  report::TimeWindow window;  ///< --from, --to
  std::vector<std::string> runs;
  std::vector<std::string> files;
  importer::TableOptions table;
  bool models{false};
  std::vector<std::string> strengths;  ///< EPISODE=S
  std::string type;                    ///< That gets what labels have taught.
  bool skip_refused{false};
  bool activate{false};
  bool dry_run{false};
  int threads{0};
};

// Strengths by the begin of an episode id. 0 is refused: that there was no
// fault is said by the label `false`.
GivenStrengths ParseStrengths(const std::vector<std::string>& texts) {
  GivenStrengths strengths;
  for (const std::string& text : texts) {
    const std::size_t sign = text.find('=');
    double strength = 0.0;
    const char* const end = text.data() + text.size();
    const bool good =
        sign != std::string::npos && sign > 0 &&
        std::from_chars(text.data() + sign + 1, end, strength).ptr == end &&
        strength != 0.0 && std::abs(strength) <= 1.0;
    if (!good) {
      throw ConfigError("--strength " + text +
                        ": accepted is EPISODE=S with the beginning of an "
                        "episode id and S in [-1, 1] without 0");
    }
    strengths[text.substr(0, sign)] = strength;
  }
  return strengths;
}

RelearnRequest RequestOf(const RelearnOptions& options,
                         const report::Context& context) {
  if (options.files.empty() && options.table.given()) {
    throw ConfigError("--map, --zone and --resample are of --file");
  }
  RelearnRequest request;
  request.valve = options.valve;
  if (!options.window.since.empty()) {
    request.from_ns = options.window.since_ns(context);
  }
  if (!options.window.until.empty()) {
    request.to_ns = options.window.until_ns(context);
  }
  request.runs = options.runs;
  request.strengths = ParseStrengths(options.strengths);
  return request;
}

importer::CsvOptions FormOf(const RelearnOptions& options,
                            const report::Context& context) {
  // Further signals are asked of the channels: not every valve has them.
  return {.map = options.table.Read(context.options.utc),
          .required = MaskOf(Signal::kCv),
          .log = context.log};
}

// Ctrl-C is answered within a second, whatever step the work is at: what is in
// the files is whole after any end.
constexpr std::chrono::milliseconds kPatience{800};

// Makes the models again from the former record and the hours that the request
// names, all as the valve measures it. The fit starts where the former one
// ended.
std::string LearnModels(RelearnRequest& request, const RelearnOptions& options,
                        report::StopSignals& signals,
                        const report::Context& context, Relearning& learnt) {
  const storage::DataDirectory directory{context.options.data_dir};
  if (request.runs.empty() && options.files.empty()) {
    if (!request.from_ns && !request.to_ns) {
      throw ConfigError(
          "--models takes healthy hours: --from and --to of what was recorded, "
          "--runs ID,... or --file CSV");
    }
    request.runs = HealthyRuns(request, learnt.labels, directory);
  }
  if (!options.dry_run && !learnt.labels.learnt.empty()) {
    StoreEvidence(learnt.labels, directory, context.software);
  }
  std::vector<std::string> files = options.files;
  const FormerRecord former =
      ReadFormerRecord(options.valve, learnt.labels, directory, files);
  const simulator::FlowTarget flow{learnt.parent().flow_unit,
                                   former.type.parameters.medium};
  std::vector<TrainingRun> runs;
  const auto add = [&](TrainingRun run) {
    runs.push_back(WithSignals(std::move(run), former.signals));
  };
  const auto load = [&](const std::vector<std::string>& stored,
                        const std::vector<std::string>& from_files) {
    for (storage::StoredRun& run : LoadRunsAndFiles(
             stored, from_files, directory, FormOf(options, context))) {
      ConvertFlow(run, flow, context.log);
      add(ToTrainingRun(run, true));
    }
  };
  load(former.runs, former.files);
  OnboardingOptions settings;
  settings.former_runs = runs.size();
  load(request.runs, files);
  for (const LabelledEpisode& episode : learnt.labels.learnt) {
    if (episode.meaning.fault == 0) {
      add(RunOf(episode, learnt.parent()));
    }
  }
  settings.name = learnt.parent().name;
  settings.type = former.type;
  settings.extends = learnt.labels.parent;
  settings.false_alarms_per_hour = learnt.parent().false_alarms_per_hour;
  settings.threads = options.threads;
  settings.software = context.software;
  settings.created_ns = NowNs();
  report::Progress bar("relearn");
  Onboarding onboarding = Onboard(runs, settings, Reporting(bar, signals));
  bar.Finish();
  learnt.models = onboarding.models;
  learnt.faults = *onboarding.changes;
  learnt.anew = ResultOf(options.valve, onboarding, "");
  if (onboarding.models.position_as_command) {
    std::ranges::transform(runs, runs.begin(), AtPosition);
  }
  return JudgeRecord(runs, onboarding.hours, &*onboarding.coverage).sentence;
}

// Trains a set of `train` again, on its own runs and on the episodes.
void TrainAnew(const RelearnOptions& options, report::StopSignals& signals,
               const report::Context& context, Relearning& learnt) {
  const storage::DataDirectory directory{context.options.data_dir};
  TrainingOptions& training = learnt.labels.training;
  StoreEvidence(learnt.labels, directory, context.software);
  std::vector<std::string> selectors = learnt.labels.runs;
  for (const LabelledEpisode& episode : learnt.labels.learnt) {
    selectors.push_back(episode.meaning.run);
  }
  storage::RunStore store(directory.runs());
  std::vector<TrainingRun> runs;
  for (const std::string& selector : selectors) {
    runs.push_back(
        ToTrainingRun(store.Load(selector), training.dataset.assume_normal));
  }
  RestrictToCommonSignals(learnt.parent(), runs);
  training.threads = options.threads;
  report::Progress bar("relearn");
  learnt.models = TrainModelSet(runs, training, Reporting(bar, signals));
  bar.Finish();
}

// The type whose valves get what this one has learnt.
FoundType RequireType(const std::string& name, const ModelSet& parent,
                      storage::ModelStore& store) {
  FoundType found = FindType(name, &store);
  if (!found.stored || found.model_set.empty() ||
      storage::ParseModelReference(found.model_set).name != parent.name) {
    throw ConfigError(
        "--type " + name + ": accepted is a type that was saved with " +
        parent.name + ", see fdi-store types list" +
        (found.model_set.empty() ? "" : "; this one has " + found.model_set));
  }
  return found;
}

Json EpisodeJson(const LabelledEpisode& episode,
                 const EpisodeAnswers* answers) {
  const storage::TrainingEpisode& meaning = episode.meaning;
  const bool used = episode.refusal.empty();
  return {{"episode_id", meaning.episode_id},
          {"valve_id", meaning.valve_id},
          {"label", meaning.label},
          {"labelled_by", meaning.labelled_by},
          {"fault", used ? Json(FaultName(meaning.fault)) : Json()},
          {"strength", used ? Json(meaning.strength) : Json()},
          {"samples", meaning.samples},
          {"data", episode.data},
          {"before", answers != nullptr ? Json(answers->before) : Json()},
          {"after", answers != nullptr ? Json(answers->after) : Json()},
          {"refused", used ? Json() : Json(episode.refusal)}};
}

Json EpisodesJson(const Relearning& learnt) {
  const std::vector<EpisodeAnswers>& answers = learnt.comparison.episodes;
  Json rows = Json::array();
  for (std::size_t i = 0; i < learnt.labels.learnt.size(); ++i) {
    rows.push_back(EpisodeJson(learnt.labels.learnt[i],
                               i < answers.size() ? &answers[i] : nullptr));
  }
  for (const LabelledEpisode& episode : learnt.labels.refused) {
    rows.push_back(EpisodeJson(episode, nullptr));
  }
  return rows;
}

Json LimitsJson(const Relearning& learnt) {
  Json rows = Json::array();
  if (!learnt.limits) {
    return rows;
  }
  const ModelSet& parent = learnt.parent();
  const std::vector<Limit> before = LimitsOf(parent);
  const std::vector<Limit> after = LimitsOf(learnt.limits->models);
  for (std::size_t i = 0; i < before.size(); ++i) {
    const ChannelSpec& channel = parent.channels[before[i].channel];
    const Peak& peak = learnt.peaks[i];
    rows.push_back({{"channel", channel.name},
                    {"unit", UnitOf(channel.output, parent.flow_unit)},
                    {"window", before[i].window},
                    {"limit", LimitKindName(before[i].kind)},
                    {"before", before[i].value},
                    {"after", after[i].value},
                    {"seen", peak.share * before[i].value},
                    {"seen_in", peak.run},
                    {"seen_utc", FormatTime(peak.stamp_ns, true)}});
  }
  return rows;
}

Json TaughtJson(const std::vector<TaughtObserver>& taught) {
  Json json = Json::array();
  for (const TaughtObserver& one : taught) {
    json.push_back(
        {{"observer", one.observer.name},
         {"fault", FaultName(one.observer.fault)},
         {"strength", one.observer.strength},
         {"adapted_from",
          one.adapted_from.empty() ? Json() : Json(one.adapted_from)},
         {"samples", one.samples},
         {"gain_over_normal", one.gain_over_normal},
         {"gain_over_former", one.gain_over_former}});
  }
  return json;
}

// Only the faults whose smallest strength has changed.
Json FaultsSeenJson(const std::vector<CoverageChange>& faults) {
  Json rows = Json::array();
  for (const CoverageChange& fault : faults) {
    const auto strength = [&](const std::optional<double>& smallest) {
      return smallest ? Json(fault.negative ? -*smallest : *smallest) : Json();
    };
    if (fault.before != fault.after) {
      rows.push_back({{"fault", FaultName(fault.fault)},
                      {"before", strength(fault.before)},
                      {"after", strength(fault.after)}});
    }
  }
  return rows;
}

// Time that the limits do not rest on: that of episodes, and that of samples
// that would not have been judged, by the quality that they would have had.
Json LeftOutJson(const Relearning& learnt) {
  Json rows = Json::array();
  const auto add = [&](std::string reason, double seconds) {
    if (seconds > 0.0) {
      rows.push_back({{"reason", std::move(reason)}, {"seconds", seconds}});
    }
  };
  add("episodes", learnt.episodes_left_out_s);
  for (std::size_t i = 0; i < kQualityCount; ++i) {
    const auto quality = static_cast<Quality>(i);
    add(std::string(QualityName(quality)),
        learnt.parent().sample_period_s *
            static_cast<double>(learnt.healthy.left_out[quality]));
  }
  return rows;
}

// The deviation that the floor allows the rod; null without a floor.
Json FloorJson(const ModelSet& models) {
  return models.floor ? Json(models.floor->deviation) : Json();
}

// Where the limits come from, in one sentence.
std::string OriginText(const Relearning& learnt) {
  return FormatNumber(learnt.limits->hours, 2) +
         " h of healthy data; the limits were made from " +
         FormatNumber(learnt.parent().threshold_hours, 2) +
         " h before. Limits that the data passed are wider now, the others " +
         (learnt.limits->fitted ? "as close as the data allow."
                                : "as they were: closer ones take as many "
                                  "hours, over 80 % of the "
                                  "commands.");
}

void AddTables(const Relearning& learnt, report::Report& report) {
  report.Table("limits", {{"channel", "channel"},
                          {"unit", "unit"},
                          {"limit", "limit"},
                          {"window [samples]", "window"},
                          {.heading = "before", .key = "before", .decimals = 3},
                          {.heading = "after", .key = "after", .decimals = 3},
                          {.heading = "seen", .key = "seen", .decimals = 3},
                          {"in", "seen_in"}});
  if (learnt.limits) {
    report.Line(
        "seen: the most in the healthy data, for as many samples as an alarm "
        "takes\n");
  }
  report.Table("taught", {{"observer", "observer"},
                          {"adapted from", "adapted_from"},
                          {"samples", "samples"},
                          {.heading = "better than normal",
                           .key = "gain_over_normal",
                           .decimals = 0},
                          {.heading = "than that before",
                           .key = "gain_over_former",
                           .decimals = 0}});
  if (!learnt.taught.empty()) {
    report.Line(
        "better: log-likelihood of parts of the episodes that were left out; a "
        "difference of " +
        FormatNumber(learnt.models.decision.evidence_support, 0) +
        " refutes\n");
  }
  report.Table("episodes", {{"episode", "episode_id"},
                            {"valve", "valve_id"},
                            {"label", "label"},
                            {"by", "labelled_by"},
                            {"taken as", "fault"},
                            StrengthColumn(),
                            {"samples", "samples"},
                            {"data", "data"},
                            {"before", "before"},
                            {"after", "after"},
                            {"refused because", "refused"}});
  report.Table("left_out", {{"left out", "reason"},
                            {"time", "seconds", report::Format::kDuration}});
  report.Table(
      "faults",
      {{"fault", "fault"}, {"seen from", "before"}, {"now from", "after"}});
}

Json DocumentOf(const Relearning& learnt) {
  const ParentComparison& comparison = learnt.comparison;
  const bool limits = learnt.limits.has_value();
  return {{"model_set", learnt.models.name},
          {"version", Json()},
          {"content_hash", Json()},
          {"active", false},
          {"parent", NameOf(learnt.parent())},
          {"since_utc", FormatTime(learnt.labels.since_ns, true)},
          {"training_runs", learnt.labels.runs},
          {"missing_runs", learnt.labels.missing},
          {"runs", learnt.runs},
          {"hours", limits ? Json(learnt.limits->hours) : Json()},
          {"hours_before", learnt.parent().threshold_hours},
          {"hours_after", learnt.models.threshold_hours},
          {"fitted", limits && learnt.limits->fitted},
          {"limits", LimitsJson(learnt)},
          {"rod_deviation_before", FloorJson(learnt.parent())},
          {"rod_deviation_after", FloorJson(learnt.models)},
          {"taught", TaughtJson(learnt.taught)},
          {"episodes", EpisodesJson(learnt)},
          {"left_out", LeftOutJson(learnt)},
          {"faults", FaultsSeenJson(learnt.faults)},
          {"compared_hours", comparison.hours},
          {"alarms_before", comparison.alarms_before},
          {"alarms_after", comparison.alarms_after},
          {"worse", comparison.worse}};
}

report::Report ReportOf(const Relearning& learnt, const std::string& origin) {
  const ParentComparison& comparison = learnt.comparison;
  report::Report report;
  report.document = DocumentOf(learnt);
  report.Line(NameOf(learnt.parent()) + (origin.empty() ? "" : ": " + origin) +
              '\n');
  if (!learnt.labels.missing.empty()) {
    report.Line("not in runs.db: " + JoinText(learnt.labels.missing));
  }
  AddTables(learnt, report);
  const auto deviation = [](const ModelSet& models) {
    return models.floor ? FormatNumber(models.floor->deviation, 1) : "";
  };
  if (deviation(learnt.parent()) != deviation(learnt.models)) {
    report.Line("floor: the rod may deviate from the command by " +
                deviation(learnt.models) + " % instead of " +
                deviation(learnt.parent()) + " %");
  }
  if (IsOnboarded(learnt.models)) {
    report.Line(AlarmRateText(learnt.models));
  }
  if (comparison.hours > 0.0) {
    report.Line(
        "alarms in " + FormatNumber(comparison.hours, 2) +
        " h of healthy operation: " + std::to_string(comparison.alarms_before) +
        " before, " + std::to_string(comparison.alarms_after) + " now");
  }
  for (const std::string& worse : comparison.worse) {
    report.Line("worse: " + worse);
  }
  return report;
}

// Stores what was learnt, and says what is in use from then on.
void Store(const RelearnOptions& options, const report::Context& context,
           const std::string& settings, Relearning& learnt,
           report::Report& report) {
  const storage::DataDirectory directory{context.options.data_dir};
  const bool activate = options.activate || learnt.comparison.worse.empty();
  const ModelSet models =
      StoreRelearned(learnt, options.valve, settings, activate, directory,
                     context.software, NowNs());
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  if (!options.type.empty()) {
    const FoundType type = RequireType(options.type, models, store);
    const std::string text = TypeText(type.type, &models);
    store.SaveTemplate(options.type, std::as_bytes(std::span(text)),
                       store.LoadTemplate(options.type).summary);
  }
  const storage::Lineage lineage =
      store.LineageOf({models.name, models.version});
  report.document["version"] = models.version;
  report.document["content_hash"] = Hex16(models.content_hash);
  report.document["active"] = activate;
  report.document["lineage"] = report::LineageJson(lineage);
  report.Line("model set " + NameOf(models) + ", hash " +
              Hex16(models.content_hash) + ", built on " +
              report::ParentText(lineage));
  if (activate) {
    report.Line(NameOf(models) +
                " is in use from now on; fdi-store models "
                "activate " +
                NameOf(learnt.parent()) + " goes back");
  } else {
    report.Line(NameOf(models) +
                " is stored and not in use, because it is worse: fdi-store "
                "models activate " +
                NameOf(models) + " takes it all the same");
    report.exit_code = report::kExitData;
  }
}

// Learns what the request and the labels offer. @returns from what, in words.
std::string Learn(const RelearnOptions& options, RelearnRequest& request,
                  report::StopSignals& signals, const report::Context& context,
                  Relearning& learnt) {
  const storage::DataDirectory directory{context.options.data_dir};
  const bool news = learnt.labels.has_news;
  if (!IsOnboarded(learnt.parent())) {
    if (options.models || !options.files.empty() || !options.type.empty()) {
      throw ConfigError(
          "--models, --file and --type are for sets of fdi-trainer onboard, " +
          NameOf(learnt.parent()) + " is none");
    }
    // Training takes minutes: a dry run says on what.
    if (news && !options.dry_run) {
      TrainAnew(options, signals, context, learnt);
    }
    return "trained on " + JoinText(learnt.labels.runs);
  }
  std::string origin;
  if (options.models) {
    origin = LearnModels(request, options, signals, context, learnt);
  }
  for (const std::string& file : options.files) {
    request.files.push_back(ReadRunFile(file, FormOf(options, context)));
  }
  if (!options.models) {
    LearnHours(request, directory, learnt);
    origin = learnt.limits ? OriginText(learnt) : "";
  }
  if (options.models || news) {
    LearnFaults(directory, learnt);
  }
  return origin;
}

report::Report Relearn(const RelearnOptions& options,
                       const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  RelearnRequest request = RequestOf(options, context);
  Relearning learnt;
  learnt.labels = MakeLabelPlan(request, directory);
  learnt.models = learnt.parent();
  if (!options.skip_refused && !options.dry_run) {
    RequireUsable(learnt.labels);
  }
  for (const LabelledEpisode& episode : learnt.labels.refused) {
    context.log(
        LogLevel::kWarning,
        EventLine("episode_refused", {{"reason", RefusalText(episode)}}));
  }
  if (!options.type.empty()) {
    storage::ModelStore store(directory.models());
    RequireType(options.type, learnt.parent(), store);
  }
  report::StopSignals signals;
  signals.EndWithin(kPatience,
                    "\nfdi-trainer: error: interrupted: no model set was "
                    "stored\n");
  const std::string origin = Learn(options, request, signals, context, learnt);
  const bool changed =
      options.models || learnt.labels.has_news || learnt.changes_limits();
  const bool trained = !IsOnboarded(learnt.parent());
  if (changed && !(trained && options.dry_run)) {
    CompareWithParent(request, directory, learnt);
  }
  signals.EndWithin(std::chrono::milliseconds(0));
  report::Report report = ReportOf(learnt, origin);
  if (changed && !options.dry_run) {
    Store(options, context,
          trained ? SettingsText(learnt.labels.training) : SettingsText(learnt),
          learnt, report);
  } else {
    report.Line(changed ? "Nothing was stored: --dry-run"
                        : "Nothing was stored: nothing changes");
  }
  return report;
}

void AddOptions(CLI::App& verb, RelearnOptions& options) {
  verb.add_option("valve", options.valve,
                  "Id of the valve; a glob where several share a set")
      ->required()
      ->type_name("VALVE");
  // Recorded samples and labelled episodes, by default all since the observers
  // were made.
  options.window.AddTo(verb);
  verb.add_option("--runs", options.runs,
                  "Healthy runs, or stretches of them [s] (default: all of the "
                  "valve that fdi-monitor run --record stored); for a set of "
                  "train, runs to train on beside its own")
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  verb.add_option("--file", options.files,
                  "Healthy CSV file, not stored; repeatable")
      ->type_name("FILE.csv[@from:to]");
  options.table.AddTo(verb);
  verb.add_flag("--models", options.models,
                "Make the models of an onboarded valve anew, from their former "
                "record and from the healthy hours that you name")
      ->configurable(false);
  verb.add_option("--strength", options.strengths,
                  "Strength of the fault of an episode, instead of the "
                  "estimate")
      ->delimiter(',')
      ->type_name("EPISODE=S,...");
  verb.add_option("--type", options.type,
                  "Valve type that was saved with the set: valves onboarded "
                  "later get what labels taught")
      ->type_name("NAME");
  verb.add_flag("--skip-refused", options.skip_refused,
                "Do without labelled episodes that cannot be used, and without "
                "runs that are gone");
  verb.add_flag("--activate", options.activate,
                "Take the new version into use even if it is worse");
  verb.add_option("--jobs", options.threads,
                  "Number of threads; 0: one per core")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
  verb.add_flag("--dry-run", options.dry_run,
                "Show what would be learnt and exit")
      ->configurable(false);
  report::ShowInHelpAll(verb, {"--resample", "--type", "--jobs"});
}

}  // namespace

void AddRelearnVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "relearn",
      "Learn from labels and healthy hours, compare with the set in use, and "
      "take the better one",
      Relearn);
  AddOptions(verb, options);
  program.AddExamples(
      {{"relearn",
        {{"All that was recorded since, and what episodes were labelled",
          "fdi-trainer relearn FV-101"},
         {"What a week in a file would change",
          "fdi-trainer relearn FV-101 --file week.csv --dry-run"},
         {"With a day on which the valve was healthy and an alarm came",
          "fdi-trainer relearn FV-101 --models --file day.csv"}}}});
}

}  // namespace fdi::trainer
