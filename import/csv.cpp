#include "import/csv.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <ostream>
#include <utility>

#include "base/error.h"
#include "diagnosis/fault_catalogue.h"

namespace fdi::importer {
namespace {

/// 100 years: later times would overflow nanoseconds since `start_ns`.
constexpr double kMaxSeconds = 3.2e9;
constexpr double kSecondsPerDay = 86400.0;
/// 1970-01-01 as a spreadsheet day number.
constexpr double kSerialOf1970 = 25569.0;
constexpr const char* kSniff =
    "; try: fdi-store runs sniff FILE --map-output tags.toml, then --map "
    "tags.toml";

/// Whether `words`, separated and enclosed by bars, contains `text`, ignoring
/// case.
bool IsOneOf(std::string_view text, std::string_view words) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  // A text with a bar of its own could match across two words.
  return lower.find('|') == std::string::npos &&
         words.find('|' + lower + '|') != std::string_view::npos;
}

/// The names that `signal` may have in a header: "F_m3_h or F_t_h".
std::string ColumnNames(Signal signal) {
  std::string names;
  for (const SignalColumn& column : kSignalColumns) {
    if (column.signal == signal) {
      names += names.empty() ? "" : " or ";
      names += column.name;
    }
  }
  return names;
}

/// Columns of the CSV contract that a run needs.
struct Columns {
  std::vector<SignalColumn> signals;
  bool mode{false};
  bool truth{false};
};

Columns ColumnsOf(std::span<const LabelledSample> samples, FlowUnit flow_unit) {
  Columns columns;
  SignalMask occurring = 0;
  for (const LabelledSample& labelled : samples) {
    occurring = static_cast<SignalMask>(occurring | labelled.sample.present);
    columns.truth = columns.truth || labelled.truth;
    columns.mode = columns.mode || labelled.sample.mode != ValveMode::kAuto;
  }
  for (const SignalColumn& column : kSignalColumns) {
    const bool wrong_unit =
        column.signal == Signal::kF && column.flow_unit != flow_unit;
    if ((occurring & MaskOf(column.signal)) != 0 && !wrong_unit) {
      columns.signals.push_back(column);
    }
  }
  return columns;
}

std::vector<std::string> HeaderOf(const Columns& columns) {
  std::vector<std::string> cells{std::string(kTimeColumn)};
  for (const SignalColumn& column : columns.signals) {
    cells.emplace_back(column.name);
  }
  if (columns.mode) {
    cells.emplace_back(kModeColumn);
  }
  if (columns.truth) {
    cells.emplace_back(kFaultColumn);
    cells.emplace_back(kStrengthColumn);
  }
  return cells;
}

std::vector<std::string> RowOf(const LabelledSample& labelled,
                               const Columns& columns, std::int64_t start_ns) {
  const Sample& sample = labelled.sample;
  std::vector<std::string> cells{
      // The difference is taken in whole nanoseconds: a stamp since 1970 has
      // more digits than a double.
      NumberText(static_cast<double>(sample.stamp_ns - start_ns) / 1e9)};
  for (const SignalColumn& column : columns.signals) {
    const bool there =
        sample.Has(column.signal) &&
        (column.signal != Signal::kF || column.flow_unit == sample.flow_unit);
    cells.push_back(there ? NumberText(sample[column.signal]) : "");
  }
  if (columns.mode) {
    cells.emplace_back(ValveModeName(sample.mode));
  }
  if (columns.truth) {
    // A cell cannot say "unknown": rows without a truth are written as normal
    // operation as soon as any row of the run has one.
    const FaultTruth truth = labelled.truth.value_or(FaultTruth{});
    cells.push_back(FaultName(truth.fault));
    cells.push_back(NumberText(truth.strength));
  }
  return cells;
}

}  // namespace

// What historians, OPC clients and spreadsheets write where there is no value.
// The words are complete cells, and "-" and "*" are no numbers, so no reading
// is lost.
bool IsNoReading(std::string_view cell) {
  constexpr std::string_view kWords =
      "|nan|-nan|n/a|na|#n/a|#na|#value!|#ref!|#div/0!|#name?|#num!|#null!|"
      "null|none|nil|bad|bad input|bad value|bad quality|bad data|i/o timeout|"
      "io timeout|timeout|no data|no value|no sample|not connect|no result|"
      "pt created|shutdown|comm fail|comm error|configure|scan off|"
      "scan timeout|calc failed|under range|over range|underrange|overrange|"
      "intf shut|offline|invalid|error|fault|missing|-|--|---|?|*|...|"
      "1.#qnan|-1.#ind|";
  return cell.empty() || IsOneOf(cell, kWords);
}

// Told apart by name and size:
//
//     t_s           elapsed seconds
//     6e8 .. 4e9    seconds since 1970, 1989 to 2096
//     3e4 .. 7e4    days of a spreadsheet, 1982 to 2091
//     else          elapsed seconds
//
// A whole number between 3e4 and 7e4 is rather a count of seconds than a
// midnight, and so is any number in a column whose name ends in that unit.
TimeForm TimeFormOf(std::string_view name, double first) {
  if (SameName(name, kTimeColumn)) {
    return TimeForm::kElapsed;
  }
  if (first > 6e8 && first < 4e9) {
    return TimeForm::kUnix;
  }
  const bool in_seconds =
      name.ends_with("_s") || name.ends_with("[s]") || name.ends_with("(s)");
  return first > 3e4 && first < 7e4 && first != std::floor(first) && !in_seconds
             ? TimeForm::kSerial
             : TimeForm::kElapsed;
}

// With the period T and the step d of two samples, |d - T| < T/2 is accepted:
// the nearest instant of the grid is then unambiguous. A longer step is a gap,
// which only `split_gaps_` allows. A step that is too short is never a gap.
std::string StepCheck::Take(double t_s) {
  const std::optional<double> last = std::exchange(last_t_s_, t_s);
  if (!last) {
    return {};
  }
  const double step = t_s - *last;
  // Negated so that NaN is refused, too.
  if (!(step > 0.0)) {
    return "time goes back or stands still: from " + NumberText(*last) +
           " s to " + NumberText(t_s) +
           " s; expected rows in the order of time; try to sort the file";
  }
  if (period_s_ == 0.0) {
    period_s_ = step;
  }
  const double off = step - period_s_;
  if (std::abs(off) < 0.5 * period_s_ || (split_gaps_ && off > 0.0)) {
    return {};
  }
  return "time jumps by " + NumberText(step) + " s to " + NumberText(t_s) +
         " s, the sample period is " + NumberText(period_s_) +
         " s; try --split-gaps for gaps";
}

CsvReader::CsvReader(CsvOptions options)
    : options_(std::move(options)), clock_(options_.map.zone) {
  Require(options_.period_s >= 0.0, "the sample period is not negative");
  for (const ColumnMapping& m : options_.map.columns) {
    if (m.signal == Signal::kF && !options_.map.flow_unit) {
      throw ConfigError("map: column " + Quoted(m.column) +
                        " is a flow and needs its unit (m3/h or t/h)");
    }
  }
}

void CsvReader::Refuse(const std::string& reason) const {
  throw DataError(options_.source + ":" + std::to_string(line_) + ": " +
                  reason);
}

//     table  = skipped ["sep=" sign] header {row}
//     row    = cell {separator cell}          as many cells as the header has
//     wide:    time [clock] signal ... [mode] [fault strength]
//     long:    time [clock] tag value [quality]    one reading per row
//
// skipped are ColumnMap::skip lines. Blank lines may be anywhere. A record can
// take several lines, because a quoted cell may contain line breaks: all
// decisions about the separator come before a record is begun.
std::optional<CsvRow> CsvReader::TakeLine(std::string_view line) {
  ++line_;
  if (line_ <= options_.map.skip) {
    return std::nullopt;
  }
  if (names_.empty() && !record_.open()) {
    // Spreadsheets write the separator into a line of its own.
    if (line.starts_with("sep=") && line.size() >= 5) {
      options_.map.separator = line[4];
      return std::nullopt;
    }
    // A pipe shows the header alone, so its separator is the one that cuts it
    // into most cells. For whole tables WithSigns() has settled this with the
    // first row.
    if (options_.map.separator == '\0' &&
        line.find_first_not_of(" \t\r") != std::string_view::npos) {
      options_.map.separator = FindSeparator(line, {});
    }
    record_ = CsvCells(options_.map.separator);
  }
  if (!record_.TakeLine(line) || record_.blank()) {
    return std::nullopt;
  }
  if (names_.empty()) {
    TakeHeader();
    return std::nullopt;
  }
  if (record_.cells().size() != names_.size()) {
    Refuse(std::to_string(record_.cells().size()) + " cells, the header has " +
           std::to_string(names_.size()) + ", separated by " +
           (options_.map.separator == '\t'
                ? "tab"
                : Quoted({&options_.map.separator, 1})) +
           "; try quotes around cells that contain it, or separator under "
           "[file] of --map");
  }
  CsvRow row;
  row.line = line_;
  Sample& sample = row.labelled.sample;
  sample.flow_unit = header_.flow_unit;
  // The tag comes before the time: it selects the clock that TakeTime()
  // continues, and rows of unmapped tags may contain anything.
  if (tag_column_ && !TakeTagged(sample)) {
    return std::nullopt;
  }
  TakeTime(row);
  sample.seq = rows_++;
  if (!tag_column_) {
    for (const Conversion& c : conversions_) {
      Convert(c, sample);
    }
  }
  if (mode_column_) {
    sample.mode = Mode();
  }
  if (header_.has_truth) {
    row.labelled.truth = Truth();
  }
  return row;
}

void CsvReader::Convert(const Conversion& c, Sample& sample) const {
  std::optional<double> value = Reading(c.column);
  if (!value) {
    sample.quality[Index(c.signal)] = SignalQuality::kBad;
    return;
  }
  // Skipped for the identity: 0 + 1 * value would lose the sign of −0.
  if (c.scale != 1.0 || c.offset != 0.0) {
    value = c.offset + c.scale * *value;
  }
  sample.Set(c.signal, c.sense == Sense::kOpening ? 100.0 - *value : *value);
}

bool CsvReader::TakeTagged(Sample& sample) {
  const std::string& tag = Cell(*tag_column_);
  const auto found = std::ranges::find_if(
      conversions_, [&](const Conversion& c) { return SameName(c.tag, tag); });
  if (found == conversions_.end()) {
    auto& ignored = header_.ignored_columns;
    if (std::ranges::find(ignored, tag) == ignored.end()) {
      ignored.push_back(tag);
    }
    return false;
  }
  used_[static_cast<std::size_t>(found - conversions_.begin())] = true;
  tag_ = Index(found->signal);
  const SignalQuality quality = TaggedQuality();
  if (quality == SignalQuality::kBad) {
    sample.quality[Index(found->signal)] = quality;
    return true;
  }
  Convert(*found, sample);
  if (sample.Has(found->signal)) {
    sample.quality[Index(found->signal)] = quality;
  }
  return true;
}

//     quality = word / number      the list `good`, if given, overrides both
SignalQuality CsvReader::TaggedQuality() const {
  constexpr std::string_view kGood =
      "|good|g|ok|raw|good non-specific|0x00000000|";
  constexpr std::string_view kUncertain =
      "|uncertain|questionable|substituted|interpolated|";
  if (!quality_column_) {
    return SignalQuality::kGood;
  }
  const std::string& cell = Cell(*quality_column_);
  const std::vector<std::string>& good = options_.map.long_table->good;
  if (!good.empty()) {
    return std::ranges::any_of(good,
                               [&](const auto& g) { return SameName(g, cell); })
               ? SignalQuality::kGood
               : SignalQuality::kBad;
  }
  // Numbers are OPC DA quality codes: 192 good, 64 uncertain. 0 is bad there,
  // but good in OPC UA.
  const auto number = ParseNumber(cell);
  if (number && *number == 0.0) {
    Refuse("column " + Quoted(names_[*quality_column_]) + ": " + Quoted(cell) +
           " is good in OPC UA and bad in OPC DA; try good = [\"0\"] or good "
           "= [\"192\"] under [long] of --map");
  }
  if (IsOneOf(cell, kGood) || (number && *number >= 192.0)) {
    return SignalQuality::kGood;
  }
  return IsOneOf(cell, kUncertain) || (number && *number >= 64.0)
             ? SignalQuality::kUncertain
             : SignalQuality::kBad;
}

void CsvReader::Finish() const {
  if (record_.open()) {
    Refuse("a quote is not closed before the end; expected a closing \"");
  }
  if (names_.empty()) {
    throw DataError(options_.source + ": is empty: no header, no rows");
  }
  if (rows_ == 0 && !tag_column_) {
    throw DataError(options_.source + ": has a header but no rows");
  }
  for (std::size_t i = 0; i < used_.size(); ++i) {
    if (!used_[i]) {
      throw DataError(options_.source + ": tag " + Quoted(conversions_[i].tag) +
                      " does not occur; the others are " +
                      Quoted(Listed(header_.ignored_columns)) +
                      "; try another column under [signal." +
                      std::string(SignalName(conversions_[i].signal)) +
                      "] of --map");
    }
  }
}

// All names are compared although the first match would do, because a second
// column of the same name makes the choice arbitrary.
std::optional<std::size_t> CsvReader::Column(std::string_view name) {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    if (SameName(names_[i], name)) {
      if (found) {
        Refuse("column " + Quoted(name) +
               " occurs twice; expected each name once");
      }
      found = i;
      used_[i] = true;
    }
  }
  return found;
}

void CsvReader::TakeHeader() {
  names_ = record_.cells();
  used_.assign(names_.size(), false);
  const ColumnMap& map = options_.map;
  static const std::vector<std::string> kTimes = {"t_s", "time", "timestamp",
                                                  "datetime"};
  for (const std::string& name :
       map.time_column.empty() ? kTimes : std::vector{map.time_column}) {
    time_column_ = time_column_ ? time_column_ : Column(name);
  }
  if (!map.clock_column.empty()) {
    clock_column_ = Column(map.clock_column);
  }
  if (map.long_table) {
    tag_column_ = Column(map.long_table->tag);
    value_column_ = Column(map.long_table->value).value_or(names_.size());
    if (!map.long_table->quality.empty()) {
      quality_column_ = Column(map.long_table->quality);
    }
    CheckLongHeader();
    // From here on `used_` counts tags instead of columns: Finish() reports
    // mapped tags that never occurred.
    used_.assign(map.columns.size(), false);
    for (const ColumnMapping& m : map.columns) {
      AddSignal(
          {value_column_, m.signal, m.scale, m.offset, m.sense, m.column});
    }
    header_.flow_unit = map.flow_unit.value_or(header_.flow_unit);
    return;
  }
  // Mapped columns come first. A name of the contract that the map gives
  // another meaning is then used already, and AddByContract() leaves it alone.
  AddMapped();
  for (std::size_t i = 0; i < names_.size(); ++i) {
    if (!used_[i] && !AddByContract(i, names_[i]) && !names_[i].empty()) {
      header_.ignored_columns.push_back(names_[i]);
    }
  }
  // Emptied, so that Finish() does not take columns for tags.
  used_.clear();
  header_.has_truth = fault_column_ || strength_column_;
  CheckHeader();
}

void CsvReader::AddSignal(const Conversion& conversion) {
  if ((header_.signals & MaskOf(conversion.signal)) != 0) {
    Refuse("column " + Quoted(names_[conversion.column]) + ": signal " +
           std::string(SignalName(conversion.signal)) +
           " occurs twice; expected once");
  }
  header_.signals =
      static_cast<SignalMask>(header_.signals | MaskOf(conversion.signal));
  conversions_.push_back(conversion);
}

void CsvReader::AddMapped() {
  for (const ColumnMapping& m : options_.map.columns) {
    if (const auto column = Column(m.column)) {
      if (m.signal == Signal::kF) {
        header_.flow_unit = *options_.map.flow_unit;
      }
      AddSignal({*column, m.signal, m.scale, m.offset, m.sense, ""});
    }
  }
}

bool CsvReader::AddByContract(std::size_t column, std::string_view name) {
  if (SameName(name, kFaultColumn) || SameName(name, kFaultNumberColumn)) {
    if (fault_column_) {
      Refuse("column " + Quoted(name) + ": the fault is there twice");
    }
    fault_column_ = column;
    fault_by_number_ = SameName(name, kFaultNumberColumn);
    return true;
  }
  if (SameName(name, kStrengthColumn)) {
    if (strength_column_) {
      Refuse("column " + Quoted(name) + " is there twice");
    }
    strength_column_ = column;
    return true;
  }
  if (SameName(name, kModeColumn)) {
    if (mode_column_) {
      Refuse("column " + Quoted(name) + " is there twice");
    }
    mode_column_ = column;
    return true;
  }
  for (const SignalColumn& known : kSignalColumns) {
    if (SameName(name, known.name)) {
      if (known.signal == Signal::kF) {
        header_.flow_unit = known.flow_unit;
      }
      AddSignal({column, known.signal, 1.0, 0.0, Sense::kClosing, ""});
      return true;
    }
  }
  return false;
}

void CsvReader::CheckLongHeader() const {
  const LongTable& expected = *options_.map.long_table;
  std::vector<std::string> missing;
  const auto require = [&](bool there, const std::string& name) {
    if (!there) {
      missing.push_back(name.empty() ? "time" : name);
    }
  };
  require(time_column_.has_value(), options_.map.time_column);
  require(clock_column_ || options_.map.clock_column.empty(),
          options_.map.clock_column);
  require(tag_column_.has_value(), expected.tag);
  require(value_column_ < names_.size(), expected.value);
  require(quality_column_ || expected.quality.empty(), expected.quality);
  if (!missing.empty()) {
    Refuse("missing column " + Listed(missing) + "; the header is " +
           Quoted(Listed(names_)) + "; try [long] and [time] of --map");
  }
}

void CsvReader::CheckHeader() const {
  std::vector<std::string> missing;
  const auto require = [&](bool there, std::string_view name) {
    if (!there) {
      missing.emplace_back(name);
    }
  };
  const ColumnMap& map = options_.map;
  // A map with columns defines the signals; nothing else is required then.
  const unsigned listed = map.columns.empty() ? options_.required : 0U;
  const auto required = static_cast<SignalMask>(listed | MaskOf(Signal::kCv));
  require(time_column_.has_value(), map.time_column.empty()
                                        ? kTimeColumn
                                        : std::string_view(map.time_column));
  require(clock_column_ || map.clock_column.empty(), map.clock_column);
  for (const ColumnMapping& m : map.columns) {
    require((header_.signals & MaskOf(m.signal)) != 0, m.column);
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((required & MaskOf(signal)) != 0) {
      require((header_.signals & MaskOf(signal)) != 0, ColumnNames(signal));
    }
  }
  require((header_.signals & (MaskOf(Signal::kX) | MaskOf(Signal::kF))) != 0,
          "one of X_pct, F_m3_h, F_t_h");
  require(fault_column_ || !strength_column_, "fault (or fault_no)");
  require(strength_column_ || !fault_column_, kStrengthColumn);
  if (!missing.empty()) {
    std::string names;
    for (const std::string& name : missing) {
      names += (names.empty() ? "" : ", ") + name;
    }
    Refuse("missing column " + names + "; the header is " +
           Quoted(Listed(names_)) + kSniff);
  }
}

// Words for "no reading" come first, because Number() refuses all that is no
// number.
std::optional<double> CsvReader::Reading(std::size_t column) const {
  return IsNoReading(Cell(column)) ? std::nullopt
                                   : std::optional(Number(column));
}

double CsvReader::Number(std::size_t column) const {
  const std::string& cell = Cell(column);
  const char decimal = options_.map.decimal;
  char sign = '.';
  auto value = ParseNumber(cell, decimal == '\0' ? '.' : decimal);
  // Line by line nothing is known of the other rows. A decimal comma is
  // therefore accepted only in cells where it cannot group thousands.
  if (!value && decimal == '\0' && DigitsOf(cell, sign) == Digits::kDecimal) {
    value = ParseNumber(cell, sign);
  }
  if (!value) {
    const bool other = DigitsOf(cell, sign) != Digits::kNone;
    Refuse("column " + Quoted(names_[column]) + ": " + Quoted(cell) +
           " is not a finite number; expected digits" +
           (decimal == ',' ? " with a decimal comma" : "") +
           (other ? "; thousands separators are not read: try decimal under "
                    "[file] of --map, or export without them"
                  : ", or nothing, NaN, Bad ... where there is no reading; try "
                    "to correct or empty the cell"));
  }
  return *value;
}

ValveMode CsvReader::Mode() const {
  const std::string_view cell = record_.cells()[*mode_column_];
  const std::optional<ValveMode> mode = ParseValveMode(cell);
  if (!mode) {
    Refuse("column " + Quoted(names_[*mode_column_]) + ": " + Quoted(cell) +
           " is none of " + std::string(kValveModeNames));
  }
  return *mode;
}

FaultTruth CsvReader::Truth() const {
  const double strength = Number(*strength_column_);
  const std::string_view cell = record_.cells()[*fault_column_];
  const std::string name = "column " + Quoted(names_[*fault_column_]) + ": ";
  if (std::abs(strength) > 1.0) {
    Refuse("column " + Quoted(names_[*strength_column_]) + ": " +
           Quoted(record_.cells()[*strength_column_]) + " is not in [-1, 1]");
  }
  int fault = 0;
  if (fault_by_number_) {
    const double number = Number(*fault_column_);
    if (number != std::floor(number) || number < 0.0 || number > kLastFault) {
      Refuse(name + Quoted(cell) + " is not in 0.." +
             std::to_string(kLastFault));
    }
    fault = static_cast<int>(number);
  } else if (!cell.empty() && !SameName(cell, "normal")) {
    const std::optional<int> parsed = ParseFault(cell);
    if (!parsed) {
      Refuse(name + Quoted(cell) + " is not a fault (" +
             std::string(kFaultNames) + ", normal)");
    }
    fault = *parsed;
  }
  // The fault is checked before the strength, so that a mistyped name is
  // refused even where it does not count yet.
  if (strength == 0.0) {
    return {};  // Simulators name a fault before it starts.
  }
  if (fault == 0) {
    Refuse(name + "a strength other than 0 needs a fault");
  }
  return {fault, strength};
}

// What rests on a guess is noted for the user.
void CsvReader::FindTimeForm(const std::string& cell) {
  const ColumnMap& map = options_.map;
  time_form_ = map.time_form;
  if (time_form_ != TimeForm::kFindOut) {
    return;
  }
  const std::string& name = names_[*time_column_];
  const auto number =
      ParseNumber(cell, map.decimal == '\0' ? '.' : map.decimal);
  if (!number) {
    time_form_ = TimeForm::kText;
    return;
  }
  time_form_ = TimeFormOf(name, *number);
  if (SameName(name, kTimeColumn)) {
    return;
  }
  if (time_form_ == TimeForm::kSerial) {
    notes_.push_back("column " + name +
                     " taken as days of a spreadsheet (guessed; unit = "
                     "\"serial\" under [time] confirms it)");
  } else if (time_form_ == TimeForm::kUnix) {
    notes_.push_back("column " + name +
                     " taken as seconds since 1970 (guessed; unit = \"unix\" "
                     "under [time] confirms it)");
  } else {
    notes_.push_back("column " + name +
                     " taken as seconds (guessed; unit = \"s\" under [time] "
                     "confirms it)");
  }
}

void CsvReader::TakeTime(CsvRow& row) {
  std::string cell = Cell(*time_column_);
  if (clock_column_) {
    cell += ' ' + Cell(*clock_column_);
  }
  // The form of the first row holds for all rows: if each cell were judged by
  // itself, a count of seconds would change its meaning on the way.
  if (time_form_ == TimeForm::kFindOut) {
    FindTimeForm(cell);
  }
  const std::string column = "column " + Quoted(names_[*time_column_]) + ": ";
  std::int64_t& stamp_ns = row.labelled.sample.stamp_ns;
  if (time_form_ == TimeForm::kElapsed || time_form_ == TimeForm::kUnix) {
    row.t_s = Number(*time_column_) * options_.map.time_scale;
    if (std::abs(row.t_s) > kMaxSeconds) {
      Refuse(column + "time " + NumberText(row.t_s) +
             " s is beyond 100 years; try unit under [time] of --map");
    }
    stamp_ns = std::llround(row.t_s * 1e9) +
               (time_form_ == TimeForm::kElapsed ? options_.start_ns : 0);
  } else {
    std::optional<CivilTime> time;
    if (time_form_ == TimeForm::kText) {
      time = ScanTime(cell, options_.map.date_order);
    } else if (const double days = Number(*time_column_);
               days > 2.0 && days < 130000.0) {
      // Excel shows times to the millisecond; further digits are rounding
      // errors.
      const auto ms =
          std::llround((days - kSerialOf1970) * kSecondsPerDay * 1e3);
      // Rounded towards minus infinity, so that the fraction is not negative
      // before 1970 either.
      const std::time_t seconds = (ms - ((ms % 1000) + 1000) % 1000) / 1000;
      time.emplace();
      gmtime_r(&seconds, &time->fields);
      time->fraction_ns = (ms - seconds * 1000) * 1'000'000;
    }
    if (!time) {
      const bool slashed = ScanTime(cell, DateOrder::kDayFirst).has_value() ||
                           ScanTime(cell, DateOrder::kMonthFirst).has_value();
      Refuse(column + Quoted(cell) +
             (slashed ? " may be day/month or month/day; try date = \"d/m/y\" "
                        "or \"m/d/y\" under [time] of --map"
                      : " is not a time; expected 2026-11-20 14:56:11.5, "
                        "20.11.2026 14:56:11,5 or the like; try unit under "
                        "[time] of --map"));
    }
    if (!time->offset_s && !first_ns_ && options_.map.zone.empty()) {
      notes_.push_back(
          "times without a zone taken as local time of this machine "
          "(guessed; --zone says which)");
    }
    // Of an hour that the clock shows twice, the time of the row before decides
    // which one it is (LocalClock::Utc).
    const auto utc = clock_.Utc(*time, last_ns_[tag_]);
    if (!utc) {
      Refuse(column + Quoted(cell) + " was never shown in zone '" +
             clock_.zone() +
             "' (clocks go forward in spring); try --zone UTC or +01:00");
    }
    stamp_ns = *utc;
  }
  if (!first_ns_) {
    first_ns_ = stamp_ns;
  }
  last_ns_[tag_] = stamp_ns;
  if (dated()) {
    row.t_s = static_cast<double>(stamp_ns - *first_ns_) * 1e-9;
  }
}

void WriteCsv(std::ostream& output, std::span<const LabelledSample> samples,
              FlowUnit flow_unit, std::int64_t start_ns) {
  const Columns columns = ColumnsOf(samples, flow_unit);
  WriteCsvLine(output, HeaderOf(columns));
  for (const LabelledSample& labelled : samples) {
    WriteCsvLine(output, RowOf(labelled, columns, start_ns));
  }
  if (!output.flush()) {
    throw DataError(std::string("CSV cannot be written: ") +
                    std::strerror(errno));
  }
}

}  // namespace fdi::importer
