#include "trainer/app/report_page.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <set>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/svg.h"
#include "storage/cli/text_table.h"
#include "trainer/app/evaluation_report.h"
#include "trainer/app/model_report.h"
#include "trainer/app/report_picture.h"

namespace fdi::trainer {
namespace {

using cli::FormatNumber;
using cli::XmlText;

constexpr std::string_view kPageStyle =
    R"(body{margin:1.5em auto;max-width:1240px;padding:0 1em;background:#fff;color:#222;font:14px/1.45 system-ui,"DejaVu Sans",sans-serif}
h1{font-size:1.5em}h2{font-size:1.2em;margin-top:2em}h3{font-size:1em;margin:2em 0 .3em}
a{color:#0072b2}
.lead{font-size:1.1em}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:12px}
th,td{padding:2px 7px;border-bottom:1px solid #ddd;text-align:right;white-space:nowrap}
th{border-bottom:1px solid #888;font-weight:600}
th:first-child,td:first-child,.left{text-align:left}
.note{color:#555;font-size:12px}
.none{color:#999}
.key{display:inline-block;width:1em;height:1em;vertical-align:-.15em;margin:0 .3em 0 1em}
.key.right{background:#009e73}.key.partly{background:#56b4e9}.key.wrong{background:#d55e00}.key.open{background:#999}
svg.plot{max-width:100%;height:auto}
@media (prefers-color-scheme:dark){body{background:#161616;color:#ddd}a{color:#56b4e9}th,td{border-color:#333}th{border-color:#777}.note{color:#aaa}.none{color:#666}}
)";

std::string Cell(std::string_view text, std::string_view classes = {}) {
  return "<td" +
         (classes.empty() ? "" : " class=\"" + std::string(classes) + '"') +
         '>' + XmlText(text) + "</td>";
}

std::string HeadRow(const std::vector<std::string>& names) {
  std::string row = "<tr>";
  for (const std::string& name : names) {
    row += "<th>" + XmlText(name) + "</th>";
  }
  return row + "</tr>\n";
}

std::string OfText(int count, int all) {
  return std::to_string(count) + " of " + std::to_string(all);
}

std::string LeadText(const EvaluationFigures& f) {
  const EvaluationSummary& s = f.summary;
  std::string text =
      OfText(s.detected, s.faulty_runs) +
      " faults detected; the final set has " + "the fault in " +
      std::to_string(s.contained) + ", is the fault in " +
      std::to_string(s.exact) + ", lies within its group in " +
      std::to_string(f.exact_group) + ". Mean d_acc of the detected " +
      IndexText(s.mean_d_acc, 3) + " by fault, " +
      IndexText(f.mean_d_acc_group, 3) + " by group; largest r_fd " +
      IndexText(s.max_r_fd, 4) + ". " + std::to_string(s.fault_free_episodes) +
      " episodes in " + FormatNumber(s.fault_free_hours, 2) +
      " h without fault.";
  if (f.without_truth > 0) {
    text += ' ' + std::to_string(f.without_truth) +
            " runs without truth are not counted.";
  }
  return text;
}

std::string FiguresRow(const std::string& name, const EvaluationFigures& f,
                       bool by_group) {
  const EvaluationSummary& s = f.summary;
  return "<tr>" + Cell(name) + Cell(std::to_string(s.faulty_runs)) +
         Cell(std::to_string(s.detected)) +
         Cell(std::to_string(by_group ? f.contained_group : s.contained)) +
         Cell(std::to_string(by_group ? f.exact_group : s.exact)) +
         Cell(IndexText(by_group ? f.mean_d_acc_group : s.mean_d_acc, 3)) +
         Cell(IndexText(s.max_r_fd, 4)) + "</tr>\n";
}

// A row for every group of the runs' truths, then all of them.
std::string FiguresTable(const ReportContent& content, bool by_group) {
  const std::vector<FaultGroup> groups =
      by_group ? content.models.groups : std::vector<FaultGroup>{};
  std::set<FaultGroup> truths;
  for (const EvaluatedRun& run : content.runs) {
    if (run.has_truth && run.indices.fault != 0) {
      truths.insert(GroupOf(run.indices.fault, groups));
    }
  }
  std::string table = "<div class=\"scroll\"><table>\n" +
                      HeadRow({by_group ? "group" : "fault", "runs", "detected",
                               "contained", "exact", "mean d_acc", "max r_fd"});
  for (const FaultGroup& group : truths) {
    table += FiguresRow(
        SetText(group),
        FiguresOf(RunsOf(group, content.runs), content.models.groups),
        by_group);
  }
  table += FiguresRow("all", FiguresOf(content.runs, content.models.groups),
                      by_group);
  return table + "</table></div>\n";
}

std::string RunAnchor(std::size_t index) {
  return "run-" + std::to_string(index + 1);
}

std::string IndicesTable(const ReportContent& content) {
  std::vector<std::string> names{"run", "fault", "strength", "detected",
                                 "final set"};
  for (const auto& [name, value] : IndexNumbers(RunIndices{})) {
    names.push_back(name);
  }
  names.insert(names.end(), {"t_exact", "episodes", "wrong"});
  std::string table = "<div class=\"scroll\"><table>\n" + HeadRow(names);
  for (std::size_t r = 0; r < content.runs.size(); ++r) {
    const EvaluatedRun& run = content.runs[r];
    const RunIndices& i = run.indices;
    table += "<tr><td><a href=\"#" + RunAnchor(r) + "\">" + XmlText(i.run_id) +
             "</a></td>" + Cell(run.has_truth ? TruthText(run) : "?") +
             Cell(i.fault != 0 ? FormatNumber(i.strength, 2) : "-") +
             Cell(IsDetected(run) ? "yes" : "no") + Cell(SetText(Outcome(run)));
    for (const auto& [name, value] : IndexNumbers(i)) {
      table += Cell(IndexText(value, name[0] == 't' ? 0 : 3));
    }
    table += Cell(IndexText(i.t_exact, 0)) + Cell(std::to_string(i.episodes)) +
             Cell(std::to_string(i.wrong_isolations)) + "</tr>\n";
  }
  return table + "</table></div>\n";
}

// Blue for what is right, orange for what is not, by its share of the row.
std::string Shade(bool right, double share) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(),
                "<td style=\"background:rgba(%s,%.2f)\">",
                right ? "0,114,178" : "230,159,0", 0.1 + 0.5 * share);
  return text.data();
}

std::string ConfusionTable(const ConfusionMatrix& matrix,
                           const std::string& heading) {
  std::vector<std::string> names{heading};
  for (const FaultGroup& group : matrix.columns) {
    names.push_back(SetText(group));
  }
  names.insert(names.end(), {"unknown", "no alarm"});
  std::string table = "<div class=\"scroll\"><table>\n" + HeadRow(names);
  for (std::size_t r = 0; r < matrix.rows.size(); ++r) {
    const std::vector<double>& counts = matrix.counts[r];
    double sum = 0.0;
    for (const double count : counts) {
      sum += count;
    }
    table += "<tr>" + Cell(SetText(matrix.rows[r]));
    for (std::size_t c = 0; c < counts.size(); ++c) {
      const bool right =
          c < matrix.columns.size()
              ? matrix.columns[c] == matrix.rows[r]
              : c + 1 == counts.size() && matrix.rows[r] == FaultGroup{0};
      table += counts[c] == 0.0 ? Cell(".", "none")
                                : Shade(right, counts[c] / sum) +
                                      CountText(counts[c]) + "</td>";
    }
    table += "</tr>\n";
  }
  return table + "</table></div>\n";
}

std::string RunTitle(const EvaluatedRun& run) {
  const RunIndices& i = run.indices;
  std::string text = i.run_id + ": ";
  text += !run.has_truth ? "truth unknown"
          : i.fault == 0
              ? "no fault"
              : TruthText(run) + ", strength " + FormatNumber(i.strength, 2) +
                    ", " + std::string(FaultFactsOf(i.fault).description);
  text += IsDetected(run) ? "; detected" : "; not detected";
  if (i.t_dt >= 0.0) {
    text += " after " + FormatNumber(i.t_dt, 0) + " s";
  }
  const std::string set = SetText(Outcome(run));
  return text + (set.empty() ? ", no fault named" : ", final set " + set);
}

std::string RunSections(const ReportContent& content) {
  std::string sections;
  for (std::size_t r = 0; r < content.runs.size(); ++r) {
    sections += "<h3 id=\"" + RunAnchor(r) + "\">" +
                XmlText(RunTitle(content.runs[r])) +
                "</h3>\n<div class=\"scroll\">" +
                RunPicture(content.models, content.runs[r], content.traces[r]) +
                "</div>\n";
  }
  return sections;
}

std::string BandKey() {
  const auto key = [](const std::string& name, const char* meaning) {
    return "<span class=\"key " + name + "\"></span>" + meaning;
  };
  return "<p class=\"note\">Isolated set:" + key("right", "the fault alone") +
         key("partly", "the fault and others, or truth unknown") +
         key("wrong", "without the fault, or before it") +
         key("open", "detected, none named") +
         ".<br>A dotted line marks the start of the fault. Where values are "
         "closer than pixels, the smallest and the largest are drawn.</p>\n";
}

}  // namespace

std::string ReportPage(const ReportContent& content) {
  const ModelSet& models = content.models;
  const std::string set = models.name + "@" + std::to_string(models.version);
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta "
         "charset=\"utf-8\">\n<meta name=\"viewport\" "
         "content=\"width=device-width\">\n<meta name=\"color-scheme\" "
         "content=\"light dark\">\n<title>Evaluation of " +
         XmlText(set) + "</title>\n<style>" + std::string(kPageStyle) +
         std::string(cli::SvgStyle()) + "</style>\n</head>\n<body>\n<h1>" +
         "Evaluation of " + XmlText(set) + "</h1>\n<p class=\"lead\">" +
         XmlText(LeadText(FiguresOf(content.runs, models.groups))) +
         "</p>\n<p class=\"note\">Model set " + XmlText(set) + ", hash " +
         HashText(models.content_hash) +
         "; not told apart: " + XmlText(GroupsText(models)) +
         "; undetectable: " + XmlText(FaultsText(models.undetectable)) +
         ".<br>Scored by " + XmlText(content.software) + ": <code>" +
         XmlText(content.command_line) + "</code></p>\n<h2>By fault</h2>\n" +
         FiguresTable(content, false) +
         "<h2>By group of faults not told apart</h2>\n" +
         FiguresTable(content, true) +
         "<h2>Indices of every run</h2>\n<p class=\"note\">Times in s from "
         "the start of the fault; - where an index has no meaning.</p>\n" +
         IndicesTable(content) +
         "<h2>Confusion by fault</h2>\n<p class=\"note\">Rows: what was true; "
         "columns: what the run ended with. A set of n faults counts 1/n for "
         "each.</p>\n" +
         ConfusionTable(BuildConfusion(content.runs), "truth \\ outcome") +
         "<h2>Confusion by group</h2>\n" +
         ConfusionTable(BuildConfusion(content.runs, models.groups),
                        "truth \\ outcome") +
         "<h2>Traces</h2>\n" + BandKey() + RunSections(content) +
         "</body>\n</html>\n";
}

}  // namespace fdi::trainer
