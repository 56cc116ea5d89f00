#include "import/sniff.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "base/toml_text.h"
#include "base/usual_period.h"
#include "import/column_role.h"
#include "import/layout.h"
#include "import/tag_map.h"

namespace fdi::importer {
namespace {

void AddCell(const CsvReader& reader, std::size_t at, double t_s,
             SniffedColumn& column) {
  const CsvReader::ScannedCell cell = reader.ScannedAt(at);
  ++column.cells;
  column.missing += cell.missing ? 1U : 0U;
  if (cell.value) {
    column.times_s.push_back(t_s);
    column.values.push_back(*cell.value);
    if (!cell.unit.empty() && column.about.empty()) {
      column.about = '\n' + std::string(cell.unit);
    }
  } else if (!cell.missing && column.words.size() < 200 &&
             std::ranges::find(column.words, reader.cells()[at]) ==
                 column.words.end()) {
    column.words.push_back(reader.cells()[at]);
  }
}

// Period, jitter and gaps, and whether --resample would help. The period is
// that of the signal that is read most often: the stamps of several tags
// together come at odd steps, whatever each does. Readings stored by exception
// or by swinging door come at odd steps, too; a tag with such steps in a fifth
// of its readings, in a table that has a reading a row or empty cells, is taken
// as compressed, and the steps of all tags together are its period.
void JudgeTiming(Sniffed& found) {
  // Sorted: a long table has each instant once per tag and may be sorted by
  // tag.
  std::vector<double> times = std::move(found.times_s);
  std::ranges::sort(times);
  times.erase(std::unique(times.begin(), times.end()), times.end());
  std::size_t missing = 0;
  double shortest = 0.0;
  for (const SniffedColumn& column : found.columns) {
    missing += column.signal ? column.missing : 0;
    const double usual = MedianStep(column.times_s);
    std::size_t odd = 0;
    for (std::size_t k = 1; k < column.times_s.size(); ++k) {
      const double step = column.times_s[k] - column.times_s[k - 1];
      odd += std::abs(step - usual) > 0.6 * usual ? 1U : 0U;
    }
    const bool sparse = found.map.long_table ||
                        (column.signal && 5 * column.missing > column.cells);
    found.compressed =
        found.compressed || (sparse && 5 * odd > column.times_s.size());
    if (column.signal && usual > 0.0 && (shortest == 0.0 || usual < shortest)) {
      shortest = usual;
    }
  }
  found.period_s = UsualPeriod(
      found.compressed || shortest == 0.0 ? MedianStep(times) : shortest);
  for (std::size_t k = 1; k < times.size(); ++k) {
    const double step = times[k] - times[k - 1];
    if (step > 1.6 * found.period_s) {
      ++found.gaps;
      found.longest_gap_s = std::max(found.longest_gap_s, step);
    } else {
      found.jitter_s =
          std::max(found.jitter_s, std::abs(step - found.period_s));
    }
  }
  double period = std::max(std::round(found.period_s * 1e3) / 1e3, 1e-3);
  // Swinging doors are lines between points. A row that shows only what has
  // changed is written by exception: the other values hold.
  std::string how = "s:linear";
  // A compressed tag may be silent for long while its value holds, hence ten
  // minutes. Slow and short data are resampled to 1 s, because a record with
  // fewer than 600 samples in a row cannot be onboarded (docs/import.md).
  if (found.compressed) {
    how = found.map.long_table ? "s:linear:10min" : "s:hold:10min";
    period = std::max(period, 1.0);
    found.choices.push_back(
        "resample: linear is right after a swinging door, hold after a dead "
        "band, which the file does not say");
  } else if (period > 1.0 && period <= 10.0 && times.size() < 1200) {
    how += ":" + NumberText(3.0 * period) + "s";
    period = 1.0;
  } else if (found.jitter_s <= 0.01 * found.period_s && missing == 0 &&
             found.gaps == 0) {
    return;
  }
  found.resample = NumberText(period) + how;
}

// The only column of modes whose words are known goes into the map; one that is
// named `mode` is found without it.
void FindMode(Sniffed& found) {
  std::vector<const SniffedColumn*> modes;
  for (const SniffedColumn& column : found.columns) {
    const bool known = std::ranges::all_of(
        column.words,
        [](const std::string& word) { return ModeOfWord(word).has_value(); });
    if (!column.words.empty() && known && !SameName(column.name, kModeColumn) &&
        RoleOf(column.name, column.about, column.name).attribute ==
            Role::kMode) {
      modes.push_back(&column);
    }
  }
  if (modes.size() == 1 && !found.map.long_table &&
      found.map.mode_column.empty()) {
    found.map.mode_column = modes.front()->name;
  }
}

// Columns of a long table that hold the unit or the description of its tag.
std::vector<std::size_t> AboutColumns(const Layout& layout) {
  std::vector<std::size_t> columns;
  for (std::size_t c = 0; c < layout.names.size(); ++c) {
    const std::string plain = PlainText(layout.names[c]);
    if (HasWord(plain,
                "unit|einheit|unidad|jednostk|descr|beschreib|bezeich") ||
        IsListedWord(plain, "|eu|uom|")) {
      columns.push_back(c);
    }
  }
  return columns;
}

// Cells that the guesses rest on; their times and values take 16 bytes each.
constexpr std::size_t kMaxCells = 4'000'000;

// The columns of a wide table or the tags of a long one, through the reader of
// the importer.
void ReadColumns(const TextLines& lines, const Layout& layout,
                 const std::vector<ColumnMapping>& given, Sniffed& found) {
  CsvReader reader({.source = lines.places(), .map = layout.map, .scan = true});
  std::map<std::string, SniffedColumn> tags;
  std::vector<std::size_t> columns;
  std::vector<double> times;
  std::size_t tag = 0;
  std::size_t value = 0;
  const auto& names = layout.names;
  const auto& tall = layout.map.long_table;
  const std::vector<std::size_t> abouts = AboutColumns(layout);
  for (std::size_t c = 0; c < names.size(); ++c) {
    bool form = SameName(names[c], layout.map.time_column) ||
                SameName(names[c], kTimeColumn) ||
                SameName(names[c], layout.map.clock_column) ||
                SameName(names[c], layout.map.ms_column);
    for (const auto& of_column : layout.map.quality_of) {
      form = form || SameName(names[c], of_column.second);
    }
    tag = tall && SameName(names[c], tall->tag) ? c : tag;
    value = tall && SameName(names[c], tall->value) ? c : value;
    if (!form && !tall) {
      columns.push_back(c);
      found.columns.push_back({.name = names[c], .about = layout.about[c]});
    }
  }
  std::size_t kept = 0;
  ForEachRow(lines, reader, [&](CsvRow&& row) {
    const std::vector<std::string>& cells = reader.cells();
    ++found.rows;
    if (kept > kMaxCells) {
      return;
    }
    kept += tall ? 1 : columns.size();
    times.push_back(row.t_s);
    if (tall && !tags.contains(cells[tag]) && tags.size() >= kMaxColumns) {
      reader.Refuse("more than " + std::to_string(kMaxColumns) +
                    " tags; try to export fewer at a time");
    }
    if (tall) {
      SniffedColumn& column = tags[cells[tag]];
      for (const std::size_t c : abouts) {
        column.about += column.cells == 0 ? '\n' + cells[c] : std::string();
      }
      column.name = cells[tag];
      AddCell(reader, value, row.t_s, column);
    }
    for (std::size_t i = 0; i < columns.size(); ++i) {
      AddCell(reader, columns[i], row.t_s, found.columns[i]);
    }
  });
  reader.Finish();
  for (auto& [name, column] : tags) {
    // Names of markers, such as "$RT_OFF$", are no tags.
    if (!name.empty() && name.front() != '$') {
      found.columns.push_back(std::move(column));
    }
  }
  for (SniffedColumn& column : found.columns) {
    for (const ColumnMapping& m : given) {
      if (SameName(m.column, column.name)) {
        column.given = m;
      }
    }
  }
  found.dated = reader.dated();
  found.time = reader.time_unit();
  found.times_s = std::move(times);
}

std::string TomlList(const std::vector<std::string>& texts) {
  return '[' +
         JoinText(texts, ", ",
                  [](const std::string& text) { return TomlText(text); }) +
         ']';
}

std::string TomlPair(const std::vector<double>& pair) {
  return '[' + NumberText(pair.at(0)) + ", " + NumberText(pair.at(1)) + ']';
}

// The end of a line that may be a choice.
std::string Choice(const Sniffed& found, const std::string& key) {
  for (const std::string& choice : found.choices) {
    if (choice.starts_with(key + ": ")) {
      return "  # choice: " + choice.substr(key.size() + 2) + "\n";
    }
  }
  return "\n";
}

std::string FileToml(const Sniffed& found) {
  const ColumnMap& map = found.map;
  const auto sign = [](char c) {
    return TomlText(c == '\t' ? "tab" : std::string(1, c));
  };
  std::string text = "\n[file]\nseparator = " + sign(map.separator) +
                     "\ndecimal = " + sign(map.decimal) +
                     Choice(found, "decimal");
  if (map.thousands != '\0') {
    text += "thousands = " + sign(map.thousands) + "\n";
  }
  if (map.skip > 0) {
    text += "skip = " + std::to_string(map.skip) + "\n";
  }
  if (map.header_rows > 1) {
    text += "header = " + std::to_string(map.header_rows) + "\n";
  }
  if (!map.no_reading.empty()) {
    text += "missing = " + TomlList(map.no_reading) + Choice(found, "missing");
  }
  if (!found.resample.empty()) {
    text +=
        "resample = " + TomlText(found.resample) + Choice(found, "resample");
  }
  return text;
}

std::string TimeToml(const Sniffed& found) {
  const ColumnMap& map = found.map;
  std::string text = "\n[time]\ncolumn = " + TomlText(map.time_column) + "\n";
  if (!map.clock_column.empty()) {
    text += "clock = " + TomlText(map.clock_column) + "\n";
  }
  if (!map.ms_column.empty()) {
    text += "ms = " + TomlText(map.ms_column) + "\n";
  }
  if (found.time.form != TimeForm::kText) {
    text += "unit = " + TomlText(std::string(TimeUnitName(found.time))) +
            Choice(found, "time");
  }
  if (map.date_order != DateOrder::kNotSaid) {
    text += std::string("date = ") +
            (map.date_order == DateOrder::kDayFirst     ? "\"d/m/y\""
             : map.date_order == DateOrder::kMonthFirst ? "\"m/d/y\""
                                                        : "\"y/m/d\"") +
            Choice(found, "date");
  }
  if (found.dated) {
    text += map.zone.empty() ? "# zone = \"Europe/Warsaw\"\n"
                             : "zone = " + TomlText(map.zone) + "\n";
  }
  return text;
}

std::string SignalToml(const ColumnMap& map, const SniffedColumn& column) {
  std::string text =
      "\n[signal." + std::string(SignalName(*column.signal)) + "]" +
      (column.guessed.empty() ? "" : "  # guessed: " + column.guessed) +
      "\ncolumn = " + TomlText(column.name) + "\nunit = " +
      TomlText(column.given && SameName(column.unit, "mA") ? "%"
                                                           : column.unit) +
      "\n";
  if (column.given) {
    // In `unit`, as the map of the caller had it.
    const auto unit =
        FindUnit(*column.signal, column.unit).value_or(UnitConversion{});
    text += "scale = " + NumberText(column.given->scale / unit.scale) +
            "\noffset = " +
            NumberText((column.given->offset - unit.offset) / unit.scale) +
            "\n";
  }
  if (!column.raw.empty()) {
    text += "raw = " + TomlPair(column.raw) + "\n";
  }
  if (!column.span.empty()) {
    text += "span = " + TomlPair(column.span) + "\n";
  }
  if (column.opening) {
    text += "sense = \"opening\"\n";
  }
  if (const auto quality = map.quality_of.find(column.name);
      quality != map.quality_of.end()) {
    text += "quality = " + TomlText(quality->second) + "\n";
  }
  return text;
}

}  // namespace

Sniffed Sniff(std::string_view text, const std::string& source, ColumnMap map) {
  return Sniff(TextLines(text, {source}), std::move(map));
}

Sniffed ScanColumns(const TextLines& lines, ColumnMap map) {
  const std::vector<ColumnMapping> given = map.columns;
  Layout layout = FindLayout(lines, std::move(map), true);
  layout.map.columns.clear();
  Sniffed found;
  found.map = layout.map;
  for (const auto& [key, reason] : layout.choices) {
    found.choices.push_back(key + ": " + reason);
  }
  ReadColumns(lines, layout, given, found);
  return found;
}

namespace {

// Reads the table as the importer does, with the map as it is written. If the
// rows can be read as they are, their notes count instead of those of the
// resampled rows.
void ReadWithMap(const TextLines& lines, Sniffed& found) {
  CsvOptions options{.required = 0, .split_gaps = true};
  try {
    options.map =
        ReadTagMapText(MapText(found, "this table"), lines.places().name);
    options.map.zone = found.map.zone;
    options.map.time_unit = found.map.time_unit;  // Guesses are noted.
    const auto resampling = std::exchange(options.map.resampling, {});
    CsvTable table;
    try {
      table = ReadCsv(lines, options);
    } catch (const DataError&) {
      if (!resampling) {
        throw;
      }
      options.map.resampling = resampling;
      table = ReadCsv(lines, options);
    }
    found.findings.insert(found.findings.end(), table.notes.begin(),
                          table.notes.end());
    const auto command =
        std::ranges::find(found.columns, Signal::kCv, &SniffedColumn::signal);
    if (table.split_range && command != found.columns.end() &&
        command->raw.empty()) {
      command->raw = {table.split_range->first, table.split_range->second};
      command->guessed += (command->guessed.empty() ? "" : "; ") +
                          std::string(
                              "half of a split range: X moves twice as "
                              "far");
    }
  } catch (const std::runtime_error& error) {
    found.findings.push_back(std::string("refused as it is: ") + error.what());
  }
}

}  // namespace

Sniffed Sniff(const TextLines& lines, ColumnMap map) {
  Sniffed found = ScanColumns(lines, std::move(map));
  GuessSignals(found.columns, found.findings);
  FindMode(found);
  JudgeTiming(found);
  if (found.time.form == TimeForm::kElapsed &&
      !SameName(found.map.time_column, kTimeColumn) &&
      found.map.time_unit.form == TimeForm::kFindOut) {
    found.choices.push_back(
        "time: nothing but the size of its numbers tells the unit of column " +
        found.map.time_column);
  }
  std::set<std::string> words;
  for (const SniffedColumn& column : found.columns) {
    if (column.signal) {
      words.insert(column.words.begin(), column.words.end());
    }
  }
  if (!words.empty()) {
    auto& missing = found.map.no_reading;
    missing.insert(missing.end(), words.begin(), words.end());
    found.choices.push_back("missing: " + Listed({words.begin(), words.end()}) +
                            " stand where numbers were expected, and are taken "
                            "as no readings");
  }
  ReadWithMap(lines, found);
  return found;
}

std::string MapText(const Sniffed& found, const std::string& file) {
  std::string text =
      "# Of " + file +
      ", by fdi-store runs sniff. Check what is marked as guessed or as a "
      "choice.\n# docs/import.md explains the keys.\n";
  for (const std::string& finding : found.findings) {
    std::string line = finding;
    std::ranges::replace(line, '\n', ' ');
    text += "# - " + line + "\n";
  }
  text += FileToml(found) + TimeToml(found);
  if (const auto& tall = found.map.long_table) {
    text += "\n[long]\ntag = " + TomlText(tall->tag) +
            "\nvalue = " + TomlText(tall->value) + "\n";
    if (!tall->quality.empty()) {
      text += "quality = " + TomlText(tall->quality) + "\n";
    }
  }
  if (const auto& good = found.map.quality.good; !good.empty()) {
    text += "\n[quality]\ngood = " + TomlList(good) + Choice(found, "good");
  }
  if (!found.map.mode_column.empty()) {
    text += "\n[mode]\ncolumn = " + TomlText(found.map.mode_column) + "\n";
  }
  for (const SniffedColumn& column : found.columns) {
    if (column.signal) {
      text += SignalToml(found.map, column);
    } else if (IsGasUnit(column.unit)) {
      text += "\n# [signal.F]\n# column = " + TomlText(column.name) +
              "\n# unit = " + TomlText(column.unit) +
              "\n# molar_mass = 28.96  # air [kg/kmol]; that of the gas\n";
    }
  }
  return text;
}

}  // namespace fdi::importer
