#include "import/csv.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ostream>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "import/assembler.h"
#include "import/elapsed.h"
#include "import/layout.h"
#include "import/tag_map.h"

namespace fdi::importer {
namespace {

/// 100 years: later times would overflow nanoseconds since `start_ns`.
constexpr double kMaxSeconds = 3.2e9;
constexpr const char* kSniff =
    "; try: fdi-store runs sniff FILE -o tags.toml, then --map "
    "tags.toml";

/// Words of controllers. In cascade the controller acts, too; tracking or local
/// ones do not. Numbers differ between systems, except in a column `auto`.
struct ModeWords {
  ValveMode mode;
  std::string_view words;
  std::string_view of_auto;
};
constexpr ModeWords kModeWords[] = {
    {ValveMode::kAuto, "|aut|a|cas|cascade|rcas|c|", "|1|1.0|true|yes|on|"},
    {ValveMode::kManual, "|man|m|iman|imanual|lo|rout|track|trk|local|",
     "|0|0.0|false|no|"},
    {ValveMode::kOutOfService, "|oos|o/s|off|", ""}};

/// The names that `signal` may have in a header: "F_m3_h or F_t_h".
std::string ColumnNames(Signal signal) {
  std::string names;
  for (const SignalColumn& column : kSignalColumns) {
    if (column.signal == signal && !NeedsPv(column)) {
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
  bool stamps{false};
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
    const bool has_pv = (occurring & MaskOf(Signal::kPv)) != 0;
    const bool wrong_unit =
        (column.signal == Signal::kF && column.flow_unit != flow_unit) ||
        (column.signal == Signal::kSp && NeedsPv(column) != has_pv);
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
  if (columns.stamps) {
    cells.insert(cells.end(), {"stamp_ns", "utc"});
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
  if (columns.stamps) {
    cells.push_back(std::to_string(sample.stamp_ns));
    cells.push_back(FormatTime(sample.stamp_ns, true));
  }
  return cells;
}

}  // namespace

std::optional<ValveMode> ModeOfWord(std::string_view word) {
  if (const auto mode = ParseValveMode(word)) {
    return mode;
  }
  const auto* const row = std::ranges::find_if(
      kModeWords,
      [&](const auto& each) { return IsListedWord(Lower(word), each.words); });
  return row == std::end(kModeWords) ? std::nullopt : std::optional(row->mode);
}

// A number with one of these signs behind it, and nothing else.
std::string_view WithoutFlag(std::string_view cell) {
  if (cell.size() < 2 || (cell.back() != '?' && cell.back() != '*') ||
      std::isdigit(static_cast<unsigned char>(cell[cell.size() - 2])) == 0) {
    return cell;
  }
  const std::string_view number = cell.substr(0, cell.size() - 1);
  return SplitUnit(number).second.empty() ? number : cell;
}

bool IsAllZero(const Sample& sample,
               const std::vector<ColumnMapping>& columns) {
  const bool shuts = std::ranges::any_of(columns, [](const ColumnMapping& m) {
    return m.signal == Signal::kCv && m.sense == Sense::kOpening;
  });
  std::size_t zeros = 0;
  for (std::size_t i = 0; i < kSignalCount && shuts; ++i) {
    const auto signal = static_cast<Signal>(i);
    if (!sample.Has(signal)) {
      continue;
    }
    // A signal that the map does not name is read as it stands.
    const auto m = std::ranges::find(columns, signal, &ColumnMapping::signal);
    if (sample[signal] != (m == columns.end() ? 0.0 : Converted(*m, 0.0))) {
      return false;
    }
    ++zeros;
  }
  return zeros >= 3;
}

bool IsOpen(const Sample& sample) {
  constexpr double kOpen = 90.0;  // % of closing
  return sample.Has(Signal::kCv) && sample[Signal::kCv] < kOpen &&
         (!sample.Has(Signal::kX) || sample[Signal::kX] < kOpen);
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
  throw DataError(Place() + reason);
}

//     table  = skipped ["sep=" sign] header {row / header / comment / marker}
//     row    = cell {separator cell}          as many cells as the header has
//     wide:    time [clock] signal ... [mode] [fault strength]
//     long:    time [clock] tag value [quality]    one reading per row
//
// skipped are ColumnMap::skip lines, header the names and
// ColumnMap::header_rows less one further rows. Blank lines may be anywhere. A
// record can take several lines, because a quoted cell may contain line breaks:
// all decisions about the separator come before a record is begun.
std::optional<CsvRow> CsvReader::TakeLine(std::string_view line,
                                          std::int64_t number) {
  line_ = number > 0 ? number : line_ + 1;
  if (!EndsRow(line)) {
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
  if (tag_column_ && !options_.scan && !TakeTagged(sample)) {
    return std::nullopt;
  }
  if (!TakeTime(row)) {
    return std::nullopt;
  }
  EndPage(row);
  sample.seq = rows_++;
  if (!tag_column_) {
    for (const Conversion& c : conversions_) {
      Convert(c, sample);
    }
    DropLoneSetPoint(header_.signals, sample);
  }
  if (mode_column_) {
    sample.mode = Mode();
  }
  if (header_.has_truth) {
    row.labelled.truth = Truth();
  }
  return row;
}

// A title between two rows is that of the next page, if the header comes again
// and the time goes on; otherwise that of another table.
void CsvReader::EndPage(const CsvRow& row) {
  const std::int64_t stamp_ns = row.labelled.sample.stamp_ns;
  const bool page = header_again_ && stamp_ns > latest_ns_ && names_.size() > 2;
  if (!pending_.empty() && rows_ > 0 && !page) {
    if (header_again_) {
      Refuse(
          "another table begins here, with a header of its own; expected one "
          "table, with a column for each signal, or with the tag in a column "
          "of its own; try to export it so");
    }
    throw DataError(pending_);
  }
  latest_ns_ = stamp_ns;
  pending_.clear();
  header_again_ = false;
}

// True if `line` ends a row of readings. Header and markers are taken here.
bool CsvReader::EndsRow(std::string_view line) {
  if (line_ <= options_.map.skip && names_.empty()) {
    return false;
  }
  if (names_.empty() && !record_.open() && !BeginsHeader(line)) {
    return false;
  }
  if (!record_.open() && line.starts_with('#') && !names_.empty() &&
      !names_.front().starts_with('#')) {
    return false;
  }
  const bool ended = record_.TakeLine(line);
  record_bytes_ = record_.open() ? record_bytes_ + line.size() : 0;
  if (record_bytes_ > kLongestRecord) {
    Refuse(
        "a record is longer than 2 MiB: a quote in it is not closed; "
        "expected a closing \"");
  }
  if (!ended || record_.blank()) {
    return false;
  }
  if (names_.empty()) {
    TakeHeader();
    return false;
  }
  if (header_left_ > 0) {
    --header_left_;
    return false;
  }
  record_.Trim(names_.size());
  return !IsMarker();
}

// Settles the separator, unless `line` does nothing but state it.
bool CsvReader::BeginsHeader(std::string_view line) {
  // Spreadsheets write the separator into a line of its own.
  if (line.starts_with("sep=") && line.size() >= 5) {
    options_.map.separator = line[4];
    return false;
  }
  // A pipe shows only the header, so its separator is the one that cuts it
  // into most cells. For whole tables FindLayout() has settled this.
  if (options_.map.separator == '\0' &&
      line.find_first_not_of(" \t\r") != std::string_view::npos) {
    options_.map.separator = FindSeparator({&line, 1});
  }
  record_ = CsvCells(options_.map.separator);
  return true;
}

// Rows that hold no reading, before and behind the others or marked as such:
// the header again, "$RT_OFF$", "[Data]", "Average;;37", a row of units. A word
// instead of a time between two rows is an error, which shows at the second.
bool CsvReader::IsMarker() {
  const std::vector<std::string>& cells = record_.cells();
  if (cells.front() == header_cells_.front() && cells == header_cells_) {
    header_again_ = true;
    return true;
  }
  const auto is_full = [](const std::string& cell) { return !cell.empty(); };
  if (std::ranges::none_of(cells, is_full)) {
    return true;
  }
  const bool whole = cells.size() == names_.size();
  if (!whole && std::ranges::count_if(cells, is_full) > 1) {
    return false;
  }
  const std::string& cell = whole && time_column_
                                ? Cell(*time_column_)
                                : *std::ranges::find_if(cells, is_full);
  if (cell.empty()) {
    // Units and descriptions below the names.
    return rows_ == 0 && std::ranges::none_of(cells, [&](const auto& c) {
             return Parsed(c).has_value();
           });
  }
  // "(2700 rows)", "-----" below the names.
  if (std::string_view("$*#[(").find(cell.front()) != std::string_view::npos ||
      std::ranges::none_of(cell, [](unsigned char c) {
        return std::isalnum(c) != 0 || c >= 0x80;
      })) {
    ++markers_;
    return true;
  }
  const auto first = static_cast<unsigned char>(cell.front());
  if ((std::isalpha(first) == 0 && first < 0x80) || ScanTime(cell)) {
    return false;
  }
  ++markers_;
  if (pending_.empty()) {
    pending_ = NoTime(cell);
  }
  return true;
}

// The cell in the unit of the file. Numbers come first, because nearly all
// cells are; words for "no reading" come before all other forms of a number.
std::optional<double> CsvReader::Reading(const Conversion& c,
                                         const std::string& cell) {
  const char decimal = options_.map.decimal;
  auto value = ParseNumber(cell, decimal == '\0' ? '.' : decimal);
  if (!value ? IsNoReading(cell, options_.map.no_reading)
             : !options_.map.no_reading.empty() &&
                   std::ranges::find(options_.map.no_reading, cell) !=
                       options_.map.no_reading.end()) {
    return std::nullopt;
  }
  if (!value) {
    value = Parsed(cell);
  }
  if (!value && std::isfinite(c.mapping.lowest)) {
    // "7.9 mA" of a column that the map has in currents.
    const auto [number, unit] = SplitUnit(cell);
    value = SameName(unit, "mA") ? Parsed(number) : std::nullopt;
  }
  if (value && (*value < c.mapping.lowest || *value > c.mapping.highest)) {
    ++beyond_[Index(c.mapping.signal)];
    return std::nullopt;
  }
  if (value && c.mapping.root) {
    const auto [low, high] = *c.mapping.root;
    const double share = std::max((*value - low) / (high - low), 0.0);
    value = low + (high - low) * std::sqrt(share);
  }
  // Skipped for the identity: 0 + 1 * value would lose the sign of −0.
  if (value && (c.mapping.scale != 1.0 || c.mapping.offset != 0.0)) {
    value = c.mapping.offset + c.mapping.scale * *value;
  }
  if (!value) {
    value = WithOwnUnit(c, cell);
  }
  return value ? value : Number(c.column);
}

// "11.1 t/h": the unit of the cell, which a dashboard may change from row to
// row, instead of that of the map.
std::optional<double> CsvReader::WithOwnUnit(const Conversion& c,
                                             const std::string& cell) const {
  const auto [number, unit] = SplitUnit(cell);
  const auto value = Parsed(number);
  if (!value || !IsUnit(unit)) {
    return std::nullopt;  // Number() says what is wrong.
  }
  const auto own = FindUnit(c.mapping.signal, unit);
  const auto stated = FindUnit(c.mapping.signal, c.mapping.unit);
  const bool linear =
      !c.mapping.unit.empty() && (!stated || stated->scale != c.mapping.scale ||
                                  stated->offset != c.mapping.offset);
  if (!own || linear ||
      (c.mapping.signal == Signal::kF && own->flow_unit != header_.flow_unit)) {
    Refuse("column " + Quoted(names_[c.column]) + ": " + Quoted(cell) +
           " is in " + Quoted(unit) + ", expected " +
           (c.mapping.unit.empty() ? UnitNames(c.mapping.signal).substr(1)
                                   : c.mapping.unit) +
           "; try unit under [signal." +
           std::string(SignalName(c.mapping.signal)) + "] of --map");
  }
  return own->scale == 1.0 && own->offset == 0.0
             ? *value
             : own->offset + own->scale * *value;
}

void CsvReader::Convert(const Conversion& c, Sample& sample) {
  const Signal signal = c.mapping.signal;
  SignalQuality quality =
      c.quality ? QualityAt(*c.quality) : SignalQuality::kGood;
  const std::string& cell = Cell(c.column);
  const std::string_view number = WithoutFlag(cell);
  if (number.size() < cell.size() && quality == SignalQuality::kGood) {
    quality = SignalQuality::kUncertain;
  }
  const auto value_of = [&](const std::string& whole) {
    return quality == SignalQuality::kBad ? std::nullopt : Reading(c, whole);
  };
  auto value = number.size() == cell.size() ? value_of(cell)
                                            : value_of(std::string(number));
  if (!value) {
    sample.quality[Index(signal)] = SignalQuality::kBad;
    return;
  }
  if (c.mapping.clamped) {
    value = std::clamp(*value, 0.0, 100.0);
  }
  sample.Set(signal,
             c.mapping.sense == Sense::kOpening ? 100.0 - *value : *value);
  sample.quality[Index(signal)] = quality;
}

bool CsvReader::TakeTagged(Sample& sample) {
  const std::string& tag = Cell(*tag_column_);
  const auto found = std::ranges::find_if(
      conversions_,
      [&](const Conversion& c) { return SameName(c.mapping.column, tag); });
  if (found == conversions_.end()) {
    auto& ignored = header_.ignored_columns;
    if (std::ranges::find(ignored, tag) == ignored.end()) {
      ignored.push_back(tag);
    }
    return false;
  }
  used_[static_cast<std::size_t>(found - conversions_.begin())] = true;
  Convert(*found, sample);
  return true;
}

std::optional<SignalQuality> CsvReader::KnownQualityAt(
    std::size_t column) const {
  const std::string& cell = Cell(column);
  const auto code = options_.map.quality_codes.find(names_[column]);
  return QualityOf(cell, options_.map.quality,
                   code != options_.map.quality_codes.end()
                       ? code->second
                       : QualityCodeOf(names_[column], {{cell, 1}}));
}

CsvReader::ScannedCell CsvReader::ScannedAt(std::size_t column) const {
  const std::string& cell = Cell(column);
  const auto quality = tag_column_ ? quality_column_ : qualities_[column];
  if (quality && KnownQualityAt(*quality) == SignalQuality::kBad) {
    return {.missing = true};
  }
  const std::string_view plain = WithoutFlag(cell);
  if (const auto value = ParseNumber(plain, options_.map.decimal)) {
    return {value};
  }
  if (IsNoReading(plain, options_.map.no_reading)) {
    return {.missing = true};
  }
  const auto [number, unit] = SplitUnit(plain);
  return {unit.empty() || IsUnit(unit) ? Parsed(number) : std::nullopt, unit};
}

// An unknown quality is refused: taken as bad it would silently empty a file,
// taken as good it would let anything pass.
SignalQuality CsvReader::QualityAt(std::size_t column) const {
  const std::string& cell = Cell(column);
  const auto quality = KnownQualityAt(column);
  if (!quality) {
    Refuse("column " + Quoted(names_[column]) + ": " + Quoted(cell) +
           (cell == "0" ? " is good in OPC UA and bad in OPC DA; try good = "
                          "[\"0\"] or good = [\"192\"]"
                        : " is no known quality; try good = [" + Quoted(cell) +
                              "], or uncertain or bad,") +
           " under [quality] of --map");
  }
  return *quality;
}

void CsvReader::Finish() const {
  if (record_.open()) {
    Refuse("a quote is not closed before the end; expected a closing \"");
  }
  if (names_.empty()) {
    throw DataError(options_.source.name + ": is empty: no header, no rows");
  }
  if (rows_ == 0 && !pending_.empty()) {
    throw DataError(pending_);
  }
  if (tag_column_ && !options_.scan && options_.map.columns.empty()) {
    throw DataError(options_.source.name + ": no tag of column " +
                    Quoted(names_[*tag_column_]) +
                    " is mapped to a signal; the tags are " +
                    Quoted(Listed(header_.ignored_columns)) +
                    "; try column under [signal.CV] and under [signal.X] or "
                    "[signal.F] of --map");
  }
  for (std::size_t i = 0; i < used_.size(); ++i) {
    if (!used_[i]) {
      throw DataError(options_.source.name + ": tag " +
                      Quoted(conversions_[i].mapping.column) +
                      " does not occur; the others are " +
                      Quoted(Listed(header_.ignored_columns)) +
                      "; try another column under [signal." +
                      std::string(SignalName(conversions_[i].mapping.signal)) +
                      "] of --map");
    }
  }
  if (rows_ == 0) {
    throw DataError(options_.source.name + ": has a header but no rows");
  }
}

// Repeated names have numbers, because choosing one of them by its bare name
// would be arbitrary.
std::optional<std::size_t> CsvReader::Column(std::string_view name) {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    if (SameName(names_[i], name)) {
      found = i;
      used_[i] = true;
    }
  }
  const auto count = std::ranges::count_if(
      header_cells_,
      [&](const std::string& cell) { return SameName(cell, name); });
  if (!found && count > 1) {
    Refuse("column " + Quoted(name) +
           " occurs twice; expected each name once; try " +
           Quoted(std::string(name) + " (1)") + " or (2) in --map");
  }
  return found;
}

void CsvReader::TakeHeader() {
  header_cells_ = record_.cells();
  names_ = header_cells_;
  while (options_.map.width > 0 && names_.size() > options_.map.width) {
    header_.ignored_columns.push_back(names_.back());
    names_.pop_back();
  }
  header_left_ = std::max(options_.map.header_rows - 1, 0);
  for (std::size_t i = 0; i < names_.size(); ++i) {
    names_[i] = UnnamedAs(names_[i], i);
  }
  NumberRepeated(names_);
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
  if (!map.ms_column.empty()) {
    ms_column_ = Column(map.ms_column);
  }
  if (map.long_table) {
    TakeLongHeader();
    return;
  }
  if (options_.scan) {
    for (const std::string& name : names_) {
      const auto quality = map.quality_of.find(name);
      qualities_.push_back(quality == map.quality_of.end()
                               ? std::nullopt
                               : Column(quality->second));
    }
    used_.clear();
    if (!time_column_) {
      Refuse("no column of " + Quoted(Listed(names_)) +
             " holds times; expected 2026-11-20 14:56:11, seconds or the "
             "like; try column under [time] of --map");
    }
    return;
  }
  // Mapped columns come first. A name of the contract that the map gives
  // another meaning is then used already, and AddByContract() leaves it alone.
  AddMapped();
  for (std::size_t i = 0; i < names_.size(); ++i) {
    if (!used_[i] && !AddByContract(i, header_cells_[i]) &&
        !header_cells_[i].empty()) {
      header_.ignored_columns.push_back(names_[i]);
    }
  }
  AddQualities();
  // Emptied, so that Finish() does not take columns for tags.
  used_.clear();
  header_.has_truth = fault_column_ || strength_column_;
  CheckHeader();
}

void CsvReader::TakeLongHeader() {
  const ColumnMap& map = options_.map;
  tag_column_ = Column(map.long_table->tag);
  value_column_ = Column(map.long_table->value).value_or(names_.size());
  if (!map.long_table->quality.empty()) {
    quality_column_ = Column(map.long_table->quality);
  }
  CheckLongHeader();
  if (options_.scan) {
    used_.clear();
    return;
  }
  // From here on `used_` counts tags instead of columns: Finish() reports
  // mapped tags that never occurred.
  used_.assign(map.columns.size(), false);
  for (const ColumnMapping& m : map.columns) {
    AddSignal(value_column_, m);
    conversions_.back().quality = quality_column_;
  }
  header_.flow_unit = map.flow_unit.value_or(header_.flow_unit);
}

// The column of the quality of each signal, by the map or as it was found.
void CsvReader::AddQualities() {
  const auto& found_for = options_.map.quality_of;
  for (Conversion& c : conversions_) {
    std::string name = c.mapping.quality;
    if (const auto found = found_for.find(names_[c.column]);
        name.empty() && found != found_for.end()) {
      name = found->second;
    }
    if (!name.empty() && !(c.quality = Column(name))) {
      Refuse("missing column " + name + "; the header is " +
             Quoted(Listed(names_)) + "; try quality under [signal." +
             std::string(SignalName(c.mapping.signal)) + "] of --map");
    }
    std::erase(header_.ignored_columns, name);
  }
}

void CsvReader::AddSignal(std::size_t column, const ColumnMapping& mapping) {
  if ((header_.signals & MaskOf(mapping.signal)) != 0) {
    Refuse("column " + Quoted(mapping.column) + ": signal " +
           std::string(SignalName(mapping.signal)) +
           " occurs twice; expected once");
  }
  header_.signals =
      static_cast<SignalMask>(header_.signals | MaskOf(mapping.signal));
  conversions_.push_back({column, mapping});
}

void CsvReader::AddMapped() {
  for (const ColumnMapping& m : options_.map.columns) {
    if (const auto column = Column(m.column)) {
      if (m.signal == Signal::kF) {
        header_.flow_unit = *options_.map.flow_unit;
      }
      AddSignal(*column, m);
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
  const bool is_mode =
      options_.map.mode_column.empty()
          ? SameName(name, kModeColumn) || SameName(name, kAutoColumn)
          : SameName(name, options_.map.mode_column);
  if (is_mode) {
    if (mode_column_) {
      Refuse("column " + Quoted(name) + ": the mode is there twice");
    }
    mode_column_ = column;
    return true;
  }
  // Tables of others have a PV that is a flow, and say so by a map.
  const bool may_have_pv = options_.map.columns.empty();
  const bool has_pv =
      may_have_pv && std::ranges::any_of(names_, [](const std::string& each) {
        return SameName(each, SignalName(Signal::kPv));
      });
  for (const SignalColumn& known : kSignalColumns) {
    if (SameName(name, known.name)) {
      if ((known.signal == Signal::kPv && !may_have_pv) ||
          (NeedsPv(known) && !has_pv)) {
        return false;
      }
      if (known.signal == Signal::kF) {
        header_.flow_unit = known.flow_unit;
      }
      AddSignal(column, {std::string(name), known.signal});
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
  require(ms_column_ || map.ms_column.empty(), map.ms_column);
  require(mode_column_ || map.mode_column.empty(), map.mode_column);
  for (const ColumnMapping& m : map.columns) {
    require((header_.signals & MaskOf(m.signal)) != 0, m.column);
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((required & MaskOf(signal)) != 0) {
      require((header_.signals & MaskOf(signal)) != 0, ColumnNames(signal));
    }
  }
  const bool has_answer = (header_.signals & kAnswers) != 0;
  if (!map.columns.empty() && missing.empty() && !has_answer) {
    Refuse(
        "neither a position (X) nor a flow (F) is mapped: the command alone, "
        "or a level, shows nothing about the valve; expected one of the two; "
        "try to export the position transmitter or the flow behind the valve, "
        "and [signal.X] or [signal.F] of --map; the header is " +
        Quoted(Listed(names_)));
  }
  require(has_answer,
          "one of X_pct, F_m3_h, F_t_h (position or flow: the command alone, "
          "or a level, shows nothing about the valve; a PV, of the loop)");
  require(fault_column_ || !strength_column_, "fault (or fault_no)");
  require(strength_column_ || !fault_column_, kStrengthColumn);
  if (!missing.empty()) {
    Refuse("missing column " + JoinText(missing) + "; the header is " +
           Quoted(Listed(names_)) +
           (names_.size() == 2 && header_.signals == 0
                ? "; is it a file for each tag? Try the folder that holds them"
                : "") +
           (map.columns.empty()
                ? kSniff
                : "; try the columns under [signal.CV], [signal.X] and "
                  "[signal.F] of --map, by their names in the header"));
  }
}

// Line by line nothing is known of the other rows. A decimal comma is therefore
// accepted only in cells where it cannot group thousands.
std::optional<double> CsvReader::Parsed(std::string_view cell) const {
  const char decimal = options_.map.decimal;
  char sign = decimal == '\0' ? '.' : decimal;
  auto value = ParseNumber(cell, sign);
  if (!value && decimal == '\0' && DigitsOf(cell, sign) == Digits::kDecimal) {
    value = ParseNumber(cell, sign);
  }
  if (!value) {
    if (const auto plain = Ungrouped(cell, options_.map.thousands)) {
      value = ParseNumber(*plain, sign);
    }
  }
  return value;
}

double CsvReader::Number(std::size_t column) const {
  const std::string& cell = Cell(column);
  const char decimal = options_.map.decimal;
  char sign = '.';
  const auto value = Parsed(cell);
  if (!value) {
    const bool other = DigitsOf(cell, sign) != Digits::kNone;
    Refuse("column " + Quoted(names_[column]) + ": " + Quoted(cell) +
           " is not a finite number; expected digits" +
           (decimal == ',' ? " with a decimal comma" : "") +
           (other ? "; try decimal and thousands under [file] of --map"
                  : ", or nothing, NaN, Bad ... where there is no reading; try "
                    "to correct or empty the cell, or missing under [file] of "
                    "--map"));
  }
  return *value;
}

ValveMode CsvReader::Mode() const {
  const std::string& cell = Cell(*mode_column_);
  const std::string& name = names_[*mode_column_];
  for (const auto& [word, mode] : options_.map.mode_words) {
    if (SameName(word, cell)) {
      return mode;
    }
  }
  if (const auto mode = ModeOfWord(cell)) {
    return *mode;
  }
  for (const ModeWords& row : kModeWords) {
    if (SameName(name, kAutoColumn) && IsListedWord(Lower(cell), row.of_auto)) {
      return row.mode;
    }
  }
  Refuse("column " + Quoted(name) + ": " + Quoted(cell) + " is none of " +
         std::string(kValveModeNames) +
         ", AUT, CAS, RCAS, MAN, IMAN, LO, OOS; try these words, 1 and 0 in a "
         "column named auto, or auto and manual under [mode] of --map");
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

// A form that rests on a guess is noted for the user.
void CsvReader::FindTimeForm(const std::string& cell) {
  const ColumnMap& map = options_.map;
  time_unit_ = map.time_unit;
  if (time_unit_.form != TimeForm::kFindOut) {
    return;
  }
  const std::string& name = names_[*time_column_];
  const auto number =
      ParseNumber(cell, map.decimal == '\0' ? '.' : map.decimal);
  if (!number && !ScanTime(cell, map.date_order) && ParseElapsed(cell)) {
    time_unit_.form = TimeForm::kClock;
    notes_.push_back("column " + name +
                     " has times without a date: --start says when they begin");
    return;
  }
  // "20260310090000" is both.
  if (!number || ScanTime(cell, map.date_order)) {
    time_unit_.form = TimeForm::kText;
    return;
  }
  time_unit_ = TimeUnitOf(name, *number);
  if (SameName(name, kTimeColumn)) {
    return;
  }
  notes_.push_back("column " + name + " taken as " +
                   std::string(TimeUnitName(time_unit_)) +
                   " (guessed; unit under [time] confirms it)");
}

std::string CsvReader::NoTime(const std::string& cell) const {
  const auto in = [&](DateOrder order) {
    return ScanTime(cell, order).has_value();
  };
  const bool slashed = in(DateOrder::kDayFirst) || in(DateOrder::kMonthFirst);
  const std::size_t word = cell.find_last_of(' ');
  const bool zoned =
      word != std::string::npos && word + 1 < cell.size() &&
      std::isalpha(static_cast<unsigned char>(cell[word + 1])) != 0 &&
      ScanTime(cell.substr(0, word)).has_value();
  return Place() + "column " + Quoted(names_[*time_column_]) + ": " +
         Quoted(cell) +
         (slashed ? " may be day/month or month/day; try date = \"d/m/y\" "
                    "or \"m/d/y\" under [time] of --map"
          : zoned ? " has a zone that is not known, or that several countries "
                    "use for different times; try to remove it, and --zone"
                  : " is not a time; expected 2026-11-20 14:56:11.5, "
                    "20.11.2026 14:56:11,5 or the like; try unit under "
                    "[time] of --map");
}

// From text and spreadsheet days; nothing for the second that UTC repeats.
std::optional<std::int64_t> CsvReader::UtcOf(const std::string& cell) {
  std::optional<CivilTime> time;
  if (time_unit_.form == TimeForm::kText) {
    time = ScanTime(cell, options_.map.date_order);
  } else if (const double days = Number(*time_column_) - time_unit_.of_1970;
             days > -25567.0 && days < 104431.0) {
    // Excel shows times to the millisecond; further digits are rounding
    // errors.
    const auto ms = std::llround(days * time_unit_.scale * 1e3);
    // Rounded towards minus infinity, so that the fraction is not negative
    // before 1970 either.
    const std::time_t seconds = (ms - ((ms % 1000) + 1000) % 1000) / 1000;
    time.emplace();
    gmtime_r(&seconds, &time->fields);
    time->fraction_ns = (ms - seconds * 1000) * 1'000'000;
    if (time_unit_.form == TimeForm::kDaysUtc) {
      time->offset_s = 0;
    }
  }
  if (!time && options_.scan) {
    ++markers_;  // Perhaps of a tag that is not used.
    if (rows_ == 0 && pending_.empty()) {
      pending_ = NoTime(cell);
    }
    return std::nullopt;
  }
  if (!time) {
    throw DataError(NoTime(cell));
  }
  if (time->fields.tm_sec == 60) {
    // Leap seconds are rare: a table full of them needs no note for each.
    constexpr std::size_t kMaxNotes = 100;
    if (notes_.size() < kMaxNotes) {
      notes_.push_back("the row of the leap second " + cell +
                       " left out: the clock of the bus has no instant for it");
    }
    return std::nullopt;
  }
  if (!time->offset_s && !first_ns_ && options_.map.zone.empty()) {
    notes_.push_back(
        "times without a zone taken as local time of this machine "
        "(guessed; --zone says which)");
  }
  // If the clock shows an hour twice, the time of the row before decides
  // which one it is (LocalClock::Utc).
  if (last_ns_.size() > kMaxColumns) {
    Refuse("more than " + std::to_string(kMaxColumns) +
           " tags; try to export fewer at a time");
  }
  std::int64_t& last_ns =
      last_ns_[tag_column_ ? Cell(*tag_column_) : std::string()];
  const auto utc = clock_.Utc(*time, last_ns);
  if (!utc) {
    Refuse("column " + Quoted(names_[*time_column_]) + ": " + Quoted(cell) +
           " was never shown in zone '" + clock_.zone() +
           "' (clocks go forward in spring); try --zone UTC or +01:00");
  }
  last_ns = *utc;
  return utc;
}

// A time that is behind the row before by more than half a round belongs to a
// new one: the clock passed midnight.
double CsvReader::ClockOf(const std::string& cell) {
  const auto time = ParseElapsed(cell);
  if (!time) {
    throw DataError(NoTime(cell));
  }
  std::int64_t& last_ns =
      last_ns_[tag_column_ ? Cell(*tag_column_) : std::string()];
  const double behind = static_cast<double>(last_ns) * 1e-9 - time->seconds;
  double seconds = time->seconds;
  if (time->wraps_s > 0.0 && behind > 0.5 * time->wraps_s) {
    seconds += time->wraps_s * std::ceil(behind / time->wraps_s - 0.5);
  }
  last_ns = std::llround(seconds * 1e9);
  return seconds;
}

bool CsvReader::TakeTime(CsvRow& row) {
  std::string cell = Cell(*time_column_);
  if (clock_column_) {
    cell += ' ' + Cell(*clock_column_);
  }
  // The form of the first row holds for all rows: if each cell were judged by
  // itself, a count of seconds would change its meaning on the way.
  if (time_unit_.form == TimeForm::kFindOut) {
    FindTimeForm(cell);
  }
  std::int64_t& stamp_ns = row.labelled.sample.stamp_ns;
  const bool elapsed = time_unit_.form == TimeForm::kElapsed;
  if (elapsed || time_unit_.form == TimeForm::kCount) {
    row.t_s = (Number(*time_column_) - time_unit_.of_1970) * time_unit_.scale;
    if (std::abs(row.t_s) > kMaxSeconds) {
      Refuse("column " + Quoted(names_[*time_column_]) + ": time " +
             NumberText(row.t_s) +
             " s is beyond 100 years; try unit under [time] of --map");
    }
    // Nanoseconds since 1970 have more digits than a double.
    const auto count = ParseWhole<std::int64_t>(cell);
    stamp_ns = count && !elapsed ? (*count - std::llround(time_unit_.of_1970)) *
                                       std::llround(time_unit_.scale * 1e9)
                                 : std::llround(row.t_s * 1e9);
    stamp_ns += elapsed ? options_.start_ns : 0;
  } else if (time_unit_.form == TimeForm::kClock) {
    row.t_s = ClockOf(cell);
    stamp_ns = std::llround(row.t_s * 1e9) + options_.start_ns;
  } else if (const auto utc = UtcOf(cell)) {
    stamp_ns = *utc;
  } else {
    return false;
  }
  if (ms_column_) {
    stamp_ns += std::llround(Number(*ms_column_) * 1e6);
  }
  if (!first_ns_) {
    first_ns_ = stamp_ns;
  }
  if (dated()) {
    row.t_s = static_cast<double>(stamp_ns - *first_ns_) * 1e-9;
  }
  return true;
}

void WriteCsv(std::ostream& output, std::span<const LabelledSample> samples,
              FlowUnit flow_unit, std::int64_t start_ns, bool stamps) {
  Columns columns = ColumnsOf(samples, flow_unit);
  columns.stamps = stamps;
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
