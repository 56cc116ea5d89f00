#include "bench/study/report_page.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "bench/study/evaluation_report.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/plot/figure.h"
#include "report/plot/gnuplot.h"
#include "report/report.h"
#include "report/text_table.h"
#include "storage/models/model_codec.h"
#include "trainer/rule_text.h"
#include "trainer/scoring/evaluation_report.h"

namespace fdi::trainer::study {
namespace {

using report::FormatNumber;
using report::Json;

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

constexpr double kPictureWidth = 1100.0;  // [px]
constexpr double kLegendWidth = 210.0;    // [px]
// A picture may take so many bytes; a larger one is drawn again with fewer
// points, down to kMinGroups.
constexpr std::size_t kPictureBytes = 90'000;
constexpr std::size_t kMaxGroups = 720;
constexpr std::size_t kMinGroups = 80;

// The colours of isolated sets, and what they mean.
struct BandColour {
  const char* colour;
  const char* name;
  const char* meaning;
};
constexpr BandColour kRight{plot::ink::kGreen, "green", "the fault alone"};
constexpr BandColour kPartly{plot::ink::kSky, "blue",
                             "the fault and others, or truth unknown"};
constexpr BandColour kWrong{plot::ink::kVermilion, "red",
                            "without the fault, or before it"};
constexpr BandColour kOpen{plot::ink::kGrey, "grey", "detected, none named"};

constexpr const char* kAll = "all";  // The last row of figures.

// "f3|f6" with what people call it, for a truth or an outcome.
std::string WithName(const std::string& set, const report::FaultTexts& texts) {
  const bool names_faults =
      !set.empty() && set != FaultName(0) && set != "?" && set != kAll;
  return names_faults ? set + " " + texts.Words(set, 0.0).name : set;
}

std::vector<report::Column> WithNames(std::vector<report::Column> columns,
                                      const report::FaultTexts& texts) {
  for (report::Column& column : columns) {
    if (column.key != "fault" && column.key != "final_set" &&
        column.key != "name") {
      continue;
    }
    column.text = [text = column.text, &texts](const Json& row) {
      return WithName(text ? text(row) : row["name"].get<std::string>(), texts);
    };
  }
  return columns;
}

// A row for every group of the runs' truths, then one for all of them.
Json FigureRows(const std::vector<FaultGroup>& groups,
                const std::vector<EvaluatedRun>& runs, bool by_group) {
  std::set<FaultGroup> truths;
  for (const EvaluatedRun& run : runs) {
    if (run.has_truth && run.indices.fault != 0) {
      truths.insert(GroupOf(run.indices.fault,
                            by_group ? groups : std::vector<FaultGroup>{}));
    }
  }
  Json rows = Json::object();
  const auto add = [&](const std::string& name,
                       const std::vector<EvaluatedRun>& its) {
    const EvaluationFigures f = FiguresOf(its);
    const StudyFigures s = StudyFiguresOf(its, groups);
    rows[name] = {{"runs", f.faulty_runs},
                  {"detected", f.detected},
                  {"contained", by_group ? s.contained_group : f.contained},
                  {"exact", by_group ? s.exact_group : f.exact},
                  {"mean_d_acc", by_group ? s.mean_d_acc_group : s.mean_d_acc},
                  {"max_r_fd", s.max_r_fd}};
  };
  for (const FaultGroup& group : truths) {
    add(SetText(group), RunsOf(group, runs));
  }
  add(kAll, runs);
  return rows;
}

std::vector<report::Column> FigureColumns(const char* heading,
                                          const report::FaultTexts& texts) {
  return WithNames(
      {{.heading = heading, .key = "name"},
       {.heading = "runs", .key = "runs"},
       {.heading = "detected",
        .key = "detected",
        .meaning = "runs in alarm at the end of the fault"},
       {.heading = "contained",
        .key = "contained",
        .meaning = "runs whose final set has the fault, or one of its group"},
       {.heading = "exact",
        .key = "exact",
        .meaning = "runs whose final set has nothing else"},
       IndexColumn("mean d_acc", "mean_d_acc", 3,
                   "mean accuracy of the final set over the detected runs"),
       IndexColumn("max r_fd", "max_r_fd", 4,
                   "largest share of the time before the fault with an alarm")},
      texts);
}

std::string RunAnchor(std::size_t index) {
  return "run-" + std::to_string(index + 1);
}

std::string RunTitle(const EvaluatedRun& run, const report::FaultTexts& texts) {
  const RunIndices& i = run.indices;
  std::string text = i.run_id + ": ";
  text += !run.has_truth ? "truth unknown"
          : i.fault == 0 ? "no fault"
                         : WithName(TruthText(run), texts) + ", strength " +
                               FormatNumber(i.strength, 2);
  text += IsDetected(run) ? "; detected" : "; not detected";
  if (i.t_dt >= 0.0) {
    text += " after " + FormatNumber(i.t_dt, 0) + " s";
  }
  const std::string set = SetText(FinalSet(run));
  return text + (set.empty() ? ", no fault named"
                             : ", final set " + WithName(set, texts));
}

// From the first to the last sample and one period more [s].
double DurationOf(const storage::StoredRun& run) {
  // A recorded run has its samples in the order of arrival.
  const auto [first, last] = std::minmax_element(
      run.samples.begin(), run.samples.end(),
      [](const storage::StoredSample& a, const storage::StoredSample& b) {
        return a.sample.stamp_ns < b.sample.stamp_ns;
      });
  return static_cast<double>(last->sample.stamp_ns - first->sample.stamp_ns) *
             1e-9 +
         run.info.run.period_s;
}

std::string BandKey() {
  std::string text = "Colours of the isolated set:";
  for (const BandColour& band : {kRight, kPartly, kWrong, kOpen}) {
    text += std::string(text.back() == ':' ? " " : "; ") + band.name + ": " +
            band.meaning;
  }
  return text +
         ".\nA dashed line marks the start of the fault. Where values are "
         "closer than pixels, the smallest and the largest are drawn.";
}

}  // namespace

const char* SeriesColour(std::size_t index) {
  static constexpr std::array kColours{
      plot::ink::kVermilion, plot::ink::kBlue, plot::ink::kGreen,
      plot::ink::kOrange,    plot::ink::kSky,  plot::ink::kPurple};
  return kColours[index % kColours.size()];
}

// Collects the verdicts on one run and draws them on one time axis.
class ReportPage::RunPicture {
 public:
  RunPicture(const ModelSet& models, double duration_s)
      : models_(models),
        duration_s_(duration_s),
        signals_(kShown.size()),
        residuals_(models.channels.size()),
        fault_factors_(models.faults.size()),
        peaks_(models.faults.size(), 0.0) {}

  void Add(const Sample& sample, const Verdict& verdict) {
    if (OutOfOrder(verdict.intake)) {
      return;
    }
    // Time counts from the first indication, as that of the indications does:
    // rejected samples have one, too.
    first_stamp_ns_ = first_stamp_ns_.value_or(verdict.stamp_ns);
    if (verdict.intake != Intake::kAccepted) {
      return;
    }
    time_s_.push_back(static_cast<double>(verdict.stamp_ns - *first_stamp_ns_) *
                      1e-9);
    settling_.push_back(verdict.quality == Quality::kSettling);
    for (std::size_t i = 0; i < kShown.size(); ++i) {
      signals_[i].push_back(sample.Has(kShown[i]) ? sample[kShown[i]]
                                                  : plot::kMissing);
    }
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
    figure.panels = MeasuredPanels();
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
    // A page has a picture of every run: it is drawn more coarsely until it is
    // small enough.
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
  static constexpr std::array<Signal, 3> kShown{Signal::kCv, Signal::kX,
                                                Signal::kF};

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

  // Command and position share their axis. A signal without a reading is left
  // out.
  std::vector<plot::Panel> MeasuredPanels() const {
    std::vector<plot::Panel> panels;
    for (std::size_t i = 0; i < kShown.size(); ++i) {
      const auto is_read = [](double value) { return std::isfinite(value); };
      if (std::none_of(signals_[i].begin(), signals_[i].end(), is_read)) {
        continue;
      }
      const std::string name(SignalName(kShown[i]));
      const std::string unit =
          " [" + UnitOf(kShown[i], models_.flow_unit) + "]";
      if (kShown[i] == Signal::kF || panels.empty()) {
        panels.push_back({.label = name + unit, .height = 110.0});
      } else {
        panels.back().label = "CV, X" + unit;
      }
      panels.back().series.push_back({.title = name + " measured",
                                      .colour = SeriesColour(i),
                                      .dash = kShown[i] == Signal::kCv
                                                  ? plot::Dash::kDashed
                                                  : plot::Dash::kSolid,
                                      .y = signals_[i]});
    }
    return panels;
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
           .colour = SeriesColour(panel.series.size() - 1),
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
  std::vector<double> time_s_;  // By accepted sample, like all that follow.
  std::vector<bool> settling_;
  std::vector<std::vector<double>> signals_;    // By kShown [its unit].
  std::vector<std::vector<double>> residuals_;  // By channel [its unit].
  std::vector<double> normal_factor_;
  std::vector<std::vector<double>> fault_factors_;  // By fault index.
  std::vector<double> peaks_;  // Largest factors while an episode was open.
};

ReportPage::ReportPage(const ModelSet& models, report::FaultTexts texts,
                       std::size_t runs)
    : models_(models),
      texts_(std::move(texts)),
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
  return [&picture](const Sample& sample, const Verdict& verdict) {
    picture->Add(sample, verdict);
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

void ReportPage::Print(std::ostream& out, const Detector& detector,
                       const Scores& scores, const std::string& software,
                       const std::string& command_line) const {
  const std::string set = models_.name + "@" + std::to_string(models_.version);
  const std::vector<EvaluatedRun>& runs = scores.runs;
  report::Report page;
  page.document = EvaluationReport(detector, scores).document;
  Json& document = page.document;
  document["by_fault"] = FigureRows(models_.groups, runs, false);
  document["by_group"] = FigureRows(models_.groups, runs, true);
  std::size_t number = 0;
  for (Json& run : document["runs"]) {
    run["picture"] = RunAnchor(number++);
  }
  std::vector<report::Column> indices = WithNames(IndexColumns(), texts_);
  indices.front().picture = [](const Json& run) {
    return run["picture"].get<std::string>();
  };
  const auto confusion = [&](const std::string& heading, const char* key) {
    page.Heading(heading).Table(
        std::string("summary/") + key,
        WithNames(ConfusionColumns(document["summary"][key], "truth"), texts_));
  };
  page.Line("Model set " + set + ", hash " + Hex16(models_.content_hash) +
            "\nFaults not told apart: " + GroupsText(models_) +
            "\nFaults that it cannot detect: " +
            FaultsText(models_.undetectable) + "\nScored by " + software +
            ": " + command_line)
      .Fields("summary", SummaryFields());
  page.Heading("By fault").Table("by_fault", FigureColumns("fault", texts_));
  page.Heading("By group of faults not told apart")
      .Table("by_group", FigureColumns("group", texts_));
  page.Heading("Indices of every run")
      .Line(
          "Times count from the start of the fault; - where an index has no "
          "meaning.")
      .Table("runs", std::move(indices));
  confusion("Confusion by fault", "confusion");
  page.Line(
      "Rows: the truth. Columns: what the run ended with. A set of n faults "
      "counts 1/n for each.");
  confusion("Confusion by group", "confusion_by_group");
  page.Heading("Traces").Line(
      draws_ ? BandKey()
             : "There are no pictures, because gnuplot was not found.");
  for (std::size_t r = 0; r < runs.size(); ++r) {
    page.Picture(RunAnchor(r), RunTitle(runs[r], texts_), pictures_.at(r));
  }
  page.PrintHtml(out, "Evaluation of " + set);
}

}  // namespace fdi::trainer::study
