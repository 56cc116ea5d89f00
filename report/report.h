#pragma once

#include <functional>
#include <iosfwd>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "report/json_output.h"
#include "report/terminal.h"
#include "report/text_table.h"

namespace fdi::report {

/// Form of a value in text. JSON and CSV have the raw value.
enum class Format {
  kPlain,     ///< Text unchanged, numbers with Column::decimals.
  kTime,      ///< A `*_utc` text as a time in the user's zone.
  kDuration,  ///< A `*_s` number as "3 min 05 s".
  kPercent,   ///< A share of 0..1 as "12.5 %".
};

/// One column of a table, or one line of a list of fields.
///
/// Missing, null or non-finite values are shown as "-", flags as yes or no,
/// lists separated by commas.
struct Column {
  std::string heading;  ///< With its unit: "period [s]".
  /// The member of the row, which is also the CSV header: "period_s". A nested
  /// member is given by its path, "fit/vaf_pct"; its CSV header is
  /// "fit_vaf_pct".
  std::string key{};
  Format format{Format::kPlain};
  int decimals{2};  ///< In numbers that are not integers.
  /// If a table is wider than the terminal, columns above 0 are omitted, the
  /// highest first.
  int spare{0};
  /// If a table is too wide, cells may be cut to this width; 0: never.
  std::size_t least_width{0};
  /// Makes the text from the whole row, where one member does not suffice.
  std::function<std::string(const Json& row)> text{};
  std::function<Tone(const Json& row)> tone{};
  /// Default: columns with numbers are right-aligned, others left-aligned.
  std::optional<Align> align{};
  /// The meaning of the column, for readers who do not know it. HTML lists the
  /// meanings below the table.
  std::string meaning{};
  /// The id of the picture that HTML links the cell to; empty: none.
  std::function<std::string(const Json& row)> picture{};
  /// Text of several words, which HTML breaks into lines.
  bool wraps{false};
};

/// Layout of a page.
struct PageStyle {
  bool utc{false};        ///< Times in UTC instead of the local zone.
  bool landscape{false};  ///< On A4 paper; upright otherwise.
};

/// Style of a rendered Report.
struct ReportStyle {
  TextStyle text;   ///< Colour and width.
  bool utc{false};  ///< Times in UTC instead of the local zone.
};

/// The result of a verb: a JSON document, and which parts of it the text shows.
/// A verb fills `document`; text, JSON, CSV and HTML follow from it. Returned
/// by the action of Program::AddVerb(), which prints it in the requested form:
///
///     Report report;
///     report.document["runs"] = RunRows(...);
///     report.Table("runs", {{"run", "run_id"},
///                           {"start", "start_utc", Format::kTime},
///                           {"Ts [s]", "period_s"}}, "no run matches");
///     return report;
class Report {
 public:
  Json document = Json::object();
  int exit_code{0};

  /// Shows the array at `key`, a member of the document or a path "a/b", as a
  /// table. A row is an object. `if_empty` is printed if there is no row.
  /// In an object {"f3": {...}, ...} each member is a row, its name the row's
  /// member "name". Only a terminal makes the text narrower; files and pipes
  /// get all columns.
  Report& Table(std::string key, std::vector<Column> columns,
                std::string if_empty = "");
  /// Shows members of the object at `key` ("" is the document) as aligned
  /// lines "heading:  value".
  Report& Fields(std::string key, std::vector<Column> fields);
  /// One or more lines; not in JSON or CSV.
  Report& Line(std::string text);
  /// A heading above the parts that follow, set off by a blank line.
  Report& Heading(std::string text);
  /// An SVG element below its title, in HTML only. `id` is what cells link to.
  Report& Picture(std::string id, std::string title, std::string svg);
  /// The output of --csv, if not the first table: members `keys` of the rows
  /// at `key`.
  Report& Csv(std::string key, std::vector<std::string> keys);

  /// The text output, in the order in which parts were added.
  void PrintText(std::ostream& out, const ReportStyle& style) const;
  /// The same parts as a page that needs no script and no other file, readable
  /// on a light and a dark screen and on paper; all columns, whatever their
  /// `spare`.
  void PrintHtml(std::ostream& out, const std::string& title,
                 const PageStyle& style = {}) const;
  /// The document.
  void PrintJson(std::ostream& out) const;
  /// One table as WriteCsvLine() writes it: keys as header, raw values.
  /// @throws std::logic_error if there is no table.
  void PrintCsv(std::ostream& out) const;

 private:
  struct TableView {
    std::string key;
    std::vector<Column> columns;
    std::string if_empty;
  };
  struct FieldsView {
    std::string key;
    std::vector<Column> fields;
  };
  struct LineView {
    std::string text;
  };
  struct HeadingView {
    std::string text;
  };
  struct PictureView {
    std::string id;
    std::string title;
    std::string svg;
  };
  using View =
      std::variant<TableView, FieldsView, LineView, HeadingView, PictureView>;
  class TextPrinter;
  class HtmlPrinter;

  std::vector<View> views_;
  std::optional<TableView> csv_;
};

}  // namespace fdi::report
