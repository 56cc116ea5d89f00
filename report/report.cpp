#include "report/report.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "base/csv_cells.h"
#include "base/printable.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/time_units.h"

// A report is one document of JSON and a list of views that refer to its
// members by key. Nothing is rendered before it is printed; TextPrinter and
// HtmlPrinter visit the same views, so that a terminal and a page show the same
// values, and --json prints the document itself.
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

// The rows of a table. The members of an object become rows with a name; they
// are made in `named`, which therefore has to outlive the result.
const Json& RowsAt(const Json& document, const std::string& path, Json& named) {
  const Json& value = ValueAt(document, path);
  if (!value.is_object()) {
    return value;
  }
  named = Json::array();
  for (const auto& [name, row] : value.items()) {
    named.push_back(row);
    named.back()["name"] = name;
  }
  return named;
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
  return value.is_array() ? JoinText(value, ",", Bare) : value.dump();
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

// Texts come from files and from the bus, and a terminal would obey the control
// characters in them.
std::string TextOf(const Json& row, const Column& column, bool utc) {
  return Printable(RawText(row, column, utc));
}

// A column of numbers is known by any of its values, because some may be null.
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

// The page is one file without a script, so that it can be sent and archived.
// Colours are the same in meaning on a light screen, a dark one and on paper.
constexpr std::string_view kPageStyle =
    R"(body{margin:1.5em auto;max-width:1240px;padding:0 1em;background:#fff;color:#222;font:14px/1.45 system-ui,"DejaVu Sans",sans-serif}
h1{font-size:1.5em}h2{font-size:1.2em;margin-top:2em}h3{font-size:1em;margin:2em 0 .3em}
a{color:#0072b2}
p{white-space:pre-line;overflow-wrap:anywhere}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:12px}
th,td{padding:2px 7px;border-bottom:1px solid #ddd;text-align:left;white-space:nowrap}
th{font-weight:600}
.number{text-align:right}
td{vertical-align:top}td.wrap{white-space:normal;min-width:5em}
dl{display:grid;grid-template-columns:max-content 1fr;gap:0 1em;font-size:12px}
dt{font-weight:600}dd{margin:0}
.quiet{color:#767676}
.good{background:#cce3f0}.warning{background:#fae7bf}.alarm{background:#f6d0bb;font-weight:600}
svg{max-width:100%;height:auto;font-family:"DejaVu Sans",Verdana,sans-serif}
@media screen and (max-width:45em){th,td:not(.number){white-space:normal}td.wrap{min-width:10em}}
@media screen and (prefers-color-scheme:dark){body{background:#161616;color:#ddd}a{color:#56b4e9}th,td{border-color:#333}.quiet{color:#8c8c8c}.good{background:#123a52}.warning{background:#4d3a10}.alarm{background:#5c2a10}}
@media print{:root{color-scheme:light}body{margin:0;padding:0;max-width:none;font-size:10pt;print-color-adjust:exact;-webkit-print-color-adjust:exact}
table,dl{font-size:8pt}th,td{white-space:normal;padding:2px 5px}td.wrap{min-width:0}.scroll{overflow:visible}
h1,h2,h3{break-after:avoid}tr,svg,dl{break-inside:avoid}svg{max-height:230mm}h2{margin-top:.9em}a{color:inherit;text-decoration:none}}
)";

// Also for attributes, hence the quotation mark.
std::string HtmlText(std::string_view text) {
  std::string escaped;
  for (const char c : Printable(text, "\n")) {
    escaped += c == '&'   ? "&amp;"
               : c == '<' ? "&lt;"
               : c == '>' ? "&gt;"
               : c == '"' ? "&quot;"
                          : std::string(1, c);
  }
  return escaped;
}

// Its class in kPageStyle.
const char* ToneName(Tone tone) {
  switch (tone) {
    case Tone::kPlain:
      return "";
    case Tone::kGood:
      return "good";
    case Tone::kAlarm:
      return "alarm";
    case Tone::kWarning:
      return "warning";
    case Tone::kQuiet:
      return "quiet";
  }
  return "";
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
  views_.emplace_back(LineView{std::move(text)});
  return *this;
}

Report& Report::Heading(std::string text) {
  views_.emplace_back(HeadingView{std::move(text)});
  return *this;
}

Report& Report::Picture(std::string id, std::string title, std::string svg) {
  views_.emplace_back(
      PictureView{std::move(id), std::move(title), std::move(svg)});
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

// Each view as text.
class Report::TextPrinter {
 public:
  TextPrinter(const Json& document, std::ostream& out, const ReportStyle& style)
      : document_(document), out_(out), style_(style) {}

  void operator()(const TableView& view) const {
    Json named;
    const Json& rows = RowsAt(document_, view.key, named);
    if (rows.empty()) {
      if (!view.if_empty.empty()) {
        out_ << view.if_empty << '\n';
      }
      return;
    }
    std::vector<TextTable::Column> columns;
    for (const Column& column : view.columns) {
      columns.push_back({column.heading, AlignOf(rows, column), column.spare,
                         column.least_width});
    }
    TextTable table(std::move(columns));
    for (const Json& row : rows) {
      std::vector<std::string> cells;
      for (const Column& column : view.columns) {
        cells.push_back(TextOf(row, column, style_.utc));
      }
      table.AddRow(std::move(cells));
      for (std::size_t c = 0; c < view.columns.size(); ++c) {
        if (view.columns[c].tone) {
          table.SetTone(c, view.columns[c].tone(row));
        }
      }
    }
    table.Print(out_, style_.text);
  }

  void operator()(const FieldsView& view) const {
    const Json& object = ValueAt(document_, view.key);
    std::size_t width = 0;
    for (const Column& field : view.fields) {
      width = std::max(width, TextWidth(field.heading));
    }
    for (const Column& field : view.fields) {
      out_ << field.heading << ':'
           << std::string(width - TextWidth(field.heading) + 2, ' ')
           << TextOf(object, field, style_.utc) << '\n';
    }
  }

  void operator()(const LineView& line) const {
    out_ << Printable(line.text, "\n") << '\n';
  }
  void operator()(const HeadingView& heading) const {
    out_ << '\n' << Printable(heading.text) << '\n';
  }
  void operator()(const PictureView&) const {}

 private:
  const Json& document_;
  std::ostream& out_;
  const ReportStyle& style_;
};

// Each view as an element of a page.
class Report::HtmlPrinter {
 public:
  HtmlPrinter(const Json& document, std::ostream& out, bool utc)
      : document_(document), out_(out), utc_(utc) {}

  void operator()(const TableView& view) const {
    Json named;
    const Json& rows = RowsAt(document_, view.key, named);
    if (rows.empty()) {
      (*this)(LineView{view.if_empty});
      return;
    }
    std::vector<std::string> kinds;
    out_ << "<div class=\"scroll\"><table>\n<tr>";
    for (const Column& column : view.columns) {
      kinds.emplace_back(AlignOf(rows, column) == Align::kRight ? "number"
                                                                : "");
      out_ << "<th" << ClassOf(kinds.back()) << '>' << HtmlText(column.heading)
           << "</th>";
    }
    for (const Json& row : rows) {
      out_ << "</tr>\n<tr>";
      for (std::size_t c = 0; c < view.columns.size(); ++c) {
        PrintCell(row, view.columns[c], kinds[c]);
      }
    }
    out_ << "</tr>\n</table></div>\n";
    PrintMeanings(view.columns);
  }

  void operator()(const FieldsView& view) const {
    const Json& object = ValueAt(document_, view.key);
    out_ << "<table>\n";
    for (const Column& field : view.fields) {
      out_ << "<tr><th>" << HtmlText(field.heading) << "</th>";
      PrintCell(object, field, "");
      out_ << "</tr>\n";
    }
    out_ << "</table>\n";
    PrintMeanings(view.fields);
  }

  void operator()(const LineView& line) const {
    if (!line.text.empty()) {
      out_ << "<p>" << HtmlText(line.text) << "</p>\n";
    }
  }
  void operator()(const HeadingView& heading) const {
    out_ << "<h2>" << HtmlText(heading.text) << "</h2>\n";
  }
  void operator()(const PictureView& picture) const {
    out_ << "<h3 id=\"" << HtmlText(picture.id) << "\">"
         << HtmlText(picture.title) << "</h3>\n<div class=\"scroll\">"
         << picture.svg << "</div>\n";
  }

 private:
  // The attribute, where there is something to say.
  static std::string ClassOf(std::string kind, const std::string& tone = "") {
    kind += (kind.empty() || tone.empty() ? "" : " ") + tone;
    return kind.empty() ? "" : " class=\"" + kind + '"';
  }

  void PrintCell(const Json& row, const Column& column,
                 const std::string& kind) const {
    const Tone tone = column.tone ? column.tone(row) : Tone::kPlain;
    const std::string text = HtmlText(RawText(row, column, utc_));
    const std::string id = column.picture ? column.picture(row) : "";
    out_ << "<td" << ClassOf(column.wraps ? "wrap" : kind, ToneName(tone))
         << '>'
         << (id.empty() ? text
                        : "<a href=\"#" + HtmlText(id) + "\">" + text + "</a>")
         << "</td>";
  }

  void PrintMeanings(const std::vector<Column>& columns) const {
    std::string meanings;
    for (const Column& column : columns) {
      if (!column.meaning.empty()) {
        meanings += "<dt>" + HtmlText(column.heading) + "</dt><dd>" +
                    HtmlText(column.meaning) + "</dd>\n";
      }
    }
    if (!meanings.empty()) {
      out_ << "<dl>\n" << meanings << "</dl>\n";
    }
  }

  const Json& document_;
  std::ostream& out_;
  bool utc_;
};

void Report::PrintText(std::ostream& out, const ReportStyle& style) const {
  for (const View& view : views_) {
    std::visit(TextPrinter(document, out, style), view);
  }
}

void Report::PrintHtml(std::ostream& out, const std::string& title,
                       const PageStyle& style) const {
  const std::string heading = HtmlText(title);
  out << "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n"
         "<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width\">\n"
         "<meta name=\"color-scheme\" content=\"light dark\">\n<title>"
      << heading << "</title>\n<style>\n"
      << kPageStyle << "@page{size:A4" << (style.landscape ? " landscape" : "")
      << ";margin:12mm}\n</style>\n</head>\n<body>\n<h1>" << heading
      << "</h1>\n";
  for (const View& view : views_) {
    std::visit(HtmlPrinter(document, out, style.utc), view);
  }
  out << "</body>\n</html>\n";
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
  Json named;
  for (const Json& row : RowsAt(document, table->key, named)) {
    std::ranges::transform(table->columns, cells.begin(),
                           [&row](const Column& column) {
                             return Bare(ValueAt(row, column.key));
                           });
    WriteCsvLine(out, cells);
  }
}

}  // namespace fdi::report
