#include "trainer/evaluation/report_page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "diagnosis/fault_catalogue.h"
#include "report/plot/figure.h"
#include "report/plot/gnuplot.h"
#include "report/text_table.h"
#include "storage/models/model_codec.h"
#include "trainer/campaign/run_input.h"
#include "trainer/evaluation/evaluation_report.h"
#include "trainer/rule_text.h"

namespace fdi::trainer {
namespace {

using report::FormatNumber;

constexpr double kPictureWidth = 1100.0;  // [px]
constexpr double kLegendWidth = 210.0;    // [px]
// A picture may take so many bytes; a larger one is drawn again with fewer
// points, down to kMinGroups.
constexpr std::size_t kPictureBytes = 90'000;
constexpr std::size_t kMaxGroups = 720;
constexpr std::size_t kMinGroups = 80;

constexpr std::string_view kPageStyle =
    R"(body{margin:1.5em auto;max-width:1240px;padding:0 1em;background:#fff;color:#222;font:14px/1.45 system-ui,"DejaVu Sans",sans-serif}
h1{font-size:1.5em}h2{font-size:1.2em;margin-top:2em}h3{font-size:1em;margin:2em 0 .3em}
a{color:#0072b2}
.lead{font-size:1.1em}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:12px}
th,td{padding:2px 7px;border-bottom:1px solid #ddd;text-align:right;white-space:nowrap}
th{border-bottom:1px solid #888;font-weight:600}
th:first-child,td:first-child{text-align:left}
.note{color:#555;font-size:12px}
.none{color:#999}
.key{display:inline-block;width:1em;height:1em;vertical-align:-.15em;margin:0 .3em 0 1em}
svg{max-width:100%;height:auto;font-family:"DejaVu Sans",Verdana,sans-serif}
@media (prefers-color-scheme:dark){body{background:#161616;color:#ddd}a{color:#56b4e9}th,td{border-color:#333}th{border-color:#777}.note{color:#aaa}.none{color:#666}}
)";

// The colours of isolated sets, and what they mean.
struct BandColour {
  const char* colour;
  const char* meaning;
};
constexpr BandColour kRight{plot::ink::kGreen, "the fault alone"};
constexpr BandColour kPartly{plot::ink::kSky,
                             "the fault and others, or truth unknown"};
constexpr BandColour kWrong{plot::ink::kVermilion,
                            "without the fault, or before it"};
constexpr BandColour kOpen{plot::ink::kGrey, "detected, none named"};

std::string HtmlText(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    escaped += c == '&'   ? "&amp;"
               : c == '<' ? "&lt;"
               : c == '>' ? "&gt;"
               : c == '"' ? "&quot;"
                          : std::string(1, c);
  }
  return escaped;
}

// The inner HTML of a cell behind the attributes of its element, up to and
// including the ">".
using CellHtml =
    std::function<std::string(std::size_t row, std::size_t column)>;

std::string Table(const Grid& grid, const CellHtml& cell = {}) {
  std::string html = "<div class=\"scroll\"><table>\n<tr>";
  for (const auto& column : grid.columns) {
    html += "<th>" + HtmlText(column.heading) + "</th>";
  }
  for (std::size_t r = 0; r < grid.rows.size(); ++r) {
    html += "</tr>\n<tr>";
    for (std::size_t c = 0; c < grid.rows[r].size(); ++c) {
      const std::string own = cell ? cell(r, c) : "";
      html += "<td" + (own.empty() ? '>' + HtmlText(grid.rows[r][c]) : own) +
              "</td>";
    }
  }
  return html + "</tr>\n</table></div>\n";
}

std::string LeadText(const EvaluationFigures& f) {
  const EvaluationSummary& s = f.summary;
  std::string text =
      std::to_string(s.detected) + " of " + std::to_string(s.faulty_runs) +
      " faults detected; the final set has the fault in " +
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

// A row for every group of the runs' truths, then one for all of them.
std::string FiguresTable(const std::vector<FaultGroup>& groups,
                         const std::vector<EvaluatedRun>& runs, bool by_group) {
  std::set<FaultGroup> truths;
  for (const EvaluatedRun& run : runs) {
    if (run.has_truth && run.indices.fault != 0) {
      truths.insert(GroupOf(run.indices.fault,
                            by_group ? groups : std::vector<FaultGroup>{}));
    }
  }
  Grid grid{{{by_group ? "group" : "fault"},
             {"runs"},
             {"detected"},
             {"contained"},
             {"exact"},
             {"mean d_acc"},
             {"max r_fd"}},
            {}};
  const auto add = [&](const std::string& name, const EvaluationFigures& f) {
    const EvaluationSummary& s = f.summary;
    grid.rows.push_back(
        {name, std::to_string(s.faulty_runs), std::to_string(s.detected),
         std::to_string(by_group ? f.contained_group : s.contained),
         std::to_string(by_group ? f.exact_group : s.exact),
         IndexText(by_group ? f.mean_d_acc_group : s.mean_d_acc, 3),
         IndexText(s.max_r_fd, 4)});
  };
  for (const FaultGroup& group : truths) {
    add(SetText(group), FiguresOf(RunsOf(group, runs), groups));
  }
  add("all", FiguresOf(runs, groups));
  return Table(grid);
}

std::string RunAnchor(std::size_t index) {
  return "run-" + std::to_string(index + 1);
}

// Each run is linked to its picture.
std::string IndicesTable(const std::vector<EvaluatedRun>& runs) {
  return Table(RunsGrid(runs), [&runs](std::size_t r, std::size_t c) {
    return c > 0 ? ""
                 : "><a href=\"#" + RunAnchor(r) + "\">" +
                       HtmlText(runs[r].indices.run_id) + "</a>";
  });
}

// Blue for what is right, orange for what is not, by its share of the row.
std::string ConfusionTable(const ConfusionMatrix& matrix) {
  const auto shade = [&matrix](std::size_t r, std::size_t c) -> std::string {
    if (c == 0) {
      return "";
    }
    const std::vector<double>& counts = matrix.counts[r];
    const std::size_t outcome = c - 1;
    if (counts[outcome] == 0.0) {
      return " class=\"none\">.";
    }
    // Right is the true fault or, of normal operation, no alarm.
    const bool right =
        outcome < matrix.columns.size()
            ? matrix.columns[outcome] == matrix.rows[r]
            : c == counts.size() && matrix.rows[r] == FaultGroup{0};
    const double sum = std::accumulate(counts.begin(), counts.end(), 0.0);
    char style[64];
    std::snprintf(style, sizeof style, " style=\"background:rgba(%s,%.2f)\">",
                  right ? "0,114,178" : "230,159,0",
                  0.1 + 0.5 * counts[outcome] / sum);
    return style + CountText(counts[outcome]);
  };
  return Table(ConfusionGrid(matrix, "truth \\ outcome"), shade);
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

std::string BandKey() {
  std::string text = "<p class=\"note\">Isolated set:";
  for (const BandColour& band : {kRight, kPartly, kWrong, kOpen}) {
    text +=
        "<span class=\"key\" style=\"background:" + std::string(band.colour) +
        "\"></span>" + band.meaning;
  }
  return text +
         ".<br>A dashed line marks the start of the fault. Where values are "
         "closer than pixels, the smallest and the largest are drawn.</p>\n";
}

// An SVG document of gnuplot as an element of the page, at a third of its size.
// Its definitions are those of point shapes, which no picture has, and their
// ids would occur once per picture. gnuplot opens a group for each change of
// its pen, so that most groups are empty, and writes attributes that are the
// defaults of SVG or that the style of the page gives.
std::string Embedded(const std::string& svg) {
  std::vector<std::string> kept;
  std::istringstream lines(svg.substr(svg.find("<svg")));
  bool defines = false;
  for (std::string line; std::getline(lines, line);) {
    line.erase(0, line.find_first_not_of(" \t"));
    defines = defines || line == "<defs>";
    if (line == "</g>" && kept.back().starts_with("<g fill=")) {
      kept.pop_back();
    } else if (!defines && !line.empty() && !line.starts_with("xmlns:xlink")) {
      kept.push_back(line);
    }
    defines = defines && line != "</defs>";
  }
  std::string text;
  for (const std::string& line : kept) {
    text += line + '\n';
  }
  for (const std::string_view needless :
       {" stroke-linecap=\"butt\" stroke-linejoin=\"miter\"",
        " class=\"gridline\"",
        " font-family=\"DejaVu Sans,Verdana,sans-serif\""}) {
    for (std::size_t at = text.find(needless); at != std::string::npos;
         at = text.find(needless, at)) {
      text.erase(at, needless.size());
    }
  }
  return text;
}

}  // namespace

// What the engine said in the course of one run, on one time axis.
class ReportPage::RunPicture {
 public:
  RunPicture(const ModelSet& models, double duration_s)
      : models_(models),
        duration_s_(duration_s),
        residuals_(models.channels.size()),
        fault_factors_(models.faults.size()),
        peaks_(models.faults.size(), 0.0) {}

  void Add(const Verdict& verdict) {
    if (OutOfOrder(verdict.intake)) {
      return;
    }
    // That of the indications, of which rejected samples have one, too.
    first_stamp_ns_ = first_stamp_ns_.value_or(verdict.stamp_ns);
    if (verdict.intake != Intake::kAccepted) {
      return;
    }
    time_s_.push_back(static_cast<double>(verdict.stamp_ns - *first_stamp_ns_) *
                      1e-9);
    settling_.push_back(verdict.quality == Quality::kSettling);
    for (std::size_t c = 0; c < residuals_.size(); ++c) {
      residuals_[c].push_back(verdict.residuals[c]);
    }
    normal_factor_.push_back(verdict.normal_factor);
    for (std::size_t f = 0; f < fault_factors_.size(); ++f) {
      fault_factors_[f].push_back(verdict.fault_factors[f]);
      if (verdict.detected) {
        peaks_[f] = std::max(peaks_[f], verdict.fault_factors[f]);
      }
    }
  }

  std::string Draw(const EvaluatedRun& run,
                   const std::vector<Indication>& indications) {
    plot::Figure figure;
    figure.title = "Traces of run " + run.indices.run_id;
    figure.x_label = "time from the start";
    figure.is_time = true;
    figure.gap = 1.5 * models_.sample_period_s;
    figure.x = time_s_;
    figure.x_range = plot::Range{0.0, duration_s_};
    figure.width = kPictureWidth;
    figure.legend_width = kLegendWidth;
    for (std::size_t c = 0; c < residuals_.size(); ++c) {
      figure.panels.push_back(ResidualPanel(c));
    }
    double fault_start_s = -1.0;
    std::vector<plot::Band> isolated;
    plot::Panel strength{"strength [-]"};
    plot::Series& series = strength.series.emplace_back();
    series.title = TruthText(run);
    for (const Indication& indication : indications) {
      series.x.push_back(indication.time_s);
      series.y.push_back(indication.truth.strength);
      if (indication.truth.fault != 0 && fault_start_s < 0.0) {
        fault_start_s = indication.time_s;
      }
    }
    for (const Outcomes& band : OutcomesOf(indications)) {
      const BandColour colour = ColourOf(band, run, fault_start_s);
      isolated.push_back(
          {band.from_s, band.to_s,
           band.faults.empty() ? "unknown" : SetText(band.faults),
           colour.colour});
    }
    figure.panels.push_back(FactorPanel(run, isolated));
    figure.panels.push_back(
        {.label = "isolated", .bands = std::move(isolated), .height = 26.0});
    if (fault_start_s >= 0.0) {
      strength.notes = {"from " + FormatNumber(fault_start_s, 0) + " s"};
      strength.height = 90.0;
      figure.panels.push_back(std::move(strength));
      figure.marks.push_back(
          {fault_start_s, TruthText(run), plot::ink::kBlack});
    }
    std::string svg;
    for (figure.groups = kMaxGroups; figure.groups >= kMinGroups;
         figure.groups = figure.groups * 3 / 4) {
      svg = Embedded(plot::DrawFigure(figure, plot::Format::kSvg));
      if (svg.size() <= kPictureBytes) {
        break;
      }
    }
    return svg;
  }

 private:
  // A time in which the outcome did not change.
  struct Outcomes {
    double from_s{0.0};
    double to_s{0.0};
    std::vector<int> faults;  // Empty: detected, no fault named.
  };

  // An outcome that held for less than a pixel is drawn as part of the one
  // before; a set is never lost to "none named".
  std::vector<Outcomes> OutcomesOf(
      const std::vector<Indication>& indications) const {
    const double pixel_s = duration_s_ / (kPictureWidth - kLegendWidth);
    std::vector<Outcomes> all;
    for (const Indication& indication : indications) {
      if (!indication.detected && indication.isolated.empty()) {
        continue;
      }
      const double to_s = indication.time_s + models_.sample_period_s;
      const bool adjoins =
          !all.empty() && std::abs(all.back().to_s - indication.time_s) <
                              0.5 * models_.sample_period_s;
      if (!adjoins || (all.back().faults != indication.isolated &&
                       all.back().to_s - all.back().from_s >= pixel_s)) {
        all.push_back({indication.time_s, to_s, indication.isolated});
        continue;
      }
      all.back().to_s = to_s;
      if (all.back().faults.empty()) {
        all.back().faults = indication.isolated;
      }
    }
    return all;
  }

  static BandColour ColourOf(const Outcomes& band, const EvaluatedRun& run,
                             double fault_start_s) {
    const int fault = run.indices.fault;
    if (band.faults.empty()) {
      return kOpen;
    }
    const bool acts = fault != 0 && band.to_s > fault_start_s;
    const bool has_fault = Contains(band.faults, fault);
    if (!run.has_truth || (acts && band.faults.size() > 1 && has_fault)) {
      return kPartly;
    }
    return acts && has_fault ? kRight : kWrong;
  }

  // The scale holds the thresholds and the residuals outside SETTLING, which
  // may be far beyond both.
  plot::Panel ResidualPanel(std::size_t c) const {
    const ChannelSpec& channel = models_.channels[c];
    double low = channel.lower_threshold;
    double high = channel.upper_threshold;
    for (std::size_t k = 0; k < time_s_.size(); ++k) {
      if (!settling_[k] && std::isfinite(residuals_[c][k])) {
        low = std::min(low, residuals_[c][k]);
        high = std::max(high, residuals_[c][k]);
      }
    }
    const double margin = 0.06 * (high - low);
    return {.label = "r " + channel.name + " [" +
                     UnitOf(channel.output, models_.flow_unit) + "]",
            .series = {{.title = "residual", .y = residuals_[c]}},
            .limits = {{channel.upper_threshold, "thresholds"},
                       {channel.lower_threshold, ""}},
            .range = plot::Range{low - margin, high + margin},
            .height = 110.0};
  }

  // The true fault first, then those of an isolated set, then those of which
  // the factor reached T in an episode.
  std::vector<std::size_t> FaultsThatMattered(
      int truth, const std::vector<plot::Band>& isolated) const {
    const auto rank = [&](std::size_t f) {
      const std::string name = FaultName(models_.faults[f]);
      const bool named =
          std::any_of(isolated.begin(), isolated.end(), [&](const auto& band) {
            return ('|' + band.text + '|').find('|' + name + '|') !=
                   std::string::npos;
          });
      return models_.faults[f] == truth                          ? 0
             : named                                             ? 1
             : peaks_[f] >= models_.decision.isolation_threshold ? 2
                                                                 : 3;
    };
    std::vector<std::size_t> chosen;
    for (int wanted = 0; wanted < 3; ++wanted) {
      for (std::size_t f = 0; f < models_.faults.size(); ++f) {
        if (rank(f) == wanted) {
          chosen.push_back(f);
        }
      }
    }
    return chosen;
  }

  plot::Panel FactorPanel(const EvaluatedRun& run,
                          const std::vector<plot::Band>& isolated) const {
    const double threshold = models_.decision.isolation_threshold;
    plot::Panel panel{
        .label = "decision factors d [-]",
        .series = {{.title = "d_0 normal", .y = normal_factor_}},
        .limits = {{threshold, "T = " + FormatNumber(threshold, 2)}},
        .range = plot::Range{-0.03, 1.03}};
    for (const std::size_t f :
         FaultsThatMattered(run.indices.fault, isolated)) {
      const int fault = models_.faults[f];
      const bool is_truth = fault == run.indices.fault;
      panel.series.push_back(
          {.title = "d_" + FaultName(fault) + (is_truth ? " (the fault)" : ""),
           .colour = plot::SeriesColour(panel.series.size() - 1),
           .width = is_truth ? 3.0 : 1.5,
           .y = fault_factors_[f]});
    }
    panel.height =
        std::max(150.0, 20.0 * static_cast<double>(panel.series.size() + 1));
    return panel;
  }

  const ModelSet& models_;
  double duration_s_;
  std::optional<std::int64_t> first_stamp_ns_;  // t = 0
  std::vector<double> time_s_;  // Of the accepted samples, as all that follow.
  std::vector<bool> settling_;
  std::vector<std::vector<double>> residuals_;  // By channel [its unit].
  std::vector<double> normal_factor_;
  std::vector<std::vector<double>> fault_factors_;  // By fault index.
  std::vector<double> peaks_;  // Of the factors while an episode was open.
};

ReportPage::ReportPage(const ModelSet& models, std::size_t runs)
    : models_(models),
      draws_(plot::HaveGnuplot()),
      open_(runs),
      pictures_(runs) {}

ReportPage::~ReportPage() = default;

VerdictSink ReportPage::Watch(const ScoredRun& run) {
  if (!draws_) {
    return [](const Sample&, const Verdict&) {};
  }
  auto& picture = open_.at(run.position);
  picture = std::make_unique<RunPicture>(models_, DurationOf(run.run));
  return [&picture](const Sample&, const Verdict& verdict) {
    picture->Add(verdict);
  };
}

void ReportPage::Draw(const ScoredRun& run, const EvaluatedRun& result,
                      const std::vector<Indication>& indications) {
  if (draws_) {
    auto& picture = open_.at(run.position);
    pictures_.at(run.position) = picture->Draw(result, indications);
    picture.reset();
  }
}

std::string ReportPage::Html(const std::vector<EvaluatedRun>& runs,
                             const std::string& software,
                             const std::string& command_line) const {
  const std::string set =
      HtmlText(models_.name + "@" + std::to_string(models_.version));
  std::string sections;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    sections += "<h3 id=\"" + RunAnchor(r) + "\">" +
                HtmlText(RunTitle(runs[r])) + "</h3>\n<div class=\"scroll\">" +
                pictures_.at(r) + "</div>\n";
  }
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta "
         "charset=\"utf-8\">\n<meta name=\"viewport\" "
         "content=\"width=device-width\">\n<meta name=\"color-scheme\" "
         "content=\"light dark\">\n<title>Evaluation of " +
         set + "</title>\n<style>" + std::string(kPageStyle) +
         "</style>\n</head>\n<body>\n<h1>Evaluation of " + set +
         "</h1>\n<p class=\"lead\">" +
         HtmlText(LeadText(FiguresOf(runs, models_.groups))) +
         "</p>\n<p class=\"note\">Model set " + set + ", hash " +
         storage::HashHex(models_.content_hash) +
         "; not told apart: " + GroupsText(models_) +
         "; undetectable: " + FaultsText(models_.undetectable) +
         ".<br>Scored by " + HtmlText(software) + ": <code>" +
         HtmlText(command_line) + "</code></p>\n<h2>By fault</h2>\n" +
         FiguresTable(models_.groups, runs, false) +
         "<h2>By group of faults not told apart</h2>\n" +
         FiguresTable(models_.groups, runs, true) +
         "<h2>Indices of every run</h2>\n<p class=\"note\">Times are in s from "
         "the start of the fault; - where an index has no meaning.</p>\n" +
         IndicesTable(runs) +
         "<h2>Confusion by fault</h2>\n<p class=\"note\">Rows: the truth; "
         "columns: how the run ended. A set of n faults counts 1/n for "
         "each.</p>\n" +
         ConfusionTable(BuildConfusion(runs)) +
         "<h2>Confusion by group</h2>\n" +
         ConfusionTable(BuildConfusion(runs, models_.groups)) +
         "<h2>Traces</h2>\n" +
         (draws_ ? BandKey()
                 : "<p class=\"note\">There are no pictures, because gnuplot "
                   "was not found.</p>\n") +
         sections + "</body>\n</html>\n";
}

}  // namespace fdi::trainer
