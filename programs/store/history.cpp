// fdi-store history: list, show, export, plot. The other verbs of the group are
// in alarms.cpp.
#include <algorithm>

#include "base/csv_cells.h"
#include "base/text.h"
#include "base/time_units.h"
#include "programs/store/verbs.h"
#include "report/fault_texts.h"
#include "report/plot/episode_figure.h"
#include "report/plot/episode_text.h"
#include "report/text_table.h"
#include "storage/history/history_reader.h"
#include "storage/history/strength.h"

namespace fdi::storage {
namespace {

using plot::IntervalText;
using report::Align;
using report::Column;
using report::Format;
using report::Tone;

// A shelf hides any other state.
std::string AlarmText(const Json& row) {
  return row["shelved_until_utc"].is_null()
             ? row["alarm_state"].get<std::string>()
             : std::string(AlarmStateName(AlarmState::kShelved));
}

Tone ToneOf(const Json& row) {
  const std::string state = AlarmText(row);
  return state == AlarmStateName(AlarmState::kShelved)  ? Tone::kQuiet
         : state == AlarmStateName(AlarmState::kNormal) ? Tone::kPlain
         : state == AlarmStateName(AlarmState::kReturnedUnacked)
             ? Tone::kWarning
             : Tone::kAlarm;
}

// The width to which a fault's name may be cut.
constexpr std::size_t kLeastName = 15;

// "20 s" from the detection to the time under `key`, or "-" if that has not
// come yet.
std::string After(const Json& row, const char* key) {
  const auto stamp = [&row](const char* of) {
    return ParseTime(row[of].get<std::string>(), true);
  };
  return row[key].is_null()
             ? "-"
             : FormatDuration(stamp(key) - stamp("detected_utc"));
}

// Rows of the plant history also have host and monitor.
Json ListedJson(const Alarm& alarm, const ValveNotes& valves) {
  const Episode& e = alarm.episode;
  Json row = EpisodeJson(alarm, valves);
  if (!e.monitor.empty()) {
    row.update({{"host", e.host}, {"monitor", e.monitor}});
  }
  return row;
}

// "2026-11-20 14:56", by the clock on the wall: a list is for finding an
// episode, and `history show` has the seconds.
std::string WallClock(const Json& time, bool utc) {
  const std::int64_t stamp_ns = ParseTime(time.get<std::string>(), true);
  std::string text = FormatTime(stamp_ns / 1'000'000'000 * 1'000'000'000, utc);
  text.resize(std::min(text.size(), std::size_t{16}));
  std::replace(text.begin(), text.end(), 'T', ' ');
  return text + (utc ? "Z" : "");
}

// "f19", or "f19 and f1" with what came on top.
std::string FaultText(const Json& row) {
  const Json& fault = row["fault"];
  const Json& second = row["second"];
  return (fault.is_null() ? "-" : fault.get<std::string>()) +
         (second.is_null() ? "" : " and " + second.get<std::string>());
}

// The last work done on the valve since the detection: "recalibrated". An
// order and what is noted ahead of time are not done.
auto LastWorkBy(std::int64_t now_ns) {
  return [now_ns](const Json& row) {
    std::string text = "-";
    for (const Json& repair : row["repairs"]) {
      const std::string kind = repair["kind"];
      if (kind != ValveEventKindName(ValveEventKind::kOrdered) &&
          ParseTime(repair["at_utc"].get<std::string>(), true) <= now_ns) {
        text = kind;
      }
    }
    return text;
  };
}

std::string EndText(const Json& row) {
  return !row["unconfirmed_utc"].is_null() ? "not confirmed"
         : row["end_reason"].is_null()     ? "open"
                                       : row["end_reason"].get<std::string>();
}

Report ListEpisodes(const HistoryOptions& options, const Context& context) {
  const auto history = OpenHistory(options.plant, context);
  EpisodeFilter filter = options.filter.Filter(context);
  if (options.shelved) {
    return ListShelf(*history, filter, context);
  }
  filter.limit = options.rows;
  auto episodes = history->List(filter);
  NameFaults(episodes, context);
  const std::vector<Alarm> alarms =
      history->Alarms(std::move(episodes), filter.now_ns);
  Report report;
  const std::int64_t as_of_ns = filter.now_ns / kNsPerSecond * kNsPerSecond;
  report.document["as_of_utc"] = FormatTime(as_of_ns, true);
  const auto valves = NotesOf(options.plant, context);
  report.document["episodes"] = Rows(alarms, [&valves](const Alarm& alarm) {
    return ListedJson(alarm, valves);
  });
  std::vector<std::string> keys = EpisodeKeys();
  if (options.plant.asked()) {
    keys.insert(keys.end(), {"host", "monitor"});
  }
  report.Csv("episodes", keys);
  // For two faults, the text that a narrow list keeps has to say so.
  Column meaning = TextColumn("meaning", [](const Json& row) {
    const Json& name = row["fault_name"];
    return (row["second"].is_null() ? "" : FaultText(row) + ": ") +
           (name.is_null() ? "-" : name.get<std::string>());
  });
  meaning.least_width = kLeastName;
  Column alarm = TextColumn("alarm", AlarmText);
  alarm.tone = ToneOf;
  std::vector<Column> columns = {
      {"episode", "episode_id"},
      {"valve", "valve_id"},
      {"description", "about/description", Format::kPlain, 0, 6},
      TextColumn("detected",
                 [utc = context.options.utc](const Json& row) {
                   return WallClock(row["detected_utc"], utc);
                 }),
      alarm,
      {"severity", "severity", Format::kPlain, 0, 1},
      TextColumn("fault", FaultText, 4),
      meaning,
      {"how sure", "certainty", Format::kPlain, 0, 3},
      {"now", "strength", Format::kPercent, 0, 2},
      {"worst", "worst_strength", Format::kPercent, 0, 5},
      TextColumn(
          "named after",
          [](const Json& row) {  // A name that was withdrawn is none.
            return row["fault"] == "unknown" ? "" : After(row, "isolated_utc");
          },
          6, Align::kRight),
      TextColumn(
          "lasted", [](const Json& row) { return After(row, "returned_utc"); },
          5, Align::kRight),
      TextColumn("end", EndText, 5),
      {"label", "label", Format::kPlain, 0, 6},
      TextColumn("repaired", LastWorkBy(filter.now_ns), 7),
      {"acked by", "acked_by", Format::kPlain, 0, 7},
      {"model set", "model_set", Format::kPlain, 0, 8}};
  if (options.plant.asked()) {
    columns.insert(columns.begin() + 1, {{"host", "host", Format::kPlain, 0, 9},
                                         {"monitor", "monitor"}});
  }
  report.Table("episodes", columns, "no episode matches");
  return report.Line("as of " + TimeText(as_of_ns, context));
}

// Transitions have faults and a factor; operator actions have a who.
Json HistoryEntryJson(const HistoryEntry& event) {
  const bool by_hand = !event.who.empty();
  return {{"kind", event.kind},
          {"stamp_utc", TimeJson(event.stamp_ns)},
          {"recorded_utc", TimeJson(event.recorded_ns)},
          {"faults", TextJson(event.faults)},
          {"factor", by_hand ? Json() : NumberJson(event.factor)},
          {"strength", by_hand ? Json() : NumberJson(event.strength)},
          {"priority", event.priority ? Json(*event.priority) : Json()},
          {"reason", TextJson(event.reason)},
          {"layer", TextJson(event.layer)},
          {"who", TextJson(event.who)},
          {"value", TextJson(event.value)},
          {"comment", TextJson(event.comment)},
          {"origin", TextJson(event.origin)}};
}

constexpr const char* kByPhysics = "by simulation of the valve";

bool ByPhysics(const std::string& layer) {
  return layer == LayerName(Layer::kPhysics);
}

// The text of SECOND: a fault on top of those of the episode.
std::string SecondText(const std::string& value) {
  return value == "none"      ? "alone again"
         : value == "unknown" ? "more than one fault, among them these"
                              : "and " + value;
}

// Why the engine changed its mind, or what a person did, from where and why.
std::string NoteText(const HistoryEntry& event) {
  if (event.who.empty()) {
    if (const auto severity = event.priority && event.kind == "CHANGED"
                                  ? SeverityOf(*event.priority)
                                  : std::nullopt) {
      return "now " + std::string(SeverityName(*severity));
    }
    if (event.kind == "SECOND") {
      return SecondText(event.value);
    }
    if (!event.value.empty()) {
      return event.value;  // The drift of a position.
    }
    if (event.kind == "REISOLATED" && event.faults.empty()) {
      return "name withdrawn";
    }
    return ByPhysics(event.layer) ? kByPhysics : event.reason;
  }
  return event.value + (event.value.empty() ? "" : " ") + "by " + event.who +
         (event.origin.empty() ? "" : " (" + event.origin + ")") +
         (event.comment.empty() ? "" : ": " + event.comment);
}

void AddEvents(const std::vector<HistoryEntry>& events, const Context& context,
               Report& report) {
  report.document["events"] = Rows(events, HistoryEntryJson);
  report::TextTable table({{"event"},
                           {"at"},
                           {"faults"},
                           {"strength [-]", Align::kRight},
                           {"note"}});
  for (const HistoryEntry& event : events) {
    const bool by_hand = !event.who.empty();
    table.AddRow({event.kind, TimeText(event.stamp_ns, context), event.faults,
                  by_hand || event.faults.empty()
                      ? ""
                      : report::FormatNumber(event.strength, 3),
                  NoteText(event)});
  }
  AddTextTable(report, table);
}

Json LookFaultJson(const LookFault& f) {
  return {{"fault", FaultName(f.fault)},
          {"strength", f.strength},
          {"lowest", f.lowest},
          {"highest", f.highest},
          {"begins_utc", TimeJson(f.begins_ns)},
          {"growing", f.growing}};
}

void AddLook(const std::optional<EpisodeLook>& look, const Context& context,
             Report& report) {
  report.document["look"] = Json();
  if (!look) {
    return;
  }
  report.document["look"] = {{"misfit", look->misfit},
                             {"faults", Rows(look->faults, LookFaultJson)}};
  report::TextTable table({{"second look"},
                           {"strength [-]", Align::kRight},
                           {"95 % interval", Align::kRight},
                           {"begins"}});
  const auto number = [](double value) {
    return report::FormatNumber(value, 2);
  };
  for (const LookFault& f : look->faults) {
    table.AddRow(
        {FaultName(f.fault), number(f.strength),
         f.lowest < f.highest ? number(f.lowest) + ".." + number(f.highest)
                              : "not known",
         TimeText(f.begins_ns, context) + (f.growing ? ", growing" : "")});
  }
  if (look->faults.empty()) {
    table.AddRow({"no fault fits"});
  }
  AddTextTable(report, table);
}

// In a unit of which there is one at least.
std::string TimeToFullText(const TimeToFull& full) {
  const auto [unit_s, unit] =
      full.seconds >= 86'400.0 ? std::pair(86'400.0, " days")
      : full.seconds >= 3600.0 ? std::pair(3600.0, " hours")
                               : std::pair(60.0, " minutes");
  return IntervalText(full.seconds / unit_s, full.lowest / unit_s,
                      full.highest / unit_s, 1, unit);
}

// "strength 0.42 (0.38 to 0.46), growing by 0.06 a day (0.04 to 0.08); full in
// 9.6 days (7.2 to 14.5)"
std::string GrowthText(const Growth& growth) {
  const StrengthPoint& last = growth.last;
  std::string text =
      "strength " + IntervalText(last.strength, last.lowest, last.highest, 2);
  if (growth.rate) {
    const GrowthRate& rate = *growth.rate;
    text += rate.grows()
                ? ", growing by " + IntervalText(rate.per_day, rate.lowest,
                                                 rate.highest, 2, " a day")
            : rate.falls()
                ? ", falling by " + IntervalText(-rate.per_day, -rate.highest,
                                                 -rate.lowest, 2, " a day")
                : ", neither growing nor falling";
  }
  if (growth.full) {
    text += "; full in " + TimeToFullText(*growth.full);
  }
  return text;
}

const char* TrendName(const GrowthRate& rate) {
  return rate.grows() ? "growing" : rate.falls() ? "falling" : "steady";
}

// All keys are there; those of a rate that is not known yet are null.
Json GrowthJson(const Growth& growth) {
  const StrengthPoint& last = growth.last;
  Json json = {{"fault", FaultName(last.fault)},
               {"stamp_utc", TimeJson(last.stamp_ns)},
               {"strength", last.strength},
               {"lowest", last.lowest},
               {"highest", last.highest},
               {"trend", Json()},
               {"per_day", Json()},
               {"per_day_lowest", Json()},
               {"per_day_highest", Json()},
               {"full_in_s", Json()},
               {"full_in_s_lowest", Json()},
               {"full_in_s_highest", Json()}};
  if (growth.rate) {
    json.update({{"trend", TrendName(*growth.rate)},
                 {"per_day", growth.rate->per_day},
                 {"per_day_lowest", growth.rate->lowest},
                 {"per_day_highest", growth.rate->highest}});
  }
  if (growth.full) {
    json.update({{"full_in_s", growth.full->seconds},
                 {"full_in_s_lowest", growth.full->lowest},
                 {"full_in_s_highest", growth.full->highest}});
  }
  return json;
}

// One estimate of the series that GrowthOf() is computed from.
Json StrengthJson(const StrengthPoint& p) {
  return {{"stamp_utc", TimeJson(p.stamp_ns)},
          {"fault", FaultName(p.fault)},
          {"strength", p.strength},
          {"lowest", p.lowest},
          {"highest", p.highest},
          {"layer", LayerName(p.layer)}};
}

void AddGrowth(const Episode& episode,
               const std::vector<StrengthPoint>& strengths,
               const Context& context, Report& report) {
  const std::vector<Growth> growths = GrowthOf(episode, strengths);
  report.document["growth"] = Rows(growths, GrowthJson);
  report.document["strengths"] = Rows(strengths, StrengthJson);
  for (const Growth& growth : growths) {
    report.Line(FaultName(growth.last.fault) + ": " + GrowthText(growth) +
                ", as of " + TimeText(growth.last.stamp_ns, context));
  }
}

struct ShowOptions {
  std::string id;
  PlantOptions plant;
};

Report ShowEpisode(const ShowOptions& options, const Context& context) {
  const auto history = OpenHistory(options.plant, context);
  std::vector<Episode> shown{history->Show(options.id)};
  NameFaults(shown, context);
  const Alarm alarm = history->Alarms(std::move(shown), NowNs()).front();
  const Episode& e = alarm.episode;
  Report report;
  const auto valves = NotesOf(options.plant, context);
  report.document = ListedJson(alarm, valves);
  report.document.update(
      {{"source_id", Hex16(e.source_id)},
       {"model_hash", Hex16(e.model_hash)},
       {"lowest", e.lowest ? NumberJson(*e.lowest) : Json()},
       {"highest", e.highest ? NumberJson(*e.highest) : Json()},
       {"unknown_kind", TextJson(e.unknown_kind)},
       {"layer", TextJson(e.layer)},
       {"shelf", alarm.shelf ? ShelfJson(*alarm.shelf) : Json()},
       {"trace_instants", history->Trace(e.id).size()}});
  if (!e.monitor.empty()) {
    report.Fields("", {TextField("monitor", e.host + "/" + e.monitor)});
  }
  if (const std::string about =
          findings::AboutText(findings::IdentityOf(valves.about, e.valve_id));
      !about.empty()) {
    report.Fields("", {TextField("description", about)});
  }
  report.Fields(
      "", plot::EpisodeFields(alarm, report::LoadFaultTexts(context.options),
                              context.options.utc));
  for (const Json& repair : report.document["repairs"]) {
    const auto text = [&repair](const char* key, const char* before) {
      const Json& value = repair[key];
      return value.is_string() && value != ""
                 ? before + value.get<std::string>()
                 : "";
    };
    const std::int64_t at_ns =
        ParseTime(repair["at_utc"].get<std::string>(), true);
    report.Fields(
        "", {TextField("work",
                       repair["kind"].get<std::string>() + ", " +
                           TimeText(at_ns, context) + text("who", " by ") +
                           text("order", ", order ") + text("note", ": "))});
  }
  AddEvents(history->Events(e.id), context, report);
  AddLook(history->Look(e.id), context, report);
  AddGrowth(e, history->Strengths(e.id), context, report);
  return report;
}

// Round-trips bit for bit; "nan" for NaN.
std::string CsvNumber(double value) {
  if (std::isnan(value)) {
    return "nan";
  }
  return NumberText(value);
}

// CSV heading of a signal, as in the import format.
std::string Heading(Signal signal, FlowUnit flow_unit, bool has_pv) {
  std::string name(SignalName(signal));
  if (signal == Signal::kSp && has_pv) {
    return name;  // In the unit of PV.
  }
  if (signal == Signal::kF) {
    return name + (flow_unit == FlowUnit::kM3PerHour ? "_m3_h" : "_t_h");
  }
  const std::string unit(SignalUnit(signal));
  return name + (unit == "%" ? "_pct" : unit.empty() ? "" : "_" + unit);
}

// One row per instant: time, verdict, the signals of the valve, residuals by
// channel, decision factors. Missing values are nan.
void WriteTrace(const Episode& episode, const std::vector<TracePoint>& trace,
                std::ostream& out) {
  SignalMask present = 0;
  for (const TracePoint& instant : trace) {
    present = static_cast<SignalMask>(present | instant.sample.present);
  }
  std::vector<Signal> signals;
  std::vector<std::string> cells = {"t_s",    "stamp_ns", "seq",
                                    "intake", "quality",  "state"};
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((present & MaskOf(signal)) != 0) {
      signals.push_back(signal);
      cells.push_back(Heading(signal, episode.flow_unit,
                              (present & MaskOf(Signal::kPv)) != 0));
    }
  }
  for (const std::string& channel : episode.channels) {
    cells.push_back("r_" + channel);
  }
  cells.emplace_back("d_0");
  for (const std::string& fault : episode.faults) {
    cells.push_back("d_" + fault);
  }
  WriteCsvLine(out, cells);
  for (const TracePoint& instant : trace) {
    const Sample& sample = instant.sample;
    cells = {
        CsvNumber(static_cast<double>(sample.stamp_ns - episode.detected_ns) /
                  1e9),
        std::to_string(sample.stamp_ns),
        std::to_string(sample.seq),
        std::string(IntakeName(instant.intake)),
        std::string(QualityName(instant.quality)),
        std::string(StateName(instant.state))};
    for (const Signal signal : signals) {
      cells.push_back(
          CsvNumber(sample.Has(signal) ? sample[signal] : std::nan("")));
    }
    for (const double residual : instant.residuals) {
      cells.push_back(CsvNumber(residual));
    }
    cells.push_back(CsvNumber(instant.normal_factor));
    for (const double factor : instant.factors) {
      cells.push_back(CsvNumber(factor));
    }
    WriteCsvLine(out, cells);
  }
}

struct EpisodeExportOptions {
  std::string id;
  std::string output;
};

int ExportEpisode(const EpisodeExportOptions& options, const Context& context) {
  HistoryReader reader(DataOf(context).history());
  const Episode episode = reader.Show(options.id);
  const auto trace = reader.Trace(episode.id);
  report::WriteOutput(options.output, [&](std::ostream& out) {
    WriteTrace(episode, trace, out);
  });
  return report::kExitOk;
}

struct PlotOptions {
  std::string id;
  std::string output;
  report::TimeWindow window;
};

Report PlotEpisode(const PlotOptions& options, const Context& context) {
  const DataDirectory data = DataOf(context);
  HistoryReader reader(data.history());
  const plot::EpisodeEvidence evidence =
      plot::LoadEvidence(reader, options.id, data.models());
  const Episode& episode = evidence.episode;
  plot::EpisodeFigureOptions figure;
  const auto after_detection = [&episode](std::int64_t stamp_ns) {
    return static_cast<double>(stamp_ns - episode.detected_ns) * 1e-9;
  };
  if (!options.window.since.empty()) {
    figure.from_s = after_detection(options.window.since_ns(context));
  }
  if (!options.window.until.empty()) {
    figure.to_s = after_detection(options.window.until_ns(context));
  }
  figure.fault_name =
      plot::PlainName(episode, report::LoadFaultTexts(context.options));
  const std::filesystem::path path =
      options.output.empty() ? episode.episode_id + ".png" : options.output;
  plot::DrawFigure(plot::EpisodeFigure(evidence, figure), path);
  Report report;
  report.document = {{"episode_id", episode.episode_id},
                     {"file", path.string()}};
  return report.Line("drawn to " + path.string());
}

}  // namespace

void AddHistoryVerbs(report::Program& program) {
  CLI::App& group = program.AddGroup(
      "history",
      "Fault episodes: what happened, how certain it is, who has seen it");
  auto [list, list_options] =
      AddVerb(program, group, "list", "List the episodes, the newest last",
              ListEpisodes);
  list_options.filter.AddTo(list);
  list.add_option("--rows", list_options.rows,
                  "At most this many, the newest ones; 0: all")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N");
  list.add_flag("--shelved", list_options.shelved,
                "List what is shelved or planned to be instead, by whom and "
                "why; with --from also what was shelved since then");
  list_options.plant.AddTo(list);
  program.AllowCsv(list, "The columns of fault_history as CSV");

  auto [show, shown] =
      AddVerb(program, group, "show",
              "Show an episode, what to check, and its events", ShowEpisode);
  AddEpisode(show, shown.id);
  shown.plant.AddTo(show);
  AddAlarmVerbs(program, group);

  auto [exporting, exported] =
      AddVerb(program, group, "export", "Write the trace of an episode as CSV",
              ExportEpisode);
  AddEpisode(exporting, exported.id);
  AddOutput(exporting, exported.output);

  auto [plot, plotted] =
      AddVerb(program, group, "plot",
              "Draw the evidence of an episode for a report, with gnuplot",
              PlotEpisode);
  AddEpisode(plot, plotted.id);
  plot.add_option("-o,--output", plotted.output, "Default: ID.png")
      ->type_name("FILE.png|FILE.svg");
  plotted.window.AddTo(plot);
}

}  // namespace fdi::storage
