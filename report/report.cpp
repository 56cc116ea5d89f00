#include "report/report.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "base/csv_cells.h"
#include "base/printable.h"
#include "base/time_text.h"
#include "base/time_units.h"

namespace fdi::report {
namespace {

// The value at "a/b" within `json`; null where a member on the path is missing.
// JSON pointers would throw there.
const Json& ValueAt(const Json& json, std::string_view path) {
  static const Json kNull;
  const Json* value = &json;
  while (!path.empty()) {
    const std::size_t slash = std::min(path.find('/'), path.size());
    const auto member = value->find(std::string(path.substr(0, slash)));
    if (member == value->end()) {
      return kNull;
    }
    value = &*member;
    path.remove_prefix(std::min(slash + 1, path.size()));
  }
  return *value;
}

std::string Bare(const Json& value);

std::string Joined(const Json& list) {
  std::string text;
  for (const Json& item : list) {
    text += text.empty() ? "" : ",";
    text += Bare(item);
  }
  return text;
}

// A value in CSV form: null is an empty cell.
std::string Bare(const Json& value) {
  if (value.is_null() ||
      (value.is_number_float() && !std::isfinite(value.get<double>()))) {
    return "";
  }
  if (value.is_string()) {
    return value.get<std::string>();
  }
  return value.is_array() ? Joined(value) : value.dump();
}

std::string RawText(const Json& row, const Column& column, bool utc) {
  if (column.text) {
    return column.text(row);
  }
  const Json& value = ValueAt(row, column.key);
  // Documents have UTC times and SI units throughout; text uses the requested
  // form.
  if (column.format == Format::kTime && value.is_string()) {
    return FormatTime(ParseTime(value.get<std::string>(), true), utc);
  }
  if (column.format == Format::kDuration && value.is_number()) {
    return FormatDuration(std::llround(value.get<double>() * kNsPerSecond));
  }
  if (column.format == Format::kPercent && value.is_number()) {
    return FormatNumber(100.0 * value.get<double>(), 1) + " %";
  }
  if (value.is_number_float()) {
    return FormatNumber(value.get<double>(), column.decimals);
  }
  if (value.is_boolean()) {
    return value.get<bool>() ? "yes" : "no";
  }
  std::string text = Bare(value);
  return text.empty() ? "-" : text;
}

std::string TextOf(const Json& row, const Column& column, bool utc) {
  return Printable(RawText(row, column, utc));
}

Align AlignOf(const Json& rows, const Column& column) {
  if (column.align) {
    return *column.align;
  }
  const bool numbers =
      !column.text && std::ranges::any_of(rows, [&column](const Json& row) {
        return ValueAt(row, column.key).is_number();
      });
  return numbers ? Align::kRight : Align::kLeft;
}

}  // namespace

Report& Report::Table(std::string key, std::vector<Column> columns,
                      std::string if_empty) {
  views_.emplace_back(
      TableView{std::move(key), std::move(columns), std::move(if_empty)});
  return *this;
}

Report& Report::Fields(std::string key, std::vector<Column> fields) {
  views_.emplace_back(FieldsView{std::move(key), std::move(fields)});
  return *this;
}

Report& Report::Line(std::string text) {
  views_.emplace_back(std::move(text));
  return *this;
}

Report& Report::Csv(std::string key, std::vector<std::string> keys) {
  std::vector<Column> columns;
  for (std::string& member : keys) {
    columns.push_back({"", std::move(member)});
  }
  csv_ = TableView{std::move(key), std::move(columns), ""};
  return *this;
}

void Report::Print(const TableView& view, std::ostream& out,
                   const ReportStyle& style) const {
  const Json& rows = ValueAt(document, view.key);
  if (rows.empty()) {
    if (!view.if_empty.empty()) {
      out << view.if_empty << '\n';
    }
    return;
  }
  std::vector<TextTable::Column> columns;
  for (const Column& column : view.columns) {
    columns.push_back({column.heading, AlignOf(rows, column), column.spare});
  }
  TextTable table(std::move(columns));
  for (const Json& row : rows) {
    std::vector<std::string> cells;
    for (const Column& column : view.columns) {
      cells.push_back(TextOf(row, column, style.utc));
    }
    table.AddRow(std::move(cells));
    for (std::size_t c = 0; c < view.columns.size(); ++c) {
      if (view.columns[c].tone) {
        table.SetTone(c, view.columns[c].tone(row));
      }
    }
  }
  table.Print(out, style.text);
}

void Report::Print(const FieldsView& view, std::ostream& out,
                   const ReportStyle& style) const {
  const Json& object = ValueAt(document, view.key);
  std::size_t width = 0;
  for (const Column& field : view.fields) {
    width = std::max(width, TextWidth(field.heading));
  }
  for (const Column& field : view.fields) {
    out << field.heading << ':'
        << std::string(width - TextWidth(field.heading) + 2, ' ')
        << TextOf(object, field, style.utc) << '\n';
  }
}

void Report::PrintText(std::ostream& out, const ReportStyle& style) const {
  for (const View& view : views_) {
    if (const auto* table = std::get_if<TableView>(&view)) {
      Print(*table, out, style);
    } else if (const auto* fields = std::get_if<FieldsView>(&view)) {
      Print(*fields, out, style);
    } else {
      out << Printable(std::get<std::string>(view), "\n") << '\n';
    }
  }
}

void Report::PrintJson(std::ostream& out) const {
  out << JsonText(document, 2) << '\n';
}

void Report::PrintCsv(std::ostream& out) const {
  // The table chosen by Csv(), else the first one.
  const TableView* table = csv_ ? &*csv_ : nullptr;
  for (const View& view : views_) {
    table = table != nullptr ? table : std::get_if<TableView>(&view);
  }
  if (table == nullptr) {
    throw std::logic_error("Report::PrintCsv: there is no table");
  }
  std::vector<std::string> cells;
  for (const Column& column : table->columns) {
    cells.push_back(column.key);
    std::ranges::replace(cells.back(), '/', '_');
  }
  WriteCsvLine(out, cells);
  for (const Json& row : ValueAt(document, table->key)) {
    std::ranges::transform(table->columns, cells.begin(),
                           [&row](const Column& column) {
                             return Bare(ValueAt(row, column.key));
                           });
    WriteCsvLine(out, cells);
  }
}

}  // namespace fdi::report
