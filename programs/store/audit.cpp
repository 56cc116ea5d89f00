// fdi-store audit: judges control loops from their ordinary records.
#include "diagnosis/loop/audit.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <map>
#include <span>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "import/csv.h"
#include "import/sniff.h"
#include "import/tag_map.h"
#include "programs/store/verbs.h"
#include "report/help.h"
#include "report/plot/loop_figure.h"
#include "storage/runs/runs.h"

namespace fdi::storage {
namespace {

using loop::Verdict;
using report::Column;
using report::Format;
using report::Tone;

struct AuditOptions {
  std::vector<std::string> files;
  std::vector<std::string> runs;
  std::string valve;
  importer::LoopNames names;
  std::string service;
  double period_s{0.0};
  double window_s{7200.0};
  std::string plot;
  importer::TableOptions table;
};

// The record of one loop, cut into stretches without a gap. `gain_sign` is that
// of the loop, from OP to what is judged: 0 if only the record can tell.
struct LoopRecord {
  std::string loop;
  std::string tag{};  // Column of OP.
  std::string source;
  bool dated{false};
  bool has_sp{true};  // In the unit of F.
  int gain_sign{0};
  double open_op{100.0};  // As in loop::Window.
  std::vector<SampleSeries> stretches;
};

// A map of the loop's columns, so that the importer reads loops, too. Settings
// that the user's map leaves open, other than signals, are left to the reader,
// which refuses what it cannot know.
importer::ColumnMap LoopMap(const TextLines& lines, const AuditOptions& options,
                            const std::string& source) {
  importer::ColumnMap map = options.table.Read(false);
  if (!map.columns.empty()) {
    map.mode_column =
        options.names.mode.empty() ? map.mode_column : options.names.mode;
    return map;
  }
  const importer::Sniffed found = importer::ScanColumns(lines, map);
  map.long_table = found.map.long_table;
  if (std::filesystem::is_directory(source) && !map.long_table) {
    throw ConfigError(source +
                      ": its files have more than one tag each; expected the "
                      "files, a loop each, and not their folder");
  }
  importer::GuessLoop(found.columns, options.names, source, map);
  return map;
}

LoopRecord ReadLoop(const std::string& file, const AuditOptions& options,
                    const Context& context) {
  const TextLines lines = TextLines::OfFile(file);
  importer::CsvOptions csv;
  csv.map = LoopMap(lines, options, file);
  csv.split_gaps = true;
  // A PV is in any unit, so the plausible range of F does not apply to it.
  csv.check_values = false;
  csv.skip_repeats = true;
  csv.log = context.log;
  csv.period_s = options.period_s;
  importer::CsvTable table = importer::ReadCsv(lines, csv);
  // A lost sample or two would cut a window that is long enough otherwise.
  if (table.runs.size() > 1 && !csv.map.resampling) {
    const double period_s = table.runs.front().period_s;
    csv.map.resampling = importer::Resampling{period_s, false, 3.0 * period_s};
    table = importer::ReadCsv(lines, csv);
  }
  LoopRecord record;
  const auto path = std::filesystem::path(file);
  record.loop = (path.has_filename() ? path : path.parent_path()).stem();
  record.source = file;
  record.dated = table.dated;
  const auto has = [&](std::string_view name) {
    return std::ranges::any_of(csv.map.columns,
                               [&](const importer::ColumnMapping& m) {
                                 return SameName(m.column, name);
                               });
  };
  // The contract's CV is % of closing: flow falls with it.
  record.gain_sign = has("CV_pct") && !has("PV") ? -1 : 0;
  // Mapped, OP is % of closing where the map states its sense.
  const bool is_mapped = !options.table.Read(false).columns.empty();
  for (const importer::ColumnMapping& column : csv.map.columns) {
    if (column.signal == Signal::kCv) {
      record.tag = column.column;
      record.open_op = has("CV_pct") || column.sense == Sense::kOpening ? 0.0
                       : is_mapped ? std::numeric_limits<double>::quiet_NaN()
                                   : record.open_op;
    }
  }
  record.stretches = std::move(table.runs);
  return record;
}

LoopRecord ReadRun(const std::string& selector, RunStore& store) {
  const StoredRun run = store.Load(selector);
  LoopRecord record;
  record.loop = run.info.run.valve_id;
  record.source = "run " + run.info.id;
  record.dated = true;
  record.gain_sign = -1;
  record.open_op = 0.0;
  // Beside F, the set point of a valve's loop is in %.
  record.has_sp = false;
  for (const StoredSample& stored : run.samples) {
    if (stored.intake != Intake::kAccepted) {
      continue;
    }
    auto& stretches = record.stretches;
    const std::int64_t step_ns =
        stretches.empty() ? 0
                          : stored.sample.stamp_ns -
                                stretches.back().samples.back().sample.stamp_ns;
    if (stretches.empty() ||
        static_cast<double>(step_ns) > 1.5e9 * run.info.run.period_s) {
      stretches.emplace_back().period_s = run.info.run.period_s;
    }
    stretches.back().samples.push_back({stored.sample, {}});
  }
  return record;
}

bool IsJudged(const Sample& sample) {
  return sample.mode == ValveMode::kAuto && sample.Has(Signal::kCv) &&
         (sample.Has(Signal::kPv) || sample.Has(Signal::kF) ||
          sample.Has(Signal::kX));
}

using Samples = std::span<const LabelledSample>;

// Stretches in automatic with readings of OP and PV.
std::vector<Samples> Stretches(const SampleSeries& series) {
  std::vector<Samples> stretches;
  const Samples all(series.samples);
  for (std::size_t begin = 0; begin < all.size();) {
    const auto is = [](const LabelledSample& s) { return IsJudged(s.sample); };
    const auto from = static_cast<std::size_t>(
        std::find_if(all.begin() + static_cast<std::ptrdiff_t>(begin),
                     all.end(), is) -
        all.begin());
    const auto to = static_cast<std::size_t>(
        std::find_if_not(all.begin() + static_cast<std::ptrdiff_t>(from),
                         all.end(), is) -
        all.begin());
    if (to > from) {
      stretches.push_back(all.subspan(from, to - from));
    }
    begin = std::max(to, begin + 1);
  }
  return stretches;
}

// Where a window ends that begins at 0 and should have `length` samples: at the
// step of SP nearest to that end, if one is within half a window, so that a new
// operating point begins a new window. Steps inside a window stay: by moving OP
// they show a play that is hidden at rest.
std::size_t EndOfWindow(Samples rest, std::size_t length) {
  if (2 * rest.size() <= 3 * length) {
    return rest.size();
  }
  std::size_t end = length;
  std::size_t nearest = length / 2;
  for (std::size_t k = length / 2 + 1; k < length + length / 2; ++k) {
    const std::size_t off = k > length ? k - length : length - k;
    if (off < nearest &&
        rest[k].sample[Signal::kSp] != rest[k - 1].sample[Signal::kSp]) {
      nearest = off;
      end = k;
    }
  }
  return end;
}

std::vector<double> Series(Samples samples, Signal signal) {
  std::vector<double> values;
  for (const LabelledSample& labelled : samples) {
    if (!labelled.sample.Has(signal)) {
      return {};
    }
    values.push_back(labelled.sample[signal]);
  }
  return values;
}

struct Judged {
  std::string loop;
  std::string source;
  std::optional<std::int64_t> start_ns;
  std::int64_t end_ns{0};
  double from_s{0.0};
  char service{'\0'};
  loop::Window window;
  loop::Audit audit;
  std::string hint;
};

// The loop of `part`; nothing if no PV, F or X is there throughout. It is read
// off the first of these that is: a change from one to another within a window
// would look like a step of the process.
std::optional<loop::Window> WindowOf(Samples part, double period_s,
                                     char service, const LoopRecord& record,
                                     const AuditOptions& options) {
  loop::Window window;
  window.period_s = period_s;
  window.op = Series(part, Signal::kCv);
  if (!options.names.ignore_x) {
    window.x = Series(part, Signal::kX);
  }
  const bool of_valve = record.gain_sign != 0;
  window.open_op = record.open_op;
  window.pv = Series(part, Signal::kPv);
  if (!window.pv.empty()) {
    // The sense of a valve's PV is known only from the record.
    window.sp = Series(part, Signal::kSp);
    loop::SetService(service, window);
    return window;
  }
  window.pv = Series(part, Signal::kF);
  if (window.pv.empty()) {
    window.pv = window.x;
  }
  if (window.pv.empty()) {
    return std::nullopt;
  }
  window.gain_sign = record.gain_sign;
  if (record.has_sp) {
    window.sp = Series(part, Signal::kSp);
  }
  if (of_valve) {
    // F over CV of a valve is no integral, whatever the loop is.
    window.integrating = false;
  } else {
    loop::SetService(service, window);
  }
  return window;
}

// A hint at what the user may want to change, from what was seen; may be empty.
std::string HintOf(const Judged& one, bool has_sp) {
  const loop::Evidence& e = one.audit.evidence;
  if (e.exchanged) {
    return "OP and PV seem exchanged; try --op and --pv the other way round";
  }
  if (!loop::IsPercent(one.window.op)) {
    const auto [low, high] = std::ranges::minmax_element(one.window.op);
    return "OP goes from " + report::FormatNumber(*low, 2) + " to " +
           report::FormatNumber(*high, 2) +
           ", which is not % of its span: band and range are in its own unit";
  }
  if (e.distinct_answer == 1) {
    const bool of_x = !one.window.x.empty();
    const auto& answer = of_x ? one.window.x : one.window.pv;
    return std::string(of_x ? "X" : "PV") + " is always " +
           report::FormatNumber(answer.front(), 2) + "; try " +
           (of_x ? "--x" : "--pv") + " if the right column is another";
  }
  if (one.window.sp.empty() && one.window.x.empty() && has_sp) {
    return "SP is not there throughout and taken as constant; try --sp COLUMN";
  }
  if (e.integrates && !one.window.integrating) {
    return "if PV is no level, try --service F";
  }
  return {};
}

// The service of the loop by its name, or by the tag of OP where that tells
// nothing: a file has any name.
char ServiceOf(const LoopRecord& record) {
  if (const char service = loop::ServiceOf(record.loop, record.gain_sign != 0);
      service != '\0') {
    return service;
  }
  const char service = loop::ServiceOf(record.tag);
  return std::string_view("FLPT").find(service) == std::string_view::npos
             ? '\0'
             : service;
}

// Cuts the stretches in automatic into windows and judges each. A slow record
// gets windows longer than `--window`, because an audit takes a number of
// samples, not of seconds. Parts that are too short are counted, and told once
// for the record.
void JudgeRecord(const LoopRecord& record, const AuditOptions& options,
                 std::vector<Judged>& judged, Json& skipped) {
  const char service =
      options.service.empty()
          ? ServiceOf(record)
          : static_cast<char>(std::toupper(
                static_cast<unsigned char>(options.service.front())));
  std::size_t short_ones = 0;
  const std::size_t before = judged.size();
  std::optional<std::int64_t> first_ns;
  for (const SampleSeries& series : record.stretches) {
    const auto length = std::max<std::size_t>(
        6 * loop::kMinSamples,
        static_cast<std::size_t>(options.window_s / series.period_s));
    for (Samples rest : Stretches(series)) {
      first_ns = first_ns.value_or(rest.front().sample.stamp_ns);
      while (!rest.empty()) {
        const Samples part = rest.first(EndOfWindow(rest, length));
        rest = rest.subspan(part.size());
        auto window = WindowOf(part, series.period_s, service, record, options);
        if (part.size() < loop::kMinSamples || !window) {
          ++short_ones;
          continue;
        }
        const std::int64_t begin_ns = part.front().sample.stamp_ns;
        Judged one;
        one.loop = record.loop;
        one.source = record.source;
        one.service = service;
        one.from_s = static_cast<double>(begin_ns - *first_ns) * 1e-9;
        if (record.dated) {
          one.start_ns = begin_ns;
          one.end_ns = part.back().sample.stamp_ns;
        }
        one.window = std::move(*window);
        one.audit = loop::AuditWindow(one.window);
        one.hint = HintOf(one, record.has_sp);
        judged.push_back(std::move(one));
      }
    }
  }
  if (judged.size() == before || short_ones > 0) {
    skipped.push_back(
        {{"source", record.source},
         {"reason",
          (judged.size() == before
               ? std::string("no window in AUTO with OP and PV has ")
               : std::to_string(short_ones) + " stretches have fewer than ") +
              std::to_string(loop::kMinSamples) +
              " samples between changes of mode, gaps and missing readings"}});
  }
}

Json Optional(bool known, double value) {
  return known ? NumberJson(value) : Json(nullptr);
}

// A figure for which the window has no evidence is null, not 0.
Json JudgedJson(const Judged& one) {
  const loop::Evidence& e = one.audit.evidence;
  const loop::PlayFit fit = e.fit.value_or(loop::PlayFit{});
  const bool has_band = e.band().has_value();
  const loop::Band band = e.band().value_or(loop::Band{});
  const loop::Oscillation wave = e.oscillation.value_or(loop::Oscillation{});
  const double period_s = one.window.period_s;
  const bool is_stiction = one.audit.verdict == Verdict::kStiction;
  return {
      {"loop", one.loop},
      {"source", one.source},
      {"start_utc", TimeJson(one.start_ns)},
      {"from_s", one.from_s},
      {"samples", e.samples},
      {"sample_period_s", period_s},
      {"service",
       one.service == '\0' ? Json(nullptr) : Json(std::string(1, one.service))},
      {"verdict", loop::VerdictName(one.audit.verdict)},
      {"certainty", !is_stiction     ? Json(nullptr)
                    : one.audit.sure ? Json("sure")
                                     : Json("likely")},
      {"reason", one.audit.reason},
      {"hint", one.hint.empty() ? Json(nullptr) : Json(one.hint)},
      {"read_off", one.window.x.empty() ? "PV" : "X"},
      {"integrates", e.integrates},
      {"band_pct", Optional(has_band, band.width)},
      {"band_low_pct", Optional(has_band, band.low)},
      {"band_high_pct", Optional(has_band, band.high)},
      {"period_s", Optional(e.oscillation.has_value(), wave.period * period_s)},
      {"regularity", Optional(e.oscillation.has_value(), wave.regularity)},
      {"shape", Optional(e.oscillation.has_value(), wave.shape)},
      {"fit_linear", Optional(e.fit.has_value(), fit.linear)},
      {"fit_play", Optional(e.fit.has_value(), fit.play)},
      {"gap", Optional(e.fit.has_value(), fit.gap())},
      {"explained", Optional(e.fit.has_value(), fit.explained())},
      {"prediction_gain", e.prediction_gain},
      {"gain_sign", e.gain_sign},
      {"controller_fit", e.controller},
      {"op_range_pct", e.op_range},
      {"at_limit", e.at_limit},
      {"sp_moves", Optional(!one.window.sp.empty(), e.sp_moves)},
      {"distinct", e.distinct_answer},
      {"longest_repeat_s", static_cast<double>(e.longest_repeat) * period_s},
      {"unanswered_pct", e.unanswered},
      {"stands", one.window.x.empty() ? Json(nullptr) : Json(e.standing.times)},
      {"stands_share", Optional(!one.window.x.empty(), e.standing.share)},
      {"hunts_share", Optional(!one.window.x.empty(), e.hunts)}};
}

// The order of urgency; wide bands before narrow ones.
int RankOf(const Judged& one) {
  switch (one.audit.verdict) {
    case Verdict::kNoResponse:
      return 0;
    case Verdict::kFrozen:
      return 1;
    case Verdict::kStiction:
      return one.audit.sure ? 2 : 3;
    case Verdict::kHunting:
      return 4;
    case Verdict::kSaturated:
      return 5;
    case Verdict::kTuning:
      return 6;
    case Verdict::kExternal:
      return 7;
    case Verdict::kQuantised:
      return 8;
    case Verdict::kUndetermined:
      break;
  }
  return 9;
}

void Rank(std::vector<Judged>& judged) {
  const auto band = [](const Judged& one) {
    return one.audit.evidence.band().value_or(loop::Band{}).width;
  };
  std::ranges::stable_sort(judged, [&](const Judged& a, const Judged& b) {
    const int rank_a = RankOf(a);
    const int rank_b = RankOf(b);
    return rank_a != rank_b ? rank_a < rank_b : band(a) > band(b);
  });
}

// Loops that oscillate regularly with periods within 5 % of one another: one
// cause, perhaps, in the loop among them that is sticky or badly tuned. A group
// is measured from its shortest period: a chain of periods, each close to the
// next, is not one group.
Json CommonPeriods(const std::vector<Judged>& judged) {
  struct Wave {
    double period_s;
    std::string loop;
  };
  std::vector<Wave> waves;
  for (const Judged& one : judged) {
    if (const auto& wave = one.audit.evidence.oscillation;
        wave && wave->regularity > 1.0) {
      waves.push_back({wave->period * one.window.period_s, one.loop});
    }
  }
  std::ranges::sort(waves, {}, &Wave::period_s);
  Json groups = Json::array();
  for (std::size_t i = 0; i < waves.size();) {
    std::size_t end = i;
    std::vector<std::string> loops;
    double sum_s = 0.0;
    for (;
         end < waves.size() && waves[end].period_s <= 1.05 * waves[i].period_s;
         ++end) {
      sum_s += waves[end].period_s;
      if (std::ranges::find(loops, waves[end].loop) == loops.end()) {
        loops.push_back(waves[end].loop);
      }
    }
    if (loops.size() > 1) {
      groups.push_back({{"period_s", sum_s / static_cast<double>(end - i)},
                        {"loops", loops}});
    }
    i = end;
  }
  return groups;
}

// PATH.png for one window; PATH-1.png, PATH-2.png, ... by rank for more.
void DrawAll(const std::vector<Judged>& judged, const std::string& path,
             Report& report) {
  for (std::size_t i = 0; i < judged.size(); ++i) {
    std::filesystem::path file(path);
    if (judged.size() > 1) {
      file.replace_filename(file.stem().string() + "-" + std::to_string(i + 1) +
                            file.extension().string());
    }
    plot::DrawFigure(
        plot::LoopFigure(judged[i].loop, judged[i].window, judged[i].audit),
        file);
    report.document["files"].push_back(file.string());
    report.Line(judged[i].loop + " is drawn to " + file.string());
  }
}

// Files and runs, one after the other. One that cannot be read does not keep
// the others from being judged.
void JudgeAll(const AuditOptions& options, const Context& context,
              std::vector<Judged>& judged, Json& skipped) {
  const auto judge = [&](const std::string& source, const auto& read) {
    const auto skip = [&](const std::exception& error) {
      skipped.push_back({{"source", source}, {"reason", error.what()}});
    };
    try {
      JudgeRecord(read(), options, judged, skipped);
    } catch (const DataError& error) {
      skip(error);
    } catch (const NotFoundError& error) {
      skip(error);
    }
  };
  for (const std::string& file : options.files) {
    judge(file, [&] { return ReadLoop(file, options, context); });
  }
  if (options.runs.empty() && options.valve.empty()) {
    return;
  }
  RunStore store(DataOf(context).runs());
  std::vector<std::string> ids = options.runs;
  if (!options.valve.empty()) {
    RunFilter filter;
    filter.valve_glob = options.valve;
    for (const RunInfo& info : store.List(filter)) {
      ids.push_back(info.id);
    }
    if (ids.size() == options.runs.size()) {
      throw NotFoundError("no run of a valve " + Quoted(options.valve) +
                          "; fdi-store runs list shows what there is");
    }
  }
  for (const std::string& id : ids) {
    judge("run " + id, [&] { return ReadRun(id, store); });
  }
}

// Selectors of windows of `window_s`, spread evenly over the part of the run
// since `since_ns`, the newest first.
std::vector<std::string> SpreadWindows(const RunInfo& run,
                                       std::int64_t since_ns, double window_s,
                                       int windows) {
  const auto seconds = [&run](std::int64_t stamp_ns) {
    return static_cast<double>(stamp_ns - run.run.start_ns) * 1e-9;
  };
  const double first = seconds(std::max(run.first_stamp_ns, since_ns));
  // Windows end before their last instant.
  const double end = seconds(run.last_stamp_ns) + run.run.period_s;
  const auto fit = static_cast<int>(std::ceil((end - first) / window_s));
  const int count = std::clamp(fit, 1, windows);
  std::vector<std::string> selectors;
  for (int i = 0; i < count; ++i) {
    const double to =
        count == 1 ? end : end - (end - first - window_s) * i / (count - 1);
    selectors.push_back(run.id + '@' +
                        std::to_string(std::max(first, to - window_s)) + ':' +
                        std::to_string(to));
  }
  return selectors;
}

Column BandColumn() {
  Column column{"band [% of OP]", "band_pct"};
  column.align = report::Align::kRight;
  column.text = [](const Json& row) -> std::string {
    if (row["certainty"].is_null()) {
      return "-";
    }
    return report::FormatNumber(row["band_pct"].get<double>(), 2) + " (" +
           report::FormatNumber(row["band_low_pct"].get<double>(), 2) + ".." +
           report::FormatNumber(row["band_high_pct"].get<double>(), 2) + ")";
  };
  return column;
}

Column ReasonColumn() {
  Column column{"reason", "reason", Format::kPlain, 2, 1};
  column.text = [](const Json& row) {
    const std::string reason = row["reason"];
    return row["hint"].is_null()
               ? reason
               : reason + "; " + row["hint"].get<std::string>();
  };
  return column;
}

Column VerdictColumn() {
  Column column{"verdict", "verdict"};
  column.text = [](const Json& row) {
    const std::string name = row["verdict"];
    return row["certainty"].is_null()
               ? name
               : name + ", " + row["certainty"].get<std::string>();
  };
  column.tone = [](const Json& row) {
    const std::string name = row["verdict"];
    return name == "undetermined"       ? Tone::kQuiet
           : row["certainty"] == "sure" ? Tone::kAlarm
                                        : Tone::kWarning;
  };
  return column;
}

Report AuditLoops(const AuditOptions& options, const Context& context) {
  if (options.files.empty() && options.runs.empty() && options.valve.empty()) {
    throw ConfigError("audit: nothing to read; try FILE, --runs or --valve");
  }
  if (!options.plot.empty()) {
    // A name that cannot be drawn to is refused before the files are judged.
    plot::FormatOf(options.plot);
  }
  std::vector<Judged> judged;
  Json skipped = Json::array();
  JudgeAll(options, context, judged, skipped);
  Rank(judged);
  Report report;
  report.document["windows"] = Rows(judged, JudgedJson);
  report.document["common_periods"] = CommonPeriods(judged);
  report.document["skipped"] = skipped;
  report.document["files"] = Json::array();
  report
      .Table("windows",
             {{"loop", "loop"},
              {"from [s]", "from_s", Format::kPlain, 0, 4},
              VerdictColumn(),
              BandColumn(),
              {"G [-]", "explained", Format::kPlain, 2, 2},
              {"LLR [-]", "prediction_gain", Format::kPlain, 1, 2},
              {"period [s]", "period_s", Format::kPlain, 0, 3},
              {"r [-]", "regularity", Format::kPlain, 1, 3},
              ReasonColumn()},
             "no window could be judged")
      .Csv("windows", {"loop", "source", "start_utc", "from_s", "samples",
                       "verdict", "certainty", "band_pct", "band_low_pct",
                       "band_high_pct", "period_s", "regularity", "shape",
                       "gap", "explained", "prediction_gain", "reason"});
  if (!report.document["common_periods"].empty()) {
    report.Line("").Table("common_periods",
                          {{"common period [s]", "period_s", Format::kPlain, 0},
                           {"loops", "loops"}});
  }
  if (!skipped.empty()) {
    report.Line("").Table("skipped",
                          {{"not judged", "source"}, {"reason", "reason"}});
  }
  if (!options.plot.empty()) {
    DrawAll(judged, options.plot, report);
  }
  if (judged.empty()) {
    report.exit_code = report::kExitData;
  }
  return report;
}

}  // namespace

LoopAudits AuditStoredRuns(const DataDirectory& data, std::int64_t since_ns,
                           int windows) {
  LoopAudits audits;
  if (windows <= 0 || !std::filesystem::exists(data.runs())) {
    return audits;
  }
  RunStore store(data.runs());
  std::map<std::string, RunInfo> newest;
  for (const RunInfo& info : store.List()) {  // Ordered by start.
    if (info.samples > 0 && info.last_stamp_ns >= since_ns &&
        info.run.origin != RunOrigin::kSimulated) {
      newest.insert_or_assign(info.run.valve_id, info);
    }
  }
  const AuditOptions options;
  std::vector<Judged> judged;
  for (const auto& [valve, run] : newest) {
    const std::size_t before = judged.size();
    Json skipped = Json::array();
    for (const std::string& selector :
         SpreadWindows(run, since_ns, options.window_s, windows)) {
      try {
        JudgeRecord(ReadRun(selector, store), options, judged, skipped);
      } catch (const DataError& error) {
        skipped.push_back({{"reason", error.what()}});
      } catch (const NotFoundError& error) {
        skipped.push_back({{"reason", error.what()}});
      }
    }
    if (judged.size() == before && !skipped.empty()) {
      audits.skipped.emplace_back(valve, skipped.front()["reason"]);
    }
  }
  for (const Judged& one : judged) {
    const auto band = one.audit.evidence.band();
    audits.windows.push_back({one.loop,
                              std::string(loop::VerdictName(one.audit.verdict)),
                              one.audit.sure, std::string(one.audit.reason),
                              one.audit.verdict == Verdict::kStiction && band
                                  ? std::optional(band->width)
                                  : std::nullopt,
                              one.start_ns.value_or(0), one.end_ns});
  }
  for (const Json& period : CommonPeriods(judged)) {
    audits.periods.push_back(
        {period["period_s"], period["loops"].get<std::vector<std::string>>()});
  }
  return audits;
}

void AddAuditVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, program.root(), "audit",
      "Judge control loops from OP, PV, SP and mode: stiction, tuning, ...",
      AuditLoops);
  verb.add_option("file", options.files, "CSV files, one loop each");
  verb.add_option("--runs", options.runs, "Stored runs: ID, ID@from:to");
  verb.add_option("--valve", options.valve,
                  "All stored runs of these valves: 'FV-1*'")
      ->type_name("GLOB");
  verb.add_option("--op", options.names.op,
                  "Column of the controller output [%]");
  verb.add_option("--pv", options.names.pv,
                  "Column of the controlled variable");
  verb.add_option("--sp", options.names.sp, "Column of the set point [as PV]");
  verb.add_option("--x", options.names.x, "Column of the position [%]");
  verb.add_option("--mode", options.names.mode,
                  "Column of the mode (MODE, or auto with 1 and 0)");
  verb.add_flag("--ignore-x", options.names.ignore_x,
                "Judge PV although the position is there");
  verb.add_option("--service", options.service,
                  "First letter of the tag: F, P, T or A, or L for levels and "
                  "other integrating processes (default: from the name)")
      ->check(CLI::IsMember({"F", "P", "T", "A", "L"}, CLI::ignore_case));
  verb.add_option("--period", options.period_s,
                  "Sample period in s (0: the most usual step)")
      ->check(CLI::NonNegativeNumber);
  verb.add_option("--window", options.window_s,
                  "Length of a window in s; at least 360 samples")
      ->check(CLI::PositiveNumber);
  verb.add_option(
      "--plot", options.plot,
      "Draw to FILE.png or FILE.svg; several windows to FILE-1.png, "
      "FILE-2.png, ... by rank");
  options.table.AddTo(verb);
  program.AllowCsv(verb, "One line per window");
  report::ShowInHelpAll(verb,
                        {"--ignore-x", "--service", "--window", "--resample"});
}

}  // namespace fdi::storage
