#include "import/column_index.h"

#include <algorithm>
#include <utility>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text_lines.h"
#include "import/layout.h"
#include "import/quality.h"

namespace fdi::importer {
namespace {

// Lines that show the form of a table; see kSampleRows of layout.cpp. Decimal
// sign and order of dates, which need all rows, are found for each loop.
constexpr std::size_t kHeadLines = 80;
/// Bytes of the text and the index of a gzip.
constexpr std::size_t kMaxPacked = 240U << 20U;

std::string_view FirstLines(std::string_view text, std::size_t count) {
  std::size_t end = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t line_break = text.find('\n', end);
    if (line_break == std::string_view::npos) {
      return text;
    }
    end = line_break + 1;
  }
  return text.substr(0, end);
}

std::string_view Trimmed(std::string_view cell) {
  const std::size_t first = cell.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) {
    return {};
  }
  cell = cell.substr(first, cell.find_last_not_of(" \t\r") + 1 - first);
  return cell.size() > 1 && cell.front() == '"' && cell.back() == '"'
             ? cell.substr(1, cell.size() - 2)
             : cell;
}

}  // namespace

ColumnIndex::ColumnIndex(const std::filesystem::path& path,
                         const ColumnMap& map, std::size_t max_lines) {
  const TextLines lines = TextLines::OfFile(path);
  source_ = lines.places();
  packed_ = lines.packed();
  text_.reserve(lines.bytes() + 1);
  lines.ForEach([&](std::string_view line, std::size_t) {
    text_ += line;
    text_ += '\n';
    return true;
  });
  FindForm(map);
  // The first lines of a long table have few of its tags.
  if (max_lines > 0 && !form_.long_table) {
    text_.resize(FirstLines(text_, max_lines).size());
    text_.shrink_to_fit();
  }
  IndexRows();
}

void ColumnIndex::FindForm(const ColumnMap& map) {
  const Layout layout =
      FindLayout(TextLines(FirstLines(text_, kHeadLines), source_), map, true);
  names_ = layout.names;
  if (names_.empty()) {
    throw DataError(source_.name + ": no header with rows below it");
  }
  form_ = map;
  form_.columns.clear();
  form_.separator = layout.map.separator;
  form_.skip = layout.map.skip;
  form_.header_rows = layout.map.header_rows;
  form_.time_column = layout.map.time_column;
  if (form_.time_column.empty()) {
    form_.time_column = kTimeColumn;  // FindLayout() need not set it.
  }
  form_.clock_column = layout.map.clock_column;
  form_.ms_column = layout.map.ms_column;
  form_.long_table = layout.map.long_table;
  form_.quality_of = layout.map.quality_of;
  if (form_.long_table) {
    return;
  }
  for (const std::string& name : names_) {
    const bool quality = std::ranges::any_of(
        form_.quality_of,
        [&](const auto& entry) { return entry.second == name; });
    if (!quality && !SameName(name, form_.time_column) &&
        !SameName(name, form_.clock_column) &&
        !SameName(name, form_.ms_column)) {
      tags_.push_back(name);
    }
  }
}

void ColumnIndex::IndexRows() {
  std::size_t line = 1;
  for (std::size_t begin = 0; begin < text_.size();) {
    begin = TakeRecord(begin, line) + 1;
    if (packed_ &&
        (bytes() > kMaxPacked || rows_of_tag_.size() > kMaxColumns)) {
      throw DataError(source_.name +
                      ": takes more than 240 MiB of memory, which a gzip may "
                      "not; try to unpack it with gunzip first, or to export "
                      "fewer tags at a time");
    }
  }
  for (const auto& [tag, rows] : rows_of_tag_) {
    tags_.push_back(tag);
  }
  if (form_.long_table) {
    std::ranges::sort(tags_);
  }
}

// A wide table keeps the begin of each cell, in bytes from that of the record;
// a long one keeps the rows of each tag. Quotes are those of CsvCells: at
// the begin of a cell only, doubled inside, where the second one reopens them.
std::size_t ColumnIndex::TakeRecord(std::size_t begin, std::size_t& line) {
  Row row{begin, 0, cells_.size(), 0, line++};
  std::size_t end = std::min(text_.find('\n', begin), text_.size());
  const auto first = std::string_view(text_).substr(begin, end - begin);
  if (first.starts_with('#') || first.starts_with("sep=") ||
      first.find_first_not_of(" \t\r") == std::string_view::npos) {
    return end;
  }
  bool quoted = false;
  bool at_begin = true;
  cells_.push_back(0);
  for (end = begin; end < text_.size() && (quoted || text_[end] != '\n');
       ++end) {
    const char c = text_[end];
    line += c == '\n' ? 1U : 0U;
    if (c == '"' && (at_begin || quoted)) {
      quoted = !quoted;
      at_begin = !quoted;
    } else if (c == form_.separator && !quoted) {
      cells_.push_back(static_cast<std::uint32_t>(end - begin + 1));
      at_begin = true;
    } else if (c != ' ' && !quoted) {
      at_begin = false;
    }
  }
  row.length = end - begin;
  row.count = cells_.size() - row.first_cell;
  if (form_.long_table) {
    const std::size_t tag = ColumnOf(form_.long_table->tag);
    if (tag < row.count && row.line > HeaderEnd()) {
      rows_of_tag_[std::string(Trimmed(CellAt(row, tag)))].push_back(
          rows_.size());
    }
    cells_.resize(row.first_cell);  // Whole rows are kept.
  }
  rows_.push_back(row);
  return end;
}

std::string_view ColumnIndex::CellAt(const Row& row, std::size_t cell) const {
  const std::size_t begin = cells_[row.first_cell + cell];
  const std::size_t end =
      cell + 1 < row.count ? cells_[row.first_cell + cell + 1] - 1 : row.length;
  std::string_view text(text_.data() + row.begin + begin, end - begin);
  if (text.ends_with('\r')) {
    text.remove_suffix(1);
  }
  return text;
}

std::size_t ColumnIndex::ColumnOf(std::string_view name) const {
  const auto same = [&](const std::string& other) {
    return SameName(other, name);
  };
  const auto found = std::ranges::find(names_, name);
  return static_cast<std::size_t>(
      (found != names_.end() ? found : std::ranges::find_if(names_, same)) -
      names_.begin());
}

std::size_t ColumnIndex::bytes() const {
  return text_.capacity() + rows_.capacity() * sizeof(Row) +
         cells_.capacity() * sizeof(std::uint32_t);
}

// Rows keep their line: an empty line stands for each that is left out, so that
// ReadCsv() reports mistakes by the lines of the original file.
std::string ColumnIndex::Project(const std::vector<std::string>& tags) const {
  if (form_.long_table) {
    return ProjectLong(tags);
  }
  std::vector<std::size_t> columns = {ColumnOf(form_.time_column)};
  const auto add = [&](const std::string& name) {
    const std::size_t column = ColumnOf(name);
    if (column < names_.size() &&
        std::ranges::find(columns, column) == columns.end()) {
      columns.push_back(column);
    }
  };
  add(form_.clock_column);
  add(form_.ms_column);
  for (const std::string& tag : tags) {
    add(tag);
    if (const auto found = form_.quality_of.find(tag);
        found != form_.quality_of.end()) {
      add(found->second);
    }
  }
  // A column of quality is that of the columns before it.
  std::ranges::sort(columns);
  std::string table;
  std::size_t line = 1;
  for (const Row& row : rows_) {
    for (; line < row.line; ++line) {
      table += '\n';
    }
    for (std::size_t i = 0; i < columns.size() && columns[i] < row.count; ++i) {
      if (i > 0) {
        table += form_.separator;
      }
      table += CellAt(row, columns[i]);
    }
    table += '\n';
    ++line;
  }
  return table;
}

std::string ColumnIndex::ProjectLong(
    const std::vector<std::string>& tags) const {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < rows_.size() && rows_[i].line <= HeaderEnd();
       ++i) {
    chosen.push_back(i);
  }
  for (const std::string& tag : tags) {
    if (const auto found = rows_of_tag_.find(tag);
        found != rows_of_tag_.end()) {
      chosen.insert(chosen.end(), found->second.begin(), found->second.end());
    }
  }
  std::ranges::sort(chosen);
  std::string table;
  std::size_t line = 1;
  for (const std::size_t i : chosen) {
    for (; line < rows_[i].line; ++line) {
      table += '\n';
    }
    table.append(text_, rows_[i].begin, rows_[i].length);
    table += '\n';
    ++line;
  }
  return table;
}

}  // namespace fdi::importer
