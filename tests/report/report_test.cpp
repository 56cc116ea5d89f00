#include "report/report.h"

#include <limits>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/csv_cells.h"
#include "report/program.h"
#include "report/signal_list.h"

namespace fdi::report {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

Report TwoValves() {
  Report report;
  report.document["valves"] = {
      {{"valve_id", "FV-1"},
       {"start_utc", "2026-11-20T14:56:11Z"},
       {"length_s", 185.0},
       {"share", 0.125},
       {"episodes", 3},
       {"signals", SignalsJson(ParseSignals("CV,P1"))},
       {"fit", {{"vaf_pct", 99.126}}}},
      {{"valve_id", "a \"new\", valve"},
       {"start_utc", nullptr},
       {"live", true},
       {"fit", {{"vaf_pct", std::numeric_limits<double>::quiet_NaN()}}}}};
  report.document["total"] = 2;
  report.Table("valves", {{"valve", "valve_id"},
                          {"start", "start_utc", Format::kTime},
                          {"length", "length_s", Format::kDuration},
                          {"share", "share", Format::kPercent},
                          {"episodes", "episodes"},
                          {"signals", "signals"},
                          {"VAF [%]", "fit/vaf_pct", Format::kPlain, 1},
                          {"live", "live"}});
  report.Line("Two valves.");
  report.Fields("", {{"valves in all", "total"}, {"none", "missing"}});
  return report;
}

std::string TextOf(const Report& report, const ReportStyle& style = {}) {
  std::ostringstream out;
  report.PrintText(out, style);
  return out.str();
}

std::string CsvOf(const Report& report) {
  std::ostringstream out;
  report.PrintCsv(out);
  return out.str();
}

TEST(ReportTest, TextShowsEachKindOfValueAsPeopleReadIt) {
  EXPECT_EQ(TextOf(TwoValves(), {{}, true}),
            "valve           start                     length   share  "
            "episodes  signals  VAF [%]  live\n"
            "FV-1            2026-11-20T14:56:11Z  3 min 05 s  12.5 %  "
            "       3  CV,P1       99.1  -\n"
            "a \"new\", valve  -                              -       -  "
            "       -  -              -  yes\n"
            "Two valves.\n"
            "valves in all:  2\n"
            "none:           -\n");
}

TEST(ReportTest, CsvHasTheFirstTableWithBareValuesAndQuotedCells) {
  EXPECT_EQ(CsvOf(TwoValves()),
            "valve_id,start_utc,length_s,share,episodes,signals,fit_vaf_pct,"
            "live\n"
            "FV-1,2026-11-20T14:56:11Z,185.0,0.125,3,\"CV,P1\",99.126,\n"
            "\"a \"\"new\"\", valve\",,,,,,,true\n");
}

TEST(ReportTest, TextFromOutsideCommandsNoTerminal) {
  Report report;
  report.document = {{"id", "V\x1b[2J\n"}, {"rows", {{{"id", "V\x1b[2J\n"}}}}};
  report.Table("rows", {{"id", "id"}}).Fields("", {{"id", "id"}});
  report.Line("id V\x1b[2J");

  EXPECT_EQ(TextOf(report),
            "id\nV\\x1b[2J\\x0a\nid:  V\\x1b[2J\\x0a\nid V\\x1b[2J\n");
}

TEST(ReportTest, CsvHoldsNoFormula) {
  Report report;
  for (const char* text : {"=1+1", "+1+1", "-1+1", "@SUM(A1)", "'=1", "-1.5",
                           "+3", "-", "plain", "'plain"}) {
    report.document["rows"].push_back({{"id", text}});
  }
  report.Table("rows", {{"id", "id"}});

  EXPECT_EQ(CsvOf(report),
            "id\n'=1+1\n'+1+1\n'-1+1\n'@SUM(A1)\n''=1\n-1.5\n+3\n-\nplain\n"
            "'plain\n");
  std::istringstream lines(CsvOf(report));
  std::string line;
  std::getline(lines, line);
  CsvCells cells;
  for (const Json& row : report.document["rows"]) {
    std::getline(lines, line);
    ASSERT_TRUE(cells.TakeLine(line));
    EXPECT_EQ(cells.cells().at(0), row["id"].get<std::string>());
  }
}

TEST(ReportTest, CsvMayHaveColumnsOfItsOwn) {
  Report report = TwoValves();
  report.Csv("valves", {"valve_id", "live"});

  EXPECT_EQ(CsvOf(report),
            "valve_id,live\nFV-1,\n\"a \"\"new\"\", valve\",true\n");
}

TEST(ReportTest, CsvWithoutATableIsAnError) {
  Report report;
  report.Line("Nothing to see.");

  EXPECT_THROW(CsvOf(report), std::logic_error);
}

TEST(ReportTest, JsonIsTheWholeDocument) {
  std::ostringstream out;
  TwoValves().PrintJson(out);

  const Json read = Json::parse(out.str());
  EXPECT_EQ(read["total"], 2);
  EXPECT_EQ(read["valves"][0]["fit"]["vaf_pct"], 99.126);
  EXPECT_TRUE(read["valves"][1]["fit"]["vaf_pct"].is_null());
}

TEST(ReportTest, EmptyTableSaysSo) {
  Report report;
  report.document["runs"] = Json::array();
  report.Table("runs", {{"run", "run_id"}}, "no run matches");

  EXPECT_EQ(TextOf(report), "no run matches\n");
  EXPECT_EQ(CsvOf(report), "run_id\n");
}

TEST(ReportTest, ColumnsMadeFromTheRowHaveTheirToneAndAlignment) {
  Report report;
  report.document["rows"] = {{{"from", 1}, {"to", 22}}, {{"from", 3}}};
  Column range{"range", "from"};
  range.text = [](const Json& row) {
    return row["from"].dump() + ".." + (row.contains("to") ? "to" : "");
  };
  range.tone = [](const Json& row) {
    return row.contains("to") ? Tone::kPlain : Tone::kAlarm;
  };
  range.align = Align::kRight;
  report.Table("rows", {range});

  EXPECT_EQ(TextOf(report), "range\n1..to\n  3..\n");
  EXPECT_THAT(TextOf(report, {{true, 0}, false}),
              AllOf(HasSubstr("\x1b[1;31m  3.."), Not(HasSubstr("m1..to"))));
}

// Runs `prog list` with `arguments`.
std::string Listed(std::vector<const char*> arguments, int expected_code) {
  Program program("prog", "A program");
  CLI::App& list =
      program.AddVerb("list", "Lists", [](const Context&) -> Report {
        Report report = TwoValves();
        report.exit_code = kExitNotFound;
        return report;
      });
  program.AllowCsv(list, "One line per valve");
  arguments.insert(arguments.begin(), {"prog", "list"});
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  EXPECT_EQ(program.Run(static_cast<int>(arguments.size()), arguments.data()),
            expected_code);
  return testing::internal::GetCapturedStdout() +
         testing::internal::GetCapturedStderr();
}

TEST(ReportTest, ProgramPrintsTheReportOfAVerbAsAsked) {
  const Report report = TwoValves();
  std::ostringstream json;
  report.PrintJson(json);

  EXPECT_EQ(Listed({"--utc"}, kExitNotFound), TextOf(report, {{}, true}));
  EXPECT_EQ(Listed({"--csv"}, kExitNotFound), CsvOf(report));
  EXPECT_EQ(Listed({"--json"}, kExitNotFound), json.str());
  EXPECT_EQ(Listed({"--json", "--csv"}, kExitUsage),
            "prog: error: --csv and --json exclude each other\n");
}

TEST(ReportTest, HtmlHasThePartsOfTheTextAndEscapesThem) {
  Report report;
  report.document["runs"] = {{{"run", "a<b>&\"c\""}, {"share", 0.5}},
                             {{"run", "d"}, {"share", nullptr}}};
  report.document["counts"] = {{"f3", {{"f3", 2}}}, {"normal", {{"f3", 0}}}};
  report.Line("Two\nlines.").Heading("Runs");
  report.Table("runs",
               {{.heading = "run",
                 .key = "run",
                 .picture = [](const Json&) { return std::string("p"); }},
                {.heading = "share",
                 .key = "share",
                 .format = Format::kPercent,
                 .spare = 1,
                 .tone = [](const Json&) { return Tone::kGood; },
                 .meaning = "of <all>"}});
  report.Table("counts", {{"truth", "name"}, {"f3", "f3"}});
  report.Picture("p", "Picture", "<svg></svg>");
  std::ostringstream out;
  report.PrintHtml(out, "A & B");
  EXPECT_THAT(
      out.str(),
      AllOf(HasSubstr("<title>A &amp; B</title>"), HasSubstr("<h1>A &amp; B"),
            HasSubstr("<p>Two\nlines.</p>"), HasSubstr("<h2>Runs</h2>"),
            HasSubstr("p{white-space:pre-line;overflow-wrap:anywhere}"),
            HasSubstr("<a href=\"#p\">a&lt;b&gt;&amp;&quot;c&quot;</a>"),
            HasSubstr("<td class=\"number good\">50.0 %</td>"),
            HasSubstr("<td class=\"number good\">-</td>"),
            HasSubstr("<dt>share</dt><dd>of &lt;all&gt;</dd>"),
            HasSubstr("<h3 id=\"p\">Picture</h3>"), HasSubstr("<svg></svg>")));
  EXPECT_THAT(out.str(), AllOf(Not(HasSubstr("<script")), HasSubstr(">f3</td>"),
                               HasSubstr(">normal</td>")));
  // Headings and rows by name are in the text, too; pictures are not.
  EXPECT_THAT(TextOf(report),
              AllOf(HasSubstr("\nRuns\n"), HasSubstr("truth   f3\n"),
                    HasSubstr("normal   0\n"), Not(HasSubstr("svg"))));
}

TEST(ReportTest, PageHasStylesForPaperAndDarkScreens) {
  Report report;
  std::ostringstream out;
  report.PrintHtml(out, "Page", {.landscape = true});
  EXPECT_THAT(
      out.str(),
      AllOf(HasSubstr("@page{size:A4 landscape;"), HasSubstr("@media print{"),
            HasSubstr("@media screen and (prefers-color-scheme:dark)")));
  std::ostringstream upright;
  report.PrintHtml(upright, "Page");
  EXPECT_THAT(upright.str(), HasSubstr("@page{size:A4;"));
}

}  // namespace
}  // namespace fdi::report
