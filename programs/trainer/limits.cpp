// fdi-trainer limits: the limits of an onboarded valve by more healthy hours.
// What becomes of them is decided in trainer/learning/limits_plan.h; here it is
// said, limit by limit, what changes and where the data came closest.
#include <optional>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "import/tag_map.h"
#include "programs/trainer/model_report.h"
#include "programs/trainer/verbs.h"
#include "report/program.h"
#include "report/report.h"
#include "report/verb_options.h"
#include "storage/database/data_directory.h"
#include "storage/models/model_codec.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/learning/limits_plan.h"
#include "trainer/rule_text.h"

namespace fdi::trainer {
namespace {

using report::FormatNumber;
using report::Json;

struct LimitsOptions {
  std::string valve;
  std::vector<std::string> runs;
  std::vector<std::string> files;
  importer::TableOptions table;
  std::string since;
  bool dry_run{false};
};

Json LimitsJson(const LimitsPlan& plan) {
  const ModelSet& parent = plan.parent();
  const std::vector<Limit> before = LimitsOf(parent);
  const std::vector<Limit> after = LimitsOf(plan.limits.models);
  Json rows = Json::array();
  for (std::size_t i = 0; i < before.size(); ++i) {
    const ChannelSpec& channel = parent.channels[before[i].channel];
    rows.push_back({{"channel", channel.name},
                    {"unit", UnitOf(channel.output, parent.flow_unit)},
                    {"window", before[i].window},
                    {"limit", LimitKindName(before[i].kind)},
                    {"before", before[i].value},
                    {"after", after[i].value},
                    {"seen", plan.peaks[i].share * before[i].value},
                    {"seen_in", plan.peaks[i].run},
                    {"seen_utc", FormatTime(plan.peaks[i].stamp_ns, true)}});
  }
  return rows;
}

// Only the faults for which the smallest strength that passes a limit has
// changed.
Json VisibilityJson(const std::vector<Visibility>& faults) {
  Json rows = Json::array();
  for (const Visibility& fault : faults) {
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

Json EpisodesJson(const LimitsPlan& plan) {
  Json rows = Json::array();
  const auto row = [](const LabelledEpisode& episode) -> Json {
    return {{"episode_id", episode.meaning.episode_id},
            {"label", episode.meaning.label},
            {"labelled_by", episode.meaning.labelled_by},
            {"samples", episode.meaning.samples},
            {"data", episode.data},
            {"alarms_before", Json()},
            {"alarms_after", Json()},
            {"refused", Json()}};
  };
  for (std::size_t i = 0; i < plan.labels.learnt.size(); ++i) {
    rows.push_back(row(plan.labels.learnt[i]));
    rows.back()["alarms_before"] = plan.false_alarms[i].alarms_before;
    rows.back()["alarms_after"] = plan.false_alarms[i].alarms_after;
  }
  for (const LabelledEpisode& episode : plan.labels.refused) {
    rows.push_back(row(episode));
    rows.back()["refused"] = episode.refusal;
  }
  return rows;
}

// Time that the limits do not rest on: that of episodes, and that of samples
// that would not have been judged, by the quality that they would have had.
Json LeftOutJson(const LimitsPlan& plan) {
  Json rows = Json::array();
  const auto add = [&](std::string reason, double seconds) {
    if (seconds > 0.0) {
      rows.push_back({{"reason", std::move(reason)}, {"seconds", seconds}});
    }
  };
  add("episodes", plan.episodes_left_out_s);
  for (std::size_t i = 0; i < kQualityCount; ++i) {
    const auto quality = static_cast<Quality>(i);
    add(std::string(QualityName(quality)),
        plan.parent().sample_period_s *
            static_cast<double>(plan.healthy.left_out[quality]));
  }
  return rows;
}

void AddTables(report::Report& report) {
  report.Table("limits", {{"channel", "channel"},
                          {"unit", "unit"},
                          {"limit", "limit"},
                          {"window [samples]", "window"},
                          {.heading = "before", .key = "before", .decimals = 3},
                          {.heading = "after", .key = "after", .decimals = 3},
                          {.heading = "seen", .key = "seen", .decimals = 3}});
  report.Line(
      "seen: the most in the healthy data, for as many samples as an alarm "
      "takes\n");
  report.Table("episodes", {{"episode", "episode_id"},
                            {"label", "label"},
                            {"by", "labelled_by"},
                            {"samples", "samples"},
                            {"data", "data"},
                            {"alarm before", "alarms_before"},
                            {"alarm after", "alarms_after"},
                            {"refused because", "refused"}});
  report.Table("left_out", {{"left out", "reason"},
                            {"time", "seconds", report::Format::kDuration}});
  report.Table("faults", {{"fault", "fault"},
                          {"passes a limit from", "before"},
                          {"now from", "after"}});
}

// The limits that the data passed, and where: somebody should know.
void AddPassed(const LimitsPlan& plan, report::Report& report) {
  const std::vector<Limit> limits = LimitsOf(plan.parent());
  for (std::size_t i = 0; i < limits.size(); ++i) {
    const Peak& peak = plan.peaks[i];
    if (peak.share > 1.0) {
      report.Line("passed: channel " +
                  plan.parent().channels[limits[i].channel].name + ", " +
                  LimitText(limits[i]) + ", " + Digits(peak.share, 3) +
                  " times, most in " + peak.run + " at " +
                  FormatTime(peak.stamp_ns, true));
    }
  }
}

// What the rod may deviate by; null without a floor.
Json FloorJson(const ModelSet& models) {
  return models.floor ? Json(models.floor->deviation) : Json();
}

// Where the limits come from, in one sentence.
std::string OriginText(const LimitsPlan& plan) {
  const std::string hours = FormatNumber(plan.limits.hours, 2) + " h";
  if (plan.limits.fitted) {
    return hours + " of healthy data; the limits were made from " +
           FormatNumber(plan.parent().threshold_hours, 2) +
           " h before. Limits that the data passed are wider now, the others "
           "as close as the data allow.";
  }
  const std::string why =
      plan.limits.hours < plan.parent().threshold_hours
          ? "These are fewer hours than the " +
                FormatNumber(plan.parent().threshold_hours, 2) +
                " h that the limits were made from"
          : "They cover less than 80 % of the commands that the limits hold "
            "for";
  return hours + " of healthy data. " + why +
         ": limits that the data passed are wider now, the others are as they "
         "were.";
}

report::Report ReportOf(const LimitsPlan& plan, const ModelSet& models,
                        bool stored) {
  const ModelSet& parent = plan.parent();
  report::Report report;
  report.document = {
      {"model_set", models.name},
      {"version", stored ? Json(models.version) : Json()},
      {"content_hash",
       stored ? Json(storage::HashHex(models.content_hash)) : Json()},
      {"parent",
       {{"model_set", parent.name},
        {"version", parent.version},
        {"content_hash", storage::HashHex(parent.content_hash)}}},
      {"since_utc", FormatTime(plan.since_ns, true)},
      {"runs", plan.runs},
      {"hours", plan.limits.hours},
      {"hours_before", parent.threshold_hours},
      {"hours_after", models.threshold_hours},
      {"fitted", plan.limits.fitted},
      {"limits", LimitsJson(plan)},
      {"rod_deviation_before", FloorJson(parent)},
      {"rod_deviation_after", FloorJson(models)},
      {"episodes", EpisodesJson(plan)},
      {"left_out", LeftOutJson(plan)},
      {"faults", VisibilityJson(plan.faults)}};
  report.Line(OriginText(plan) + "\n");
  AddTables(report);
  AddPassed(plan, report);
  if (parent.floor != models.floor) {
    report.Line("floor: the rod may deviate from the command by " +
                FormatNumber(models.floor->deviation, 1) + " % instead of " +
                FormatNumber(parent.floor->deviation, 1) + " %");
  }
  report.Line(AlarmRateText(models));
  for (std::size_t i = 0; i < plan.labels.learnt.size(); ++i) {
    const FalseAlarm& alarm = plan.false_alarms[i];
    const std::string episode =
        "Episode " + plan.labels.learnt[i].meaning.episode_id;
    if (alarm.alarms_after) {
      report.Line(episode +
                  " was labelled false and would still be an alarm: another "
                  "test than these limits finds it.");
    } else if (!alarm.alarms_before) {
      report.Line(episode +
                  " is no alarm by its samples alone: the second look raised "
                  "it, or what went before it.");
    }
  }
  if (stored) {
    report.Line("model set " + NameOf(models) + ", hash " +
                storage::HashHex(models.content_hash) + ", built on " +
                NameOf(parent) + ", is assigned to the valve");
  } else {
    report.Line(plan.changes() ? "Nothing was stored: --dry-run"
                               : "Nothing was stored: no limit changes");
  }
  return report;
}

report::Report Run(const LimitsOptions& options,
                   const report::Context& context) {
  if (options.files.empty() && options.table.given()) {
    throw ConfigError("--map, --zone and --resample are of --file");
  }
  LimitsRequest request;
  request.valve = options.valve;
  request.runs = options.runs;
  if (!options.since.empty()) {
    request.since_ns = report::TimeWindow{options.since, ""}.since_ns(context);
  }
  // What else the set reads is asked of its channels: not every valve has it.
  const importer::CsvOptions csv{.map = options.table.Read(context.options.utc),
                                 .required = MaskOf(Signal::kCv),
                                 .log = context.log};
  for (const std::string& file : options.files) {
    request.files.push_back(ReadRunFile(file, csv));
  }
  const storage::DataDirectory directory{context.options.data_dir};
  LimitsPlan plan = MakeLimitsPlan(std::move(request), directory);
  const bool store = plan.changes() && !options.dry_run;
  const ModelSet models = store ? StoreLimits(plan, options.valve, directory,
                                              context.software, NowNs())
                                : plan.limits.models;
  return ReportOf(plan, models, store);
}

}  // namespace

void AddLimitsVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "limits",
      "Set the limits of an onboarded valve by more healthy hours, and by "
      "alarms that were labelled false",
      Run);
  verb.add_option("--valve", options.valve, "Id of the valve")
      ->required()
      ->type_name("ID");
  verb.add_option("--runs", options.runs,
                  "Healthy runs, or stretches of them [s] (default: all of the "
                  "valve that fdi-monitor run --record stored)")
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  verb.add_option("--file", options.files,
                  "Healthy CSV file, not stored; repeatable")
      ->type_name("FILE.csv[@from:to]");
  options.table.AddTo(verb);
  verb.add_option("--since", options.since,
                  "Recorded samples and labelled episodes from then on "
                  "(default: since the valve was onboarded)")
      ->type_name("TIME");
  verb.add_flag("--dry-run", options.dry_run,
                "Show what the limits would become and exit")
      ->configurable(false);
  program.AddExamples(
      {{"limits",
        {{"All that was recorded since, and alarms labelled false",
          "fdi-trainer limits --valve FV-101"},
         {"What a week in a file would change",
          "fdi-trainer limits --valve FV-101 --file week.csv --dry-run"}}}});
}

}  // namespace fdi::trainer
