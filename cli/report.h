#pragma once

#include <functional>
#include <iosfwd>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "cli/json_output.h"
#include "cli/terminal.h"
#include "cli/text_table.h"

namespace fdi::cli {

/// How people see a value of a document. JSON and CSV have it bare.
enum class Format {
  kPlain,     ///< Text as it is, numbers with Column::decimals.
  kTime,      ///< A `*_utc` text as a time in the user's zone.
  kDuration,  ///< A `*_s` number as "3 min 05 s".
  kPercent,   ///< A share of 0..1 as "12.5 %".
};

/// One column of a table, or one line of a list of fields.
///
/// A value that is missing, null or not finite is shown as "-", a flag as yes
/// or no, a list with commas between its items.
struct Column {
  std::string heading;  ///< With its unit: "period [s]".
  /// The member of the row, which is the CSV header as well: "period_s". A
  /// member of a member is named by its path, "fit/vaf_pct"; its CSV header is
  /// "fit_vaf_pct".
  std::string key{};
  Format format{Format::kPlain};
  int decimals{2};  ///< Of numbers that are not integers.
  /// Where a table is wider than the terminal, columns above 0 are left out,
  /// the highest first.
  int spare{0};
  /// Makes the text for people from the whole row, where one member does not
  /// suffice.
  std::function<std::string(const Json& row)> text{};
  std::function<Tone(const Json& row)> tone{};
  /// Without it, columns with numbers are aligned right and others left.
  std::optional<Align> align{};
};

/// How a Report is rendered.
struct ReportStyle {
  TextStyle text;   ///< Colour and width.
  bool utc{false};  ///< Times in UTC, not in the local zone.
};

/// The result of a verb: one JSON document, and which parts of it people see.
/// A verb fills `document`; text, JSON and CSV follow from it. Return it from
/// the action of Program::AddVerb(), which prints it as the user asks:
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
  Report& Table(std::string key, std::vector<Column> columns,
                std::string if_empty = "");
  /// Shows members of the object at `key` ("" is the document) as aligned
  /// lines "heading:  value".
  Report& Fields(std::string key, std::vector<Column> fields);
  /// A line, or several, for people alone.
  Report& Line(std::string text);
  /// What --csv prints, where that is not the first table: the members `keys`
  /// of the rows at `key`.
  Report& Csv(std::string key, std::vector<std::string> keys);

  /// The parts for people, in the order in which they were added.
  void PrintText(std::ostream& out, const ReportStyle& style) const;
  /// The document.
  void PrintJson(std::ostream& out) const;
  /// One table as WriteCsvLine() does: keys as header, values bare.
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
  using View = std::variant<TableView, FieldsView, std::string>;

  void Print(const TableView& view, std::ostream& out,
             const ReportStyle& style) const;
  void Print(const FieldsView& view, std::ostream& out,
             const ReportStyle& style) const;

  std::vector<View> views_;
  std::optional<TableView> csv_;
};

}  // namespace fdi::cli
