#include "trainer/fleet/plant_record.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/loop/audit.h"
#include "storage/models/model_codec.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"

// From the columns of a row to what can be judged: the runs that onboarding
// takes, or the verdict of the audit. Messages say what was seen in the record
// and what to type in the row.
namespace fdi::trainer {
namespace {

using importer::LoopTag;

constexpr double kAuditedS = 7200.0;

std::string Fixed(double value, int decimals) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

// A word of the mode that nobody knows: what to type for a row of the plant.
std::string WithHint(const PlantJob& job, const RowSource& source,
                     const std::string& refused) {
  const std::string& mode = source.match[LoopTag::kMode];
  const bool of_mode = !mode.empty() && refused.find("column " + Quoted(mode) +
                                                     ": ") != std::string::npos;
  return of_mode ? refused +
                       "; or type auto = or manual = with the words of "
                       "this plant in the row of " +
                       job.row.name
                 : refused;
}

// Seconds from the start of the table; a bound that is not stated is `open`.
double BoundOf(const std::string& text, const importer::CsvTable& table,
               const std::string& zone, double open) {
  if (text.empty()) {
    return open;
  }
  if (const auto seconds = ParseNumber(text)) {
    return *seconds;
  }
  if (!table.dated) {
    throw ConfigError("from and to are " + Quoted(text) +
                      ", and the times of the file have no date; type seconds "
                      "of the file");
  }
  return static_cast<double>(ParseTime(text, LocalClock(zone)) -
                             table.start_ns) *
         1e-9;
}

storage::RunSelector WindowOf(const PlantJob& job, const RowSource& source,
                              const importer::CsvTable& table,
                              const std::string& zone) {
  storage::RunSelector selector;
  selector.id = source.path.filename().string();
  selector.from_s = BoundOf(job.row.from, table, zone, selector.from_s);
  selector.to_s = BoundOf(job.row.to, table, zone, selector.to_s);
  return selector;
}

std::string PeriodOf(const importer::CsvTable& table, bool utc) {
  const std::int64_t first = table.runs.front().samples.front().sample.stamp_ns;
  const std::int64_t last = table.runs.back().samples.back().sample.stamp_ns;
  return table.dated
             ? FormatTime(first, utc) + " to " + FormatTime(last, utc)
             : Fixed(static_cast<double>(first - table.start_ns) * 1e-9, 0) +
                   " to " +
                   Fixed(static_cast<double>(last - table.start_ns) * 1e-9, 0) +
                   " s";
}

// The part of the row's window in each of its files that has some of it.
std::vector<storage::StoredRun> ReadRuns(const PlantJob& job,
                                         const std::vector<RowText>& texts,
                                         bool as_loop, bool utc) {
  std::vector<storage::StoredRun> runs;
  std::string seen;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const RowSource& source = job.sources[i];
    importer::CsvOptions csv;
    csv.source = texts[i].source;
    csv.map =
        as_loop ? importer::LoopColumns(job.row, source.match, texts[i].form)
                : importer::ValveColumns(job.row, source.match, texts[i].form);
    csv.split_gaps = true;
    csv.check_values = !as_loop;
    csv.skip_repeats = true;
    importer::CsvTable table;
    try {
      table = importer::ReadCsv(texts[i].text, csv);
    } catch (const DataError& error) {
      throw DataError(WithHint(job, source, error.what()));
    }
    seen += (seen.empty() ? "" : ", ") + PeriodOf(table, utc);
    storage::RunSelector window =
        WindowOf(job, source, table, texts[i].form.zone);
    storage::StoredRun run = RunOf(std::move(table), std::move(window));
    if (!run.samples.empty()) {
      runs.push_back(std::move(run));
    }
  }
  if (runs.empty()) {
    throw DataError("no sample is from " +
                    (job.row.from.empty() ? "the start" : job.row.from) +
                    " to " + (job.row.to.empty() ? "the end" : job.row.to) +
                    ": the record is from " + seen +
                    "; correct from and to, or the file");
  }
  return runs;
}

// The longest stretch in AUTO with all judged signals, and its period. At most
// its last two hours count.
std::span<const storage::StoredSample> AuditedPart(
    const std::vector<storage::StoredRun>& runs, double& audited_period_s) {
  std::span<const storage::StoredSample> longest;
  for (const storage::StoredRun& run : runs) {
    const double period_s = run.info.run.period_s;
    const SignalMask signals = UsualSignals(run);
    const std::span<const storage::StoredSample> all(run.samples);
    std::size_t begin = 0;
    for (std::size_t k = 0; k <= all.size(); ++k) {
      const bool judged = k < all.size() &&
                          all[k].sample.mode == ValveMode::kAuto &&
                          (all[k].sample.present & signals) == signals;
      const bool goes_on =
          judged &&
          (k == begin ||
           static_cast<double>(all[k].sample.stamp_ns -
                               all[k - 1].sample.stamp_ns) < 1.5e9 * period_s);
      if (!goes_on) {
        const auto most = std::max<std::size_t>(
            6 * loop::kMinSamples,
            static_cast<std::size_t>(kAuditedS / period_s));
        const std::size_t count = std::min(k - begin, most);
        if (count > longest.size()) {
          longest = all.subspan(k - count, count);
          audited_period_s = period_s;
        }
        begin = judged ? k : k + 1;
      }
    }
  }
  return longest;
}

std::vector<double> SeriesOf(std::span<const storage::StoredSample> part,
                             Signal signal) {
  std::vector<double> values;
  for (const storage::StoredSample& stored : part) {
    if (!stored.sample.Has(signal)) {
      return {};
    }
    values.push_back(stored.sample[signal]);
  }
  return values;
}

// Refuses a record in which op or the answer is not what the row says it is.
// The audit would have a verdict on it all the same ("no response", "frozen"),
// and somebody would look at the valve instead of at the table.
void CheckLoop(const loop::Window& window, const PlantJob& job) {
  const auto [low, high] = std::ranges::minmax_element(window.op);
  if (!loop::IsPercent(window.op)) {
    throw DataError("op goes from " + Fixed(*low, 2) + " to " +
                    Fixed(*high, 2) +
                    ", which is no per cent of its span; type op_range = "
                    "LOW..HIGH of the file, or exchange op and pv");
  }
  const bool of_x = window.pv.empty();
  const std::vector<double>& answer = of_x ? window.x : window.pv;
  if (std::ranges::all_of(answer,
                          [&](double v) { return v == answer.front(); })) {
    throw DataError(
        std::string(of_x ? "x" : "pv") + " is always " +
        Fixed(answer.front(), 3) + " in " + std::to_string(answer.size()) +
        " samples; type another tag for " + (of_x ? "x" : "pv") + " of " +
        job.row.name + ", or another window with from and to");
  }
}

std::string Verdict(const loop::Audit& audit) {
  std::string text(loop::VerdictName(audit.verdict));
  if (audit.verdict == loop::Verdict::kStiction) {
    text += audit.sure ? ", sure" : ", likely";
    if (const auto band = audit.evidence.band()) {
      text += ", band " + Fixed(band->width, 2) + " % of OP";
    }
  }
  return text + ": " + std::string(audit.reason);
}

}  // namespace

std::vector<RowText> TextsOf(const PlantJob& job, PlantFiles& files) {
  std::vector<RowText> texts;
  for (const RowSource& source : job.sources) {
    const auto index = files.Open(source.path);
    std::vector<std::string> columns;
    for (const std::string& column : source.match.columns) {
      if (!column.empty()) {
        columns.push_back(column);
      }
    }
    texts.push_back({index->Project(columns), index->form(), index->source()});
  }
  return texts;
}

bool WantsModels(const PlantJob& job) {
  return !job.row.type.empty() && !job.sources.empty() &&
         !job.sources.front().match[LoopTag::kX].empty();
}

std::uint64_t InputHash(const PlantJob& job, const std::vector<RowText>& texts,
                        const std::string& basis) {
  // 1: the number of this form of input, and of the method behind it. With a
  // higher one every row of every plant is done again. Each part ends with a
  // line end, so that text which moves from one cell to the next is a change.
  std::string input = "1\n" + basis + '\n' + job.row.service + '\n' +
                      job.row.from + '\n' + job.row.to + '\n' +
                      (job.row.sense == Sense::kOpening ? "opening" : "") +
                      '\n' + Listed(job.row.auto_words) + '\n' +
                      Listed(job.row.manual_words) + '\n';
  for (const importer::TagCell& tag : job.row.tags) {
    input += tag.unit + '\n';
    if (tag.range) {
      input +=
          NumberText(tag.range->first) + ".." + NumberText(tag.range->second);
    }
    input += '\n';
  }
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const importer::ColumnMap& form = texts[i].form;
    input += form.zone + '\n' + std::string(1, form.decimal) +
             std::to_string(static_cast<int>(form.date_order)) + ' ' +
             std::string(importer::TimeUnitName(form.time_unit)) + '\n' +
             Listed(form.no_reading) + '\n';
    if (form.resampling) {
      input += NumberText(form.resampling->period_s) + ' ' +
               NumberText(form.resampling->limit_s) +
               (form.resampling->linear ? " linear\n" : " hold\n");
    }
    input += Listed({job.sources[i].match.columns.begin(),
                     job.sources[i].match.columns.end()}) +
             '\n' + texts[i].text;
  }
  return storage::Sha256Start(std::as_bytes(std::span(input)));
}

std::vector<TrainingRun> ReadValve(const PlantJob& job,
                                   const std::vector<RowText>& texts,
                                   bool utc) {
  std::vector<TrainingRun> result;
  std::size_t samples = 0;
  std::size_t usable = 0;
  for (const storage::StoredRun& run : ReadRuns(job, texts, false, utc)) {
    result.push_back(ToTrainingRun(run, true));
    samples += run.samples.size();
    usable += result.back().samples.size();
  }
  if (usable == 0) {
    throw DataError("none of " + std::to_string(samples) +
                    " samples is in AUTO with a reading of every signal; type "
                    "another window, or auto = the words of this plant");
  }
  return result;
}

std::string AuditLoop(const PlantJob& job, const std::vector<RowText>& texts,
                      bool utc, bool fits) {
  const std::vector<storage::StoredRun> runs = ReadRuns(job, texts, true, utc);
  loop::Window window;
  window.period_s = runs.front().info.run.period_s;
  const auto part = AuditedPart(runs, window.period_s);
  if (part.size() < loop::kMinSamples) {
    return "not judged: at most " + std::to_string(part.size()) +
           " samples in a row in AUTO with op and pv";
  }
  window.op = SeriesOf(part, Signal::kCv);
  // CV is % of closing; a row without a sense may have meant another.
  window.open_op = job.row.sense == Sense::kOpening
                       ? 0.0
                       : std::numeric_limits<double>::quiet_NaN();
  window.x = SeriesOf(part, Signal::kX);
  window.pv = SeriesOf(part, Signal::kF);
  window.sp = SeriesOf(part, Signal::kSp);
  CheckLoop(window, job);
  if (window.pv.empty()) {
    window.pv = window.x;
  }
  if (!job.row.service.empty()) {
    loop::SetService(job.row.service.front(), window);
  }
  std::string note =
      window.sp.empty() && window.x.empty()
          ? "; sp is not there and taken as constant: type sp = its tag"
          : "";
  if (!job.row.type.empty()) {
    note += "; no x: without the position faults are not named";
  }
  if (!fits) {
    return note.empty() ? note : note.substr(2);
  }
  const loop::Audit audit = loop::AuditWindow(window);
  if (audit.evidence.exchanged) {
    throw DataError("op and pv seem exchanged: " +
                    std::string("sp stays at op and not at pv; exchange op and "
                                "pv in the row of ") +
                    job.row.name);
  }
  return Verdict(audit) + note;
}

}  // namespace fdi::trainer
