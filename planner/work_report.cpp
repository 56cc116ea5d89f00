#include "planner/work_report.h"

#include <algorithm>
#include <functional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "base/text.h"
#include "report/text_table.h"

namespace fdi::planner {
namespace {

using report::Column;
using report::Format;
using report::FormatNumber;
using report::Json;
using report::Tone;

std::string Or(const Json& value, const char* otherwise) {
  return value.is_null() ? otherwise : value.get<std::string>();
}

// "hall-1/monitor"; empty but for the plant's history.
std::string Where(const Json& row) {
  return row.contains("monitor") ? row["host"].get<std::string>() + "/" +
                                       row["monitor"].get<std::string>()
                                 : "";
}

// "Valve leaks through when shut (f6), or f18"
std::string FindingText(const Json& row) {
  std::string text = row["name"].get<std::string>() +
                     (row["fault"].is_null() || row["fault"] == "unknown"
                          ? ""
                          : " (" + row["fault"].get<std::string>() + ")");
  for (const Json& other : row["look_alikes"]) {
    text += ", or " + other.get<std::string>();
  }
  return text;
}

std::string SeverityText(const Json& row) {
  return row["severity"].get<std::string>() + " · " +
         FormatNumber(row["severity_points"].get<double>(), 0);
}

std::string CertaintyText(const Json& row) {
  return Or(row["certainty"], "-") + " · " +
         FormatNumber(row["confidence"].get<double>(), 2);
}

std::string GradeText(const Json& row) {
  return (row["grade"].is_null() ? "-" : row["grade"].dump()) + " · " +
         FormatNumber(row["grade_factor"].get<double>(), 1);
}

std::string StateText(const Json& row) {
  return row["open"] == false               ? "returned"
         : row["unconfirmed_utc"].is_null() ? "stands"
                                            : "not confirmed";
}

// Each factor of the score stands beside what it was made from ("high · 4"), so
// that a reader can multiply them by hand.
std::string RowText(const Json& row) {
  std::string text =
      row["rank"].dump() + ". " + row["valve_id"].get<std::string>();
  if (const std::string where = Where(row); !where.empty()) {
    text += " of " + where;
  }
  text += "  " + FormatNumber(row["score"].get<double>(), 2) + " (severity " +
          SeverityText(row) + ", certainty " + CertaintyText(row) + ", grade " +
          GradeText(row) + ")";
  if (!row["about_text"].get_ref<const std::string&>().empty()) {
    text += "\n   " + row["about_text"].get<std::string>();
  }
  text += "\n   because " + row["why"].get<std::string>();
  if (!row["shares"].is_null()) {
    text += "; shares " + row["shares"].get<std::string>();
  }
  if (!row["check"].is_null()) {
    text += "\n   " + row["discipline"].get<std::string>() + ": " +
            row["check"].get<std::string>();
  }
  if (const double hours = row["service_hours"]; hours > 0.0) {
    text += "\n   " + FormatNumber(row["travel_strokes"].get<double>(), 0) +
            " strokes in " + FormatNumber(hours, hours < 10.0 ? 1 : 0) +
            " h, " + FormatNumber(100.0 * row["live_share"].get<double>(), 0) +
            " % of it judged";
  }
  return text;
}

std::string CoverageText(const Json& coverage) {
  const auto count = [&coverage](const char* key) {
    return coverage[key].get<std::size_t>();
  };
  const std::size_t loops = count("loops");
  if (loops == 0) {
    return "No loop is known: neither valves with a model set, nor a plant's "
           "table, nor a history, nor runs.";
  }
  return std::to_string(loops - count("nothing")) + " of " +
         std::to_string(loops) + (loops == 1 ? " loop is" : " loops are") +
         " watched: " + std::to_string(count("named_faults")) +
         " for named faults, " + std::to_string(count("audit")) +
         " by the audit only, " + std::to_string(count("nothing")) +
         " by nothing.";
}

// Loops that nothing has judged may have any fault.
std::string NothingText(const Json& coverage) {
  return coverage["nothing"] != coverage["loops"]
             ? "Nothing to do."
             : "Nothing was judged: `fdi-monitor run` judges what valves send, "
               "`fdi-store worklist --audit-windows 3` stored runs.";
}

void AddHead(report::Report& report) {
  report.Fields("", {{"as of", "as_of_utc", Format::kTime},
                     {"since", "since_utc", Format::kTime},
                     {"judged since", "judged_since_utc", Format::kTime},
                     {"software", "software"}});
  report.Line(CoverageText(report.document["coverage"]));
}

void AddCsv(report::Report& report) {
  std::vector<std::string> keys = {"rank",
                                   "valve_id",
                                   "kind",
                                   "fault",
                                   "name",
                                   "severity",
                                   "severity_points",
                                   "certainty",
                                   "confidence",
                                   "layer",
                                   "about/description",
                                   "about/location",
                                   "about/document",
                                   "grade",
                                   "grade_factor",
                                   "score",
                                   "open",
                                   "detected_utc",
                                   "unconfirmed_utc",
                                   "ended_utc",
                                   "done_utc",
                                   "in_work_utc",
                                   "order",
                                   "expected_utc",
                                   "strength",
                                   "episodes",
                                   "episode_id",
                                   "confirmed",
                                   "acked_by",
                                   "label",
                                   "shares",
                                   "why",
                                   "discipline",
                                   "namur",
                                   "check",
                                   "travel_strokes",
                                   "service_hours",
                                   "look_alikes"};
  const Json& rows = report.document["rows"];
  const auto any = [&rows](const char* key) {
    return std::ranges::any_of(
        rows, [key](const Json& row) { return row.contains(key); });
  };
  if (any("waiting")) {
    keys.insert(keys.end(), {"waiting/week/value", "waiting/week/lowest",
                             "waiting/week/highest", "waiting/currency",
                             "waiting/loss/value", "waiting/unit"});
  }
  if (any("safe_until_stop")) {
    keys.emplace_back("safe_until_stop");
  }
  if (any("monitor")) {
    keys.insert(keys.end(), {"host", "monitor"});
  }
  report.Csv("rows", std::move(keys));
}

Column Text(std::string heading, std::function<std::string(const Json&)> text,
            std::string meaning = "") {
  Column column;
  column.heading = std::move(heading);
  column.text = std::move(text);
  column.meaning = std::move(meaning);
  return column;
}

Column Wide(Column column, int spare = 0) {
  column.wraps = true;
  column.spare = spare;
  return column;
}

std::vector<Column> RowColumns() {
  Column severity = Text("severity", SeverityText,
                         "by the catalogue at the strength of now: low 1, "
                         "medium 2, high 4, critical 8");
  severity.tone = [](const Json& row) {
    const double points = row["severity_points"];
    return points >= 4.0   ? Tone::kAlarm
           : points >= 2.0 ? Tone::kWarning
                           : Tone::kPlain;
  };
  return {
      {"rank", "rank"},
      Wide(Text("valve",
                [](const Json& row) {
                  const std::string where = Where(row);
                  const std::string about = row["about_text"];
                  return row["valve_id"].get<std::string>() +
                         (where.empty() ? "" : " of " + where) +
                         (about.empty() ? "" : ": " + about);
                })),
      Wide(Text("finding", FindingText)),
      severity,
      Text("certainty", CertaintyText,
           "sure or confirmed by a label 1, likely 0.75, one of or not known "
           "0.5, not yet 0.25, lessened where labels called this answer wrong; "
           "of a limit, the nearer the larger"),
      Text("grade", GradeText,
           "how much the plant depends on the loop: grade 1 counts 2, grade 2 "
           "or none 1, grade 3 a half"),
      {.heading = "score",
       .key = "score",
       .decimals = 2,
       .meaning = "severity times certainty times grade"},
      Text("state", StateText),
      Wide(Text("what to do",
                [](const Json& row) {
                  return row["check"].is_null()
                             ? "-"
                             : row["discipline"].get<std::string>() + ": " +
                                   row["check"].get<std::string>();
                })),
      Wide(Text("seen by, label",
                [](const Json& row) {
                  return Or(row["acked_by"], "-") + ", " +
                         Or(row["label"], "-");
                })),
      Wide(Text("why", [](const Json& row) {
        return row["why"].get<std::string>() +
               (row["shares"].is_null()
                    ? ""
                    : "; shares " + row["shares"].get<std::string>()) +
               (row["episode_id"].is_null()
                    ? ""
                    : "; episode " + row["episode_id"].get<std::string>());
      }))};
}

// A bar of three parts, the colours of which the colour-blind can tell apart,
// in light and dark.
std::string CoverageBar(const Json& coverage) {
  constexpr double kWidth = 600.0;
  const double loops = coverage["loops"];
  std::ostringstream svg;
  svg << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"600\" "
         "height=\"22\" viewBox=\"0 0 600 22\" role=\"img\" "
         "aria-label=\"named faults, audit, nothing\">";
  double x = 0.0;
  for (const auto& [key, colour] : {std::pair("named_faults", "#0072b2"),
                                    {"audit", "#56b4e9"},
                                    {"nothing", "#8c8c8c"}}) {
    const double width = kWidth * coverage[key].get<double>() / loops;
    svg << "<rect x=\"" << x << "\" y=\"0\" width=\"" << width
        << "\" height=\"22\" fill=\"" << colour << "\"/>";
    x += width;
  }
  svg << "</svg>\n";
  return svg.str();
}

void AddChanges(report::Report& page) {
  const Json& changes = page.document["changes"];
  page.Heading("Changes since the last list");
  if (changes.is_null()) {
    page.Line("There is no earlier list beside this page.");
    return;
  }
  page.Line("The last list is as of " + changes["last_utc"].get<std::string>() +
            " (" + changes["file"].get<std::string>() +
            "). Then: " + CoverageText(changes["coverage"]));
  page.Table("changes/valves",
             {{"valve", "valve_id"},
              {"change", "change"},
              Wide({"before", "before"}),
              Wide({"now", "now"})},
             "Nothing has changed.");
}

void AddAlarms(report::Report& page) {
  const Json& alarms = page.document["alarms"];
  page.Heading("Figures of the alarms");
  page.Line(alarms["labelled"]["true"].dump() + " labelled as a fault, " +
            alarms["labelled"]["false"].dump() + " as false alarms, " +
            alarms["labelled"]["none"].dump() + " without a label; at most " +
            alarms["most_in_10_min"].dump() + " in 10 minutes; " +
            alarms["gaps"].dump() + " gaps in the data.");
  page.Table("alarms/valves",
             {{"valve", "valve_id"},
              {"episodes", "episodes"},
              {"open", "open"},
              {"time in alarm", "alarm_s", Format::kDuration},
              {.heading = "chattering",
               .key = "chattering",
               .meaning = "episodes that came three times or more within half "
                          "an hour"},
              {.heading = "standing",
               .key = "standing",
               .meaning = "episodes that lasted longer than a day"}},
             "No alarm came.");
  page.Table("alarms/faults", {{"fault", "fault"},
                               {"episodes", "episodes"},
                               {"labelled right", "right"},
                               {"labelled wrong", "wrong"}});
  page.Table("alarms/days", {{"day (UTC)", "day_utc"},
                             {"episodes", "episodes"},
                             {"time in alarm", "alarm_s", Format::kDuration}});
}

}  // namespace

report::Report WorkListReport(Json document, std::size_t top) {
  report::Report report;
  report.document = std::move(document);
  AddHead(report);
  const Json& rows = report.document["rows"];
  report.Line(rows.empty() ? NothingText(report.document["coverage"]) : "");
  const std::size_t shown = top == 0 ? rows.size() : std::min(top, rows.size());
  for (std::size_t i = 0; i < shown; ++i) {
    report.Line(RowText(rows[i]));
  }
  if (shown < rows.size()) {
    report.Line("and " + std::to_string(rows.size() - shown) +
                " more (--rows 0)");
  }
  if (const std::size_t done = report.document["done"].size(); done > 0) {
    report.Line(std::to_string(done) +
                (done == 1 ? " finding is" : " findings are") +
                " done and watched for a return.");
  }
  AddCsv(report);
  return report;
}

report::Report WorkListPage(Json document) {
  report::Report page;
  page.document = std::move(document);
  AddHead(page);
  const Json& json = page.document;
  if (json["coverage"]["loops"] != 0) {
    page.Picture("coverage",
                 "What watches the loops: named faults (dark blue), audit "
                 "(light blue), nothing (grey)",
                 CoverageBar(json["coverage"]));
  }
  page.Heading("The worst first");
  page.Table("rows", RowColumns(), NothingText(json["coverage"]));
  page.Heading("Loops that share a cause or a period");
  page.Table("shared",
             {{"share", "shares"},
              {"group", "group"},
              {"period [s]", "period_s", Format::kPlain, 0},
              {"faults", "faults"},
              {"since", "since_utc", Format::kTime},
              {"ended", "ended_utc", Format::kTime},
              Wide({"loops", "valve_ids"})},
             "None.");
  AddChanges(page);
  page.Heading("What could not be judged, and why");
  page.Table("unjudged",
             {{"loop", "valve_id"},
              {"judged", "judged_share", Format::kPercent},
              Wide({"mostly because", "reason"})},
             "Every loop was judged for at least half of the time.");
  if (!json["done"].empty()) {
    page.Heading("Done, and watched for their return");
    page.Table("done", {{"valve", "valve_id"},
                        {"finding", "name"},
                        {"done", "done_utc", Format::kTime},
                        {"by", "who"},
                        Wide({"what", "what"})});
  }
  if (!json["shelved"].empty()) {
    page.Heading("Shelved, and therefore not in the list");
    page.Table("shelved", {{"valve", "valve_id"},
                           {"fault", "fault"},
                           {"until", "until_utc", Format::kTime},
                           {"by", "who"},
                           Wide({"comment", "comment"})});
  }
  AddAlarms(page);
  return page;
}

}  // namespace fdi::planner
