// fdi-store runs sniff: analyses an exported file and proposes a tag map.
#include "import/sniff.h"

#include "import/tag_map.h"
#include "programs/store/verbs.h"

namespace fdi::storage {
namespace {

struct SniffOptions {
  std::string file;
  importer::TableOptions table;
  std::string output;
};

Json ColumnJson(const importer::SniffedColumn& column) {
  const bool numbers = !column.values.empty();
  const auto quantile = [&](double share) {
    return numbers ? Json(column.Quantile(share)) : Json();
  };
  return {{"column", column.name},
          {"signal", column.signal ? Json(SignalName(*column.signal)) : Json()},
          {"unit", column.signal ? Json(column.unit) : Json()},
          {"sense", column.signal != Signal::kCv && column.signal != Signal::kX
                        ? Json()
                    : column.opening ? Json("opening")
                                     : Json("closing")},
          {"min", quantile(0.0)},
          {"median", quantile(0.5)},
          {"max", quantile(1.0)},
          {"missing_share", column.cells == 0
                                ? 0.0
                                : static_cast<double>(column.missing) /
                                      static_cast<double>(column.cells)},
          {"guessed", column.guessed}};
}

Report SniffFile(const SniffOptions& options, const Context& context) {
  const importer::Sniffed found = importer::Sniff(
      TextLines::OfFile(options.file), options.table.Read(context.options.utc));
  Report report;
  report.document = {
      {"file", options.file},
      {"separator", std::string(1, found.map.separator)},
      {"decimal", std::string(1, found.map.decimal)},
      {"long", found.map.long_table.has_value()},
      {"rows", found.rows},
      {"time_column", found.map.time_column},
      {"time_unit", importer::TimeUnitName(found.time)},
      {"period_s", found.period_s},
      {"jitter_s", found.jitter_s},
      {"gaps", found.gaps},
      {"longest_gap_s", found.longest_gap_s},
      {"compressed", found.compressed},
      {"resample", found.resample},
      {"columns", Rows(found.columns, ColumnJson)},
      {"choices", found.choices},
      {"findings", found.findings},
      {"map", options.output.empty() ? Json() : Json(options.output)}};
  report.Fields("",
                {{"separator", "separator"},
                 {"decimal sign", "decimal"},
                 {"long table", "long"},
                 {"rows", "rows"},
                 {"time", "time_column"},
                 {"time in", "time_unit"},
                 {.heading = "period [s]", .key = "period_s", .decimals = 3},
                 {.heading = "jitter [s]", .key = "jitter_s", .decimals = 3},
                 {"gaps", "gaps"},
                 {"longest gap", "longest_gap_s", report::Format::kDuration},
                 {"compressed", "compressed"},
                 {"resample", "resample"}});
  report.Table("columns",
               {{"column", "column"},
                {"signal", "signal"},
                {"unit", "unit"},
                {"sense", "sense"},
                {"min", "min"},
                {"median", "median"},
                {"max", "max"},
                {"missing", "missing_share", report::Format::kPercent},
                {"guessed", "guessed"}});
  for (const std::string& choice : found.choices) {
    report.Line("open, chosen in the map: " + choice);
  }
  for (const std::string& finding : found.findings) {
    report.Line("- " + finding);
  }
  if (!options.output.empty()) {
    report::WriteFile(options.output, importer::MapText(found, options.file));
    report.Line("tag map written to " + options.output +
                ": check it, then --map " + options.output);
  }
  return report;
}

}  // namespace

void AddSniffVerb(report::Program& program, CLI::App& group) {
  auto [verb, options] =
      AddVerb(program, group, "sniff",
              "Describe what a file of the plant holds, and write a tag map to "
              "edit",
              SniffFile);
  verb.add_option("file", options.file, "CSV file, also gzipped")->required();
  options.table.AddTo(verb);
  verb.add_option("-o,--output", options.output, "Write a tag map to this file")
      ->type_name("FILE.toml");
}

}  // namespace fdi::storage
