#include "import/layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "import/elapsed.h"
#include "import/tag_map.h"

namespace fdi::importer {
namespace {

using Cells = std::vector<std::string>;
using WordCounts = std::map<std::string, std::size_t>;

/// Rows that the form of a table is found from; signs and words come from all.
constexpr std::size_t kSampleRows = 200;
/// Limit for tables with many columns, of which fewer rows are kept.
constexpr std::size_t kSampleCells = 500'000;
/// Different cells that are counted in a column of words.
constexpr std::size_t kMaxWords = 500;
/// Share of the rows that decides.
constexpr double kMost = 0.9;

struct Record {
  std::size_t line{0};  ///< Number of its first line, from 1.
  Cells cells;
};

/// Contents of a column of the sample.
struct Column {
  std::size_t full{0};
  std::size_t numbers{0};  ///< Also with a unit.
  std::size_t dates{0};    ///< Text with a date.
  std::size_t clocks{0};   ///< Just "14:56:11", or "12 sec".
  std::vector<double> values;
  std::map<std::string, std::size_t> words;  ///< In all rows.

  bool Mostly(std::size_t count) const {
    return full > 0 &&
           static_cast<double>(count) >= kMost * static_cast<double>(full);
  }
};

std::optional<CivilTime> AnyTime(std::string_view cell) {
  for (const DateOrder order :
       {DateOrder::kNotSaid, DateOrder::kDayFirst, DateOrder::kMonthFirst,
        DateOrder::kYearFirst}) {
    if (auto time = ScanTime(cell, order)) {
      return time;
    }
  }
  return std::nullopt;
}

// Also "14:56:11Z", which belongs to a date.
bool IsClock(std::string_view cell) {
  return ParseElapsed(cell) ||
         (cell.find(':') != std::string_view::npos &&
          std::isdigit(static_cast<unsigned char>(cell.front())) != 0 &&
          ScanTime("2000-01-01 " + std::string(cell)));
}

// Before the decimal sign is known: with either sign, and with a unit behind.
std::optional<double> AnyNumber(std::string_view cell) {
  cell = WithoutFlag(cell);
  for (const char decimal : {'.', ','}) {
    if (const auto value = ParseNumber(cell, decimal)) {
      return value;
    }
  }
  const auto [number, unit] = SplitUnit(cell);
  if (number.empty() || (!unit.empty() && !IsUnit(unit))) {
    return std::nullopt;
  }
  for (const char decimal : {'.', ','}) {
    const std::string plain = Ungrouped(number, decimal == '.' ? ',' : '.')
                                  .value_or(std::string(number));
    if (const auto value = ParseNumber(plain, decimal)) {
      return value;
    }
  }
  return std::nullopt;
}

bool IsValue(std::string_view cell) {
  return AnyNumber(cell).has_value() || AnyTime(cell).has_value() ||
         IsClock(cell);
}

// A cell in a row of types below the names, where F is a float, not Fahrenheit.
bool IsTypeCell(const std::string& cell) {
  return IsListedWord(PlainText(cell),
                      "|d|f|i|l|b|s|date|datetime|datetime:rfc3339|time|double|"
                      "float|single|real|int|integer|long|short|bool|boolean|"
                      "string|str|text|number|decimal|");
}

bool IsUnitCell(std::string_view cell) {
  return cell == "-" || cell == "[-]" || IsUnit(cell) || IsGasUnit(cell);
}

// Reads records from a line on; comments (#) and blank lines do not count.
template <typename Take>
void ForEachRecord(const TextLines& lines, std::size_t begin, char separator,
                   const Take& take) {
  CsvCells reader(separator);
  std::size_t first = begin;
  std::size_t bytes = 0;
  lines.ForEach(
      [&](std::string_view line, std::size_t number) {
        if (!reader.open()) {
          first = number;
          if (line.starts_with('#') || line.starts_with("sep=")) {
            return true;
          }
        }
        // The reader reports a record without an end.
        const bool ended = reader.TakeLine(line);
        bytes = reader.open() ? bytes + line.size() : 0;
        return ended && !reader.blank() ? take(first, reader.cells())
                                        : bytes <= kLongestRecord;
      },
      begin);
}

/// Common features of the first rows of a table.
struct RowShape {
  explicit RowShape(const std::vector<Record>& records);
  bool IsData(const Record& record) const;
  bool IsHeader(const Record& record) const;
  bool NamesColumns(const Cells& cells) const;

  std::size_t width{0};  ///< Width of most rows.
  std::vector<bool> holds_values;
};

/// A cell that shows the sign of decimals, and where it is.
struct SignCell {
  std::string cell;
  std::size_t line{0};
};

/// The first cells that show each sign, by the sign of decimals.
struct Signs {
  std::map<char, SignCell> decimal;
  std::map<char, SignCell> either;
  std::map<char, SignCell> grouped;  ///< "1.234,5" by ','.
};

/// Fit of an order of day, month and year to the dates of a table.
struct OrderFit {
  std::size_t read{0};
  std::time_t last{0};
  double walked_s{0.0};
};
constexpr std::array kOrders = {DateOrder::kDayFirst, DateOrder::kMonthFirst,
                                DateOrder::kYearFirst};

class LayoutFinder {
 public:
  LayoutFinder(const TextLines& lines, ColumnMap map, bool choose)
      : lines_(lines), choose_(choose) {
    layout_.map = std::move(map);
  }

  Layout Find() {
    RefuseOtherForms();
    FindSeparatorSign();
    data_line_ = static_cast<std::size_t>(map().skip) + 1;
    const bool has_rows = FindHeader();
    if (has_rows) {
      FindTimeColumn();
    }
    ReadRows();
    FindDecimal();
    if (!has_rows) {
      return std::move(layout_);
    }
    FindTags();
    FindQualities();
    FindDateOrder();
    FindDirection();
    return std::move(layout_);
  }

 private:
  ColumnMap& map() { return layout_.map; }
  const std::string& Name(std::size_t c) const { return layout_.names[c]; }
  std::optional<std::size_t> At(const std::string& name) const {
    for (std::size_t c = 0; c < layout_.names.size(); ++c) {
      if (!name.empty() && SameName(layout_.names[c], name)) {
        return c;
      }
    }
    return std::nullopt;
  }
  bool IsNamed(const Cells& cells) const;
  void RefuseOtherForms() const;
  void FindSeparatorSign();
  bool FindHeader();
  void TakeNames(std::span<const Record> header, std::size_t at);
  void TakeSampleRow(const Record& record);
  void FindTimeColumn();
  void FindMilliseconds();
  void ReadRows();
  bool MayHoldWords(std::size_t c) const;
  void CheckTimes(std::size_t line, const Cells& cells) const;
  void TakeDate(const Cells& cells);
  void TakeSigns(std::size_t line, const Cells& cells);
  void FindDecimal();
  void TakeGrouped(const Signs& signs);
  [[noreturn]] void RefuseSign(const SignCell& seen,
                               const std::string& reason) const;
  void FindTags();
  std::optional<std::size_t> ValuesBeside(std::size_t tag) const;
  void FindQualities();
  bool HoldsWords(const std::string& name) const;
  void ChooseGood(const std::string& name, const WordCounts& words);
  void FindDateOrder();
  void FindDirection();
  const TextLines& lines_;
  bool choose_;
  Layout layout_;
  std::vector<Record> rows_;  // Sample, without the header.
  std::vector<Column> columns_;
  std::size_t data_line_{1};
  std::optional<std::size_t> time_;
  std::optional<std::size_t> clock_;
  // Over all rows.
  Signs signs_;
  std::array<OrderFit, 3> orders_{};
  std::size_t dates_{0};
  bool american_{false};
};

/// Texts that are no tables, by how their first line begins, and the command
/// that makes a table of one.
struct OtherForm {
  std::string_view name;
  std::string_view begins;
  std::string_view holds;  ///< Further on in this line.
  std::string_view command;
};
constexpr OtherForm kOtherForms[] = {
    {"JSON of OData", "{", "@odata.",
     "jq -r '\"time,tag,value,quality\", (.value[] | [.DateTime, .FQN, .Value, "
     ".OpcQuality] | @csv)' FILE.json > FILE.csv"},
    {"JSON of the PI Web API", "{", "\"Items\"",
     "jq -r '\"time,value,good\", (.Items[] | [.Timestamp, .Value, .Good] | "
     "@csv)' FILE.json > FILE.csv, one file a tag"},
    {"JSON lines", "{", "\"t_s\"",
     "jq -rs '(.[0] | keys_unsorted) as $k | $k, (.[] | [.[$k[]]]) | @csv' "
     "FILE > FILE.csv"},
    {"JSON", "{", "", "jq -r '.[] | [.time, .tag, .value] | @csv'"},
    {"JSON", "[", "\":", "jq -r '.[] | [.time, .tag, .value] | @csv'"},
};

// A line of InfluxDB: measurement,tag=value field=number nanoseconds
bool IsLineProtocol(std::string_view line) {
  const std::size_t tags = line.find(' ');
  const std::size_t fields = line.rfind(' ');
  const auto has = [&](std::size_t begin, std::size_t end, char sign) {
    return line.substr(begin, end - begin).find(sign) != std::string_view::npos;
  };
  return tags != std::string_view::npos && fields > tags && has(0, tags, ',') &&
         has(0, tags, '=') && has(tags, fields, '=') &&
         ParseWhole<std::int64_t>(line.substr(fields + 1)).has_value();
}

void LayoutFinder::RefuseOtherForms() const {
  lines_.ForEach([&](std::string_view line, std::size_t) {
    const auto refuse = [&](std::string_view name, std::string_view command) {
      throw DataError(lines_.places().At(1) + ": is " + std::string(name) +
                      ", not a table; try: " + std::string(command));
    };
    for (const OtherForm& form : kOtherForms) {
      if (line.starts_with(form.begins) &&
          line.find(form.holds) != std::string_view::npos) {
        refuse(form.name, form.command);
      }
    }
    if (IsLineProtocol(line)) {
      refuse(
          "line protocol",
          "awk 'BEGIN {print \"time,tag,value\"} {gsub(\",\", \".\", $1); n = "
          "split($2, f, \",\"); for (i = 1; i <= n; ++i) {split(f[i], v, "
          "\"=\"); print $3 \",\" v[1] \".\" $1 \",\" v[2]}}' FILE > "
          "FILE.csv");
    }
    return false;
  });
}

void LayoutFinder::FindSeparatorSign() {
  std::vector<std::string> first;
  std::size_t bytes = 0;
  lines_.ForEach(
      [&](std::string_view line, std::size_t) {
        if (line.starts_with("sep=") && first.empty()) {
          map().separator = line.size() > 4 ? line[4] : ',';
        } else if (!line.starts_with('#') &&
                   line.find_first_not_of(" \t\r") != std::string_view::npos) {
          first.emplace_back(line);
          bytes += line.size();
        }
        return first.size() < 50 && bytes < kSampleCells;
      },
      static_cast<std::size_t>(map().skip) + 1);
  if (map().separator == '\0') {
    const std::vector<std::string_view> shown(first.begin(), first.end());
    map().separator = FindSeparator(shown);
  }
}

// True if a row has names that the map or the contract knows.
bool LayoutFinder::IsNamed(const Cells& cells) const {
  const ColumnMap& map = layout_.map;
  const auto has = [&](std::string_view name) {
    return !name.empty() && std::ranges::any_of(cells, [&](const auto& cell) {
      return SameName(cell, name);
    });
  };
  return has(map.time_column) || has(kTimeColumn) || has("CV_pct") ||
         (map.long_table && has(map.long_table->value)) ||
         std::ranges::any_of(map.columns, [&](const ColumnMapping& m) {
           return !map.long_table && has(m.column);
         });
}

RowShape::RowShape(const std::vector<Record>& records) {
  std::map<std::size_t, std::size_t> widths;
  for (const Record& record : records) {
    ++widths[record.cells.size()];
  }
  width = std::ranges::max_element(widths, {}, [](const auto& entry) {
            return entry.second;
          })->first;
  std::vector<std::size_t> values(width);
  for (const Record& record : records) {
    for (std::size_t c = 0; c < width && record.cells.size() == width; ++c) {
      values[c] += IsValue(record.cells[c]) ? 1U : 0U;
    }
  }
  for (const std::size_t count : values) {
    holds_values.push_back(2 * count > widths[width]);
  }
}

bool RowShape::IsData(const Record& record) const {
  std::size_t full = 0;
  std::size_t fits = 0;
  for (std::size_t c = 0; c < width && record.cells.size() == width; ++c) {
    const std::string& cell = record.cells[c];
    if (holds_values[c] && !cell.empty()) {
      ++full;
      fits += IsValue(cell) || IsNoReading(cell) ? 1U : 0U;
    }
  }
  return full > 0 && 2 * fits > full;
}

// A name above every column of values but one, which the time may be, most of
// them no values themselves, and of three or more not mostly the same:
// "Delta_X;1.0;1.0" and "X_Dimension;Time;Time;Time" name no columns.
bool RowShape::NamesColumns(const Cells& cells) const {
  std::size_t columns = 0;
  std::size_t named = 0;
  std::size_t values = 0;
  std::size_t full = 0;
  std::map<std::string, std::size_t> same;
  for (std::size_t c = 0; c < width; ++c) {
    const std::string cell = c < cells.size() ? cells[c] : std::string();
    columns += holds_values[c] ? 1U : 0U;
    if (!cell.empty()) {
      named += holds_values[c] ? 1U : 0U;
      values += holds_values[c] && IsValue(cell) ? 1U : 0U;
      ++same[cell];
      ++full;
    }
  }
  const std::size_t most =
      same.empty() ? 0
                   : std::ranges::max_element(same, {}, [](const auto& entry) {
                       return entry.second;
                     })->second;
  return named + 1 >= columns && 2 * values < std::max<std::size_t>(named, 1) &&
         (most < 3 || 2 * most <= full);
}

bool RowShape::IsHeader(const Record& record) const {
  const auto full = static_cast<std::size_t>(std::ranges::count_if(
      record.cells, [](const auto& cell) { return !cell.empty(); }));
  const auto units =
      static_cast<std::size_t>(std::ranges::count_if(record.cells, IsUnitCell));
  return 2 * full >= width && 2 * units < full &&
         (width == 1 || record.cells.size() > 1) && NamesColumns(record.cells);
}

// "Samples;720;720" and "X0;0.0;0.0" in front of the names are settings. Names
// come behind them if nothing but values follows.
template <typename At>
void SkipSettings(std::vector<Record>& records, const RowShape& shape,
                  At& names, At& data) {
  const auto is_data = [&](const Record& r) { return shape.IsData(r); };
  for (auto at = data; at + 1 < records.end(); ++at) {
    const auto rows = records.end() - (at + 1);
    if (rows > at - records.begin() && shape.IsHeader(*at) && is_data(at[1]) &&
        10 * std::count_if(at + 1, records.end(), is_data) >= 9 * rows) {
      names = at;
      data = at + 1;
      return;
    }
  }
}

// The header ends where the values begin: in the columns that hold numbers and
// times in most rows, a row of the header holds something else. Its first row
// with names that are not units counts; titles and comments in front have fewer
// cells.
bool LayoutFinder::FindHeader() {
  std::vector<Record> records;
  std::size_t count = 0;
  ForEachRecord(lines_, static_cast<std::size_t>(map().skip) + 1,
                map().separator, [&](std::size_t line, const Cells& cells) {
                  if (cells.size() > kMaxColumns) {
                    throw DataError(lines_.places().At(line) + ": " +
                                    std::to_string(cells.size()) +
                                    " columns; expected at most " +
                                    std::to_string(kMaxColumns) +
                                    "; try to export fewer tags at a time");
                  }
                  records.push_back({line, cells});
                  count += cells.size();
                  return records.size() < kSampleRows && count < kSampleCells;
                });
  if (records.size() < 2) {
    return false;
  }
  const RowShape shape(records);
  const auto is_data = [&](const Record& r) { return shape.IsData(r); };
  auto data = std::ranges::find_if(records, is_data);
  auto names = std::ranges::find_if(
      records, [&](const Record& record) { return IsNamed(record.cells); });
  if (names == records.end() && map().skip > 0) {
    names = records.begin();
  }
  if (names != records.end() && data <= names) {
    data = std::find_if(names + 1, records.end(), is_data);
  }
  if (data == records.end()) {
    return false;  // The reader says what is missing.
  }
  if (names == records.end()) {
    names = std::find_if(records.begin(), data,
                         [&](const Record& r) { return shape.IsHeader(r); });
    if (names == data) {
      SkipSettings(records, shape, names, data);
    }
    if (names == data) {
      throw DataError(lines_.places().At(data->line) +
                      ": the first row holds values, not names: a header is "
                      "missing; try to put one line of names in front of it, "
                      "such as time,tag,value, or names of your own and --map");
    }
  }
  if (map().skip == 0) {
    map().skip = static_cast<int>(names->line) - 1;
  }
  if (map().header_rows > 0) {
    data = names +
           std::min<std::ptrdiff_t>(map().header_rows, records.end() - names);
  }
  map().header_rows = static_cast<int>(data - names);
  if (names->cells.size() > shape.width) {
    map().width = shape.width;
    names->cells.resize(shape.width);
  }
  const auto at = static_cast<std::size_t>(names - records.begin());
  const auto rows = static_cast<std::size_t>(data - records.begin());
  TakeNames(std::span(records).first(rows), at);
  if (data == records.end()) {
    return false;
  }
  data_line_ = data->line;
  for (const Record& record : std::span(records).subspan(rows)) {
    TakeSampleRow(record);
  }
  return true;
}

// Takes the rows in front of the values: `at` holds the names, the others
// describe them.
void LayoutFinder::TakeNames(std::span<const Record> header, std::size_t at) {
  const std::size_t width = header[at].cells.size();
  columns_.resize(width);
  layout_.about.resize(width);
  for (std::size_t c = 0; c < width; ++c) {
    layout_.names.push_back(UnnamedAs(header[at].cells[c], c));
  }
  NumberRepeated(layout_.names);
  for (std::size_t row = 0; row < header.size(); ++row) {
    if (row == at || header[row].cells.size() != width ||
        std::ranges::all_of(header[row].cells, IsTypeCell)) {
      continue;
    }
    // A cell above the names that spans several columns is written in the first
    // of them.
    std::string cell;
    for (std::size_t c = 0; c < width; ++c) {
      const std::string& own = header[row].cells[c];
      cell = row < at && own.empty() ? cell : own;
      layout_.about[c] += '\n' + cell;
    }
  }
}

void LayoutFinder::TakeSampleRow(const Record& record) {
  if (record.cells.size() != columns_.size()) {
    return;
  }
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const std::string& cell = record.cells[c];
    Column& column = columns_[c];
    if (cell.empty() || IsNoReading(cell, map().no_reading)) {
      continue;
    }
    ++column.full;
    column.dates += AnyTime(cell) ? 1U : 0U;
    column.clocks += IsClock(cell) ? 1U : 0U;
    if (const auto value = AnyNumber(cell)) {
      ++column.numbers;
      column.values.push_back(*value);
    }
  }
  rows_.push_back(record);
}

// Text with a date comes before numbers of a size that only times have, those
// before numbers under a name that says so or that grow by equal steps. Of
// equal ones, what varies and has such a name, then the first.
void LayoutFinder::FindTimeColumn() {
  constexpr std::string_view kWords =
      "time|zeit|date|datum|stamp|fecha|hora|heure|czas|data|epoch|t_s";
  time_ = At(map().time_column);
  if (!time_ && map().time_column.empty()) {
    time_ = At(std::string(kTimeColumn));
    map().time_column = time_ ? Name(*time_) : map().time_column;
  }
  int best = 0;
  for (std::size_t c = 0; c < columns_.size() && !time_; ++c) {
    const Column& column = columns_[c];
    const std::string name = PlainText(Name(c));
    const bool named = HasWord(name, kWords) || name == "t" || name == "ts";
    const auto differs = [&](const Record& row) {
      return row.cells[c] != rows_.front().cells[c];
    };
    const int varies = std::ranges::any_of(rows_, differs) ? 2 : 0;
    int score = 0;
    if (column.Mostly(column.dates)) {
      score = 40;
    } else if (column.Mostly(column.clocks)) {
      score = 15;  // On an unknown day.
    } else if (column.Mostly(column.numbers) && !column.values.empty()) {
      const TimeForm form = TimeUnitOf(Name(c), column.values.front()).form;
      const auto backwards = static_cast<std::size_t>(std::ranges::count_if(
          column.values, [last = column.values.front()](double t) mutable {
            return std::exchange(last, t) > t;
          }));
      const bool grows =
          column.values.size() > 1 &&
          (backwards == 0 || backwards + 1 == column.values.size());
      score =
          form == TimeForm::kCount ? 30
          : named                  ? 20
          : grows && c == 0 &&
                  std::adjacent_find(column.values.begin(),
                                     column.values.end()) == column.values.end()
              ? 10
              : 0;
      score = varies > 0 || named ? score : 0;
    }
    score += score > 0 ? varies + (named ? 1 : 0) : 0;
    if (score > best) {
      best = score;
      map().time_column = Name(c);
    }
  }
  time_ = time_ ? time_ : At(map().time_column);
  // "Time (UTC)", "timestamp_utc"
  if (time_ && map().zone.empty() &&
      HasWord(' ' + PlainText(Name(*time_)) + ' ',
              " utc |(utc)|[utc]|_utc |utc time|utctime|.utc | gmt |(gmt)")) {
    map().zone = "UTC";
  }
  FindMilliseconds();
  clock_ = At(map().clock_column);
  if (!time_ || clock_ || !map().clock_column.empty() || rows_.empty() ||
      rows_.front().cells[*time_].find(':') != std::string::npos ||
      !columns_[*time_].Mostly(columns_[*time_].dates)) {
    return;
  }
  for (std::size_t c = 0; c < columns_.size() && !clock_; ++c) {
    if (columns_[c].Mostly(columns_[c].clocks)) {
      clock_ = c;
      map().clock_column = Name(c);
    }
  }
}

// Whole seconds, and beside them numbers below 1000 under a name that says so.
void LayoutFinder::FindMilliseconds() {
  for (std::size_t c = 0; c < columns_.size() && map().ms_column.empty(); ++c) {
    const Column& column = columns_[c];
    const std::string name = PlainText(Name(c));
    if (time_ && c != *time_ &&
        columns_[*time_].Mostly(columns_[*time_].dates) &&
        (HasWord(name, "millis|msec") || name == "ms") &&
        column.Mostly(column.numbers) &&
        std::ranges::all_of(column.values,
                            [](double v) { return v >= 0.0 && v < 1000.0; })) {
      map().ms_column = Name(c);
    }
  }
}

// One pass over all rows: what a few of them say of signs, words and dates
// decides nothing.
void LayoutFinder::ReadRows() {
  std::vector<std::size_t> counted;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (MayHoldWords(c)) {
      counted.push_back(c);
    }
  }
  const bool slashed = time_ && map().date_order == DateOrder::kNotSaid &&
                       !rows_.empty() &&
                       columns_[*time_].Mostly(columns_[*time_].dates) &&
                       !ScanTime(rows_.front().cells[*time_]);
  ForEachRecord(lines_, data_line_, map().separator,
                [&](std::size_t line, const Cells& cells) {
                  TakeSigns(line, cells);
                  if (cells.size() != columns_.size()) {
                    return true;
                  }
                  for (const std::size_t c : counted) {
                    auto& words = columns_[c].words;
                    if (words.size() < kMaxWords || words.contains(cells[c])) {
                      ++words[cells[c]];
                    }
                  }
                  if (slashed) {
                    TakeDate(cells);
                  }
                  CheckTimes(line, cells);
                  return true;
                });
}

// True if a column may hold tags or qualities.
bool LayoutFinder::MayHoldWords(std::size_t c) const {
  const ColumnMap& map = layout_.map;
  const bool stated =
      (map.long_table && SameName(map.long_table->quality, Name(c))) ||
      std::ranges::any_of(map.columns, [&](const ColumnMapping& m) {
        return SameName(m.quality, Name(c));
      });
  const bool words = !columns_[c].Mostly(columns_[c].numbers) &&
                     !SameName(Name(c), kModeColumn) &&
                     !SameName(Name(c), kFaultColumn);
  return c != time_ && c != clock_ &&
         (stated || words || IsQualityColumn(Name(c), {{"0", 1}}));
}

// Trends have a column of times beside each value. If they differ, the rows are
// no samples.
void LayoutFinder::CheckTimes(std::size_t line, const Cells& cells) const {
  const auto stem = [](const std::string& name) {
    return name.substr(0, name.find(" ("));
  };
  for (std::size_t c = 0; time_ && c < columns_.size(); ++c) {
    if (c != *time_ && columns_[c].Mostly(columns_[c].dates) &&
        columns_[*time_].Mostly(columns_[*time_].dates) && !cells[c].empty() &&
        cells[c] != cells[*time_] &&
        SameName(stem(Name(c)), stem(Name(*time_)))) {
      throw DataError(
          lines_.places().At(line) + ": column " + Quoted(Name(c)) + " is at " +
          Quoted(cells[c]) + " and column " + Quoted(Name(*time_)) + " at " +
          Quoted(cells[*time_]) +
          ": each value has a time of its own; expected one time for a row; "
          "try to export sampled (interpolated) values, or one reading in a "
          "row: time,tag,value");
    }
  }
}

void LayoutFinder::TakeDate(const Cells& cells) {
  const std::string& cell = cells[*time_];
  if (cell.empty() ||
      std::isdigit(static_cast<unsigned char>(cell.front())) == 0) {
    return;
  }
  ++dates_;
  american_ = american_ || HasWord(PlainText(cell), "am|pm") ||
              (clock_ && HasWord(PlainText(cells[*clock_]), "am|pm")) ||
              (cell.size() > 1 && cell[1] == '/');
  for (std::size_t i = 0; i < kOrders.size(); ++i) {
    if (const auto time = ScanTime(cell, kOrders.at(i))) {
      OrderFit& fit = orders_.at(i);
      std::tm fields = time->fields;
      const std::time_t at = timegm(&fields);
      fit.walked_s +=
          fit.read > 0 ? std::abs(std::difftime(at, fit.last)) : 0.0;
      fit.last = at;
      ++fit.read;
    }
  }
}

// The column of values of a long table, if there is one: beside several columns
// of values, words are states, not tags.
std::optional<std::size_t> LayoutFinder::ValuesBeside(std::size_t tag) const {
  std::optional<std::size_t> value;
  int best = 0;
  int candidates = 0;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const Column& column = columns_[c];
    if (c == time_ || c == tag || c == clock_ ||
        !column.Mostly(column.numbers) || column.values.empty() ||
        IsQualityColumn(Name(c), column.words)) {
      continue;
    }
    const bool named = HasWord(PlainText(Name(c)),
                               "value|wert|valor|valeur|wartosc|reading|data");
    const bool varies = std::ranges::any_of(
        column.values, [&](double v) { return v != column.values.front(); });
    const bool timed =
        HasWord(PlainText(Name(c)), "time|zeit|stamp|id") ||
        TimeUnitOf(Name(c), column.values.front()).form != TimeForm::kElapsed;
    candidates += varies && !timed ? 1 : 0;
    if (const int score = 1 + (named ? 4 : 0) + (varies && !timed ? 2 : 0);
        score > best) {
      best = score;
      value = c;
    }
  }
  return candidates == 1 || best >= 5 ? value : std::nullopt;
}

// A table is long if one column has few distinct names, each at many times,
// beside one of values. A map by hand names tags that are in no header.
void LayoutFinder::FindTags() {
  if (map().long_table || !time_) {
    return;
  }
  // Names that nothing but a long table has tell it by a few rows, too.
  const auto name_of = [&](std::string_view words) {
    const auto at = std::ranges::find_if(layout_.names, [&](const auto& name) {
      return IsListedWord(PlainText(name), words);
    });
    return at == layout_.names.end() ? "" : *at;
  };
  const LongTable by_names{name_of("|tag|tagname|tag_name|point|"),
                           name_of("|value|wert|"), ""};
  constexpr std::size_t kFewColumns = 8;
  std::optional<std::size_t> tag;
  std::size_t most = 0;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const auto& words = columns_[c].words;
    const bool mapped =
        std::ranges::any_of(map().columns, [&](const ColumnMapping& m) {
          return !At(m.column) &&
                 std::ranges::any_of(words, [&](const auto& word) {
                   return SameName(word.first, m.column);
                 });
        });
    std::size_t rows = 0;
    for (const auto& [word, count] : words) {
      rows += count;
    }
    const bool names =
        choose_ && map().columns.empty() && !words.empty() &&
        words.size() < kMaxWords && words.size() * 10 < rows &&
        !words.contains("") && !IsQualityColumn(Name(c), words) &&
        std::ranges::none_of(words,
                             [](const auto& w) { return IsValue(w.first); });
    if ((mapped || names) && words.size() > std::max<std::size_t>(most, 1)) {
      tag = c;
      most = words.size();
    }
  }
  if (!tag) {
    if (choose_ && map().columns.empty() && !by_names.tag.empty() &&
        !by_names.value.empty() && layout_.names.size() <= kFewColumns) {
      map().long_table = by_names;
    }
    return;
  }
  if (const auto value = ValuesBeside(*tag)) {
    map().long_table = LongTable{Name(*tag), Name(*value), ""};
  }
}

// In a wide table a column of quality is that of the columns between it and the
// one before: of each value beside it, or of all values at the end of the row.
void LayoutFinder::FindQualities() {
  std::vector<std::string> values;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    auto& words = columns_[c].words;
    const bool stated =
        map().long_table
            ? SameName(map().long_table->quality, Name(c))
            : std::ranges::any_of(map().columns, [&](const auto& m) {
                return SameName(m.quality, Name(c));
              });
    const bool tag = map().long_table && (Name(c) == map().long_table->tag ||
                                          Name(c) == map().long_table->value);
    if (c == time_ || c == clock_ || tag) {
      continue;
    }
    // Beside values, numbers under "Status" may as well be a state of the
    // plant.
    const bool numbers = columns_[c].Mostly(columns_[c].numbers);
    const bool state = !map().long_table && numbers &&
                       (HasWord(PlainText(Name(c)), "status") ||
                        QualityCodeOf(Name(c), words) == QualityCode::kUnknown);
    if (!stated &&
        (words.empty() || state || !IsQualityColumn(Name(c), words))) {
      values.push_back(Name(c));
      continue;
    }
    QualityCode code = QualityCodeOf(Name(c), words);
    map().quality_codes[Name(c)] = code;
    if (map().long_table) {
      // One whose meaning is known comes before one that needs a choice.
      std::string& chosen = map().long_table->quality;
      const auto known = map().quality_codes.find(chosen);
      if (chosen.empty() ||
          (!stated && code != QualityCode::kUnknown &&
           known != map().quality_codes.end() &&
           known->second == QualityCode::kUnknown && !HoldsWords(chosen))) {
        chosen = Name(c);
      }
    } else {
      for (const std::string& name : values) {
        map().quality_of[name] = Name(c);
      }
    }
    values.clear();
    // Numbers that two systems read differently: most readings of a plant are
    // good.
    if (choose_ && code == QualityCode::kUnknown &&
        map().quality.good.empty() && !map().long_table) {
      ChooseGood(Name(c), words);
    }
  }
  if (choose_ && map().long_table && map().quality.good.empty()) {
    if (const auto c = At(map().long_table->quality);
        c && map().quality_codes[Name(*c)] == QualityCode::kUnknown) {
      ChooseGood(Name(*c), columns_[*c].words);
    }
  }
}

// True if a column of quality has a word that is known.
bool LayoutFinder::HoldsWords(const std::string& name) const {
  const auto c = At(name);
  return c && std::ranges::any_of(columns_[*c].words, [](const auto& word) {
           return QualityOf(word.first, {}, QualityCode::kUnknown).has_value();
         });
}

void LayoutFinder::ChooseGood(const std::string& name,
                              const WordCounts& words) {
  const auto usual = std::ranges::max_element(
      words, {}, [](const auto& word) { return word.second; });
  if (usual != words.end() && !usual->first.empty() &&
      !QualityOf(usual->first, {}, QualityCode::kUnknown)) {
    map().quality.good = {usual->first};
    layout_.choices["good"] =
        Quoted(usual->first) + " of column " + name +
        " is the most usual; the numbers may also mean the opposite";
  }
}

// The decimal sign and what groups thousands. Every cell is evidence (Digits):
// "12.34" shows a decimal sign, "1.234" may be a decimal or a thousand, and in
// "1.234,5" the last sign is the decimal one. Contradictions are refused, and
// so is a table of ambiguous cells only, unless commas separate them and all
// signs are points, or something else does and all are commas: a wrong guess
// would be off by a factor of 1000.
void LayoutFinder::FindDecimal() {
  if (map().decimal != '\0') {
    return;
  }
  const auto& [decimal, either, grouped] = signs_;
  if (decimal.size() == 2 || grouped.size() == 2) {
    const auto& both = decimal.size() == 2 ? decimal : grouped;
    const bool point_first = both.at('.').line < both.at(',').line;
    RefuseSign(both.at(point_first ? ',' : '.'),
               " and cells above differ in the sign of decimals; expected "
               "one of point and comma throughout");
  }
  if (!grouped.empty()) {
    TakeGrouped(signs_);
    return;
  }
  constexpr const char* kUnknown =
      " and all other cells may have decimals or thousands; expected to know "
      "which";
  if (decimal.empty() && either.size() == 1 && either.contains('.') &&
      map().separator != ',') {
    if (!choose_) {
      RefuseSign(either.begin()->second, kUnknown);
    }
    layout_.choices["decimal"] =
        "every number may have three decimals or thousands";
  }
  const bool comma = decimal.empty() && !either.empty() &&
                     map().separator != ',' && !either.contains('.');
  // In quotes, between commas: whoever wrote points would not need them.
  const bool quoted = decimal.empty() && either.size() == 1 &&
                      either.contains(',') && map().separator == ',';
  if (quoted && choose_) {
    layout_.choices["decimal"] =
        "every number may have three decimals or thousands";
  } else if (decimal.empty() && either.contains(',') &&
             map().separator == ',') {
    RefuseSign(either.at(','), kUnknown);
  }
  const char sign = !decimal.empty()  ? decimal.begin()->first
                    : comma || quoted ? ','
                                      : '.';
  const char other = sign == '.' ? ',' : '.';
  if (either.contains(other)) {
    RefuseSign(either.at(other), " seems to have a thousands separator");
  }
  map().decimal = sign;
}

void LayoutFinder::TakeSigns(std::size_t line, const Cells& cells) {
  if (map().decimal != '\0') {
    return;
  }
  for (const std::string& whole : cells) {
    const bool has_unit =
        !whole.empty() &&
        std::isdigit(static_cast<unsigned char>(whole.back())) == 0 &&
        IsUnit(SplitUnit(whole).second);
    const std::string cell(has_unit ? SplitUnit(whole).first : whole);
    char sign = '.';
    switch (DigitsOf(cell, sign)) {
      case Digits::kDecimal:
        signs_.decimal.try_emplace(sign, SignCell{cell, line});
        break;
      case Digits::kEither:
        signs_.either.try_emplace(sign, SignCell{cell, line});
        break;
      case Digits::kThousands:
        signs_.grouped.try_emplace(sign == '.' ? ',' : '.',
                                   SignCell{cell, line});
        break;
      case Digits::kNone:
        break;
    }
  }
}

// Cells with both signs leave no doubt, unless others contradict them.
void LayoutFinder::TakeGrouped(const Signs& signs) {
  const auto& [sign, seen] = *signs.grouped.begin();
  if (!signs.decimal.empty() && !signs.decimal.contains(sign)) {
    const SignCell& other = signs.decimal.begin()->second;
    RefuseSign(seen, " has thousands separators, and " + Quoted(other.cell) +
                         " at " + lines_.places().At(other.line) +
                         " the same sign for decimals");
  }
  map().decimal = sign;
  map().thousands = sign == '.' ? ',' : '.';
}

void LayoutFinder::RefuseSign(const SignCell& seen,
                              const std::string& reason) const {
  throw DataError(lines_.places().At(seen.line) + ": " + Quoted(seen.cell) +
                  reason +
                  "; try decimal = \".\" or decimal = \",\" under [file] "
                  "of --map");
}

// For dates with slashes or short years: the order in which all of them are
// dates; else the one with fewer days from the first to the last. In America
// slashes come without zeros, with AM and PM, or with gallons.
void LayoutFinder::FindDateOrder() {
  if (dates_ == 0) {
    return;
  }
  const auto most = [&](std::size_t i) {
    return static_cast<double>(orders_.at(i).read) >=
           0.99 * static_cast<double>(dates_);
  };
  const bool day = most(0);
  const bool month = most(1);
  if (day != month) {
    map().date_order = day ? DateOrder::kDayFirst : DateOrder::kMonthFirst;
  } else if (!day) {
    map().date_order = most(2) ? DateOrder::kYearFirst : DateOrder::kNotSaid;
  } else if (orders_[0].walked_s > 10.0 * orders_[1].walked_s) {
    map().date_order = DateOrder::kMonthFirst;
  } else if (orders_[1].walked_s > 10.0 * orders_[0].walked_s) {
    map().date_order = DateOrder::kDayFirst;
  } else if (choose_) {
    const bool american =
        american_ ||
        std::ranges::any_of(layout_.names, [](const std::string& name) {
          return HasWord(PlainText(name), "gpm|psi|degf");
        });
    map().date_order = american ? DateOrder::kMonthFirst : DateOrder::kDayFirst;
    layout_.choices["date"] =
        "no day is above 12, so day and month may be exchanged";
  }
}

// In a table of tags, few steps lead from one tag to the next.
void LayoutFinder::FindDirection() {
  if (!time_) {
    return;
  }
  std::optional<double> last;
  std::size_t forwards = 0;
  std::size_t backwards = 0;
  for (const Record& row : rows_) {
    std::string cell = row.cells[*time_];
    cell += clock_ ? ' ' + row.cells[*clock_] : "";
    auto at = AnyNumber(cell);
    if (const auto elapsed = ParseElapsed(cell)) {
      at = elapsed->seconds;
    } else if (const auto time = ScanTime(cell, map().date_order)) {
      std::tm fields = time->fields;
      at = static_cast<double>(timegm(&fields)) +
           1e-9 * static_cast<double>(time->fraction_ns);
    }
    if (at && last) {
      forwards += *at > *last ? 1U : 0U;
      backwards += *at < *last ? 1U : 0U;
    }
    last = at ? at : last;
  }
  map().newest_first =
      backwards > 2 && static_cast<double>(backwards) >=
                           kMost * static_cast<double>(backwards + forwards);
}

}  // namespace

void NumberRepeated(std::vector<std::string>& names) {
  std::map<std::string, std::pair<int, int>> times;  // In all, and so far.
  for (const std::string& name : names) {
    ++times[Lower(name)].first;
  }
  for (std::string& name : names) {
    auto& [all, number] = times[Lower(name)];
    ++number;
    if (all > 1) {
      name += " (" + std::to_string(number) + ")";
    }
  }
}

std::string UnnamedAs(const std::string& cell, std::size_t index) {
  return cell.empty() ? "column " + std::to_string(index + 1) : cell;
}

Layout FindLayout(const TextLines& lines, ColumnMap map, bool choose) {
  return LayoutFinder(lines, std::move(map), choose).Find();
}

}  // namespace fdi::importer
