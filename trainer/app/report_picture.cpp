#include "trainer/app/report_picture.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/svg.h"
#include "trainer/app/evaluation_report.h"
#include "trainer/app/rule_text.h"

namespace fdi::trainer {
namespace {

using cli::SvgArea;
using cli::SvgAxis;
using cli::SvgPanel;

constexpr double kLeft = 58.0;  // px from here on
constexpr double kRight = 170.0;
constexpr double kGap = 24.0;  // between panels: the label of the lower one
constexpr double kResidualHeight = 84.0;
constexpr double kFactorHeight = 112.0;
constexpr double kLegendStep = 15.0;
constexpr double kBandHeight = 18.0;
constexpr double kStrengthHeight = 44.0;
constexpr double kFoot = 36.0;
constexpr double kLetter = 6.2;  // mean width
constexpr int kCoarsest = 6;
constexpr double kHour = 3600.0;
constexpr double kInHours = 4.0 * kHour;  // longer runs have an axis in h

class RunPainter {
 public:
  RunPainter(const ModelSet& models, const EvaluatedRun& run,
             const RunTrace& trace, int merged)
      : models_(models),
        run_(run),
        trace_(trace),
        merged_(merged),
        faults_(FaultsThatMattered(models, trace, run.indices.fault)),
        has_fault_(trace.fault_start_s >= 0.0),
        canvas_(kLeft + kTraceColumns + kRight, Height(),
                "Traces of run " + run.indices.run_id) {}

  std::string Paint() {
    for (std::size_t c = 0; c < models_.channels.size(); ++c) {
      PaintResidual(c);
    }
    PaintFactors();
    PaintBand("detected", trace_.detected);
    PaintBand("isolated", trace_.isolated);
    if (has_fault_) {
      PaintStrength();
    }
    PaintTime();
    return canvas_.Element();
  }

 private:
  double FactorHeight() const {
    const auto entries = static_cast<double>(faults_.size() + 2);
    return std::max(kFactorHeight, kLegendStep * entries);
  }
  double Height() const {
    const auto channels = static_cast<double>(models_.channels.size());
    return channels * (kResidualHeight + kGap) + FactorHeight() + kGap +
           2.0 * (kBandHeight + 6.0) +
           (has_fault_ ? kStrengthHeight + kGap : 0.0) + kFoot;
  }
  SvgArea Next(double height, double gap = kGap) {
    const SvgArea area{kLeft, top_ + gap - 6.0, kTraceColumns, height};
    top_ += height + gap;
    return area;
  }
  SvgAxis Time() const {
    const double unit = trace_.duration_s > kInHours ? kHour : 1.0;
    return {0.0, trace_.duration_s / unit, "", 12, false};
  }

  // Around residuals outside SETTLING and thresholds.
  SvgAxis ResidualAxis(std::size_t c) const {
    const ChannelSpec& channel = models_.channels[c];
    const SignalRange& live = trace_.live_residuals[c];
    const double low = std::min(live.minimum, channel.lower_threshold);
    const double high = std::max(live.maximum, channel.upper_threshold);
    const double margin = 0.06 * (high - low);
    return {low - margin, high + margin,
            "residual r = y - \xC5\xB7 of " + channel.name + " [" +
                UnitOf(channel.output, models_.flow_unit) + "]",
            4, true};
  }

  void PaintResidual(std::size_t c) {
    const SvgPanel panel(canvas_, Next(kResidualHeight), Time(),
                         ResidualAxis(c));
    const ChannelSpec& channel = models_.channels[c];
    canvas_.Path(trace_.residuals[c].PathData(panel.area(), panel.y(), merged_),
                 "s0");
    for (const double threshold :
         {channel.lower_threshold, channel.upper_threshold}) {
      const double y = panel.y()(threshold);
      canvas_.Line(kLeft, y, panel.area().right(), y, "limit");
    }
    cli::DrawLegend(canvas_, panel.area().right() + 8.0, panel.area().top + 8.0,
                    {{"s0", "residual"}, {"limit", "thresholds"}});
    canvas_.Text(panel.area().right() + 31.0, panel.area().top + 42.0,
                 cli::ShortNumber(channel.lower_threshold) + ", " +
                     cli::ShortNumber(channel.upper_threshold));
  }

  void PaintFactors() {
    const SvgArea area = Next(FactorHeight());
    const SvgPanel panel(canvas_, area, Time(),
                         {-0.03, 1.03, "decision factors d [-]", 5, true});
    const double threshold = models_.decision.isolation_threshold;
    std::vector<cli::SvgLegendEntry> legend{
        {"limit", "T = " + cli::ShortNumber(threshold)}, {"s0", "d_0 normal"}};
    canvas_.Path(trace_.normal_factor.PathData(area, panel.y(), merged_), "s0");
    std::size_t series = 1;
    std::string truth_line;
    for (const std::size_t f : faults_) {
      const int fault = models_.faults[f];
      const bool is_truth = fault == run_.indices.fault;
      // The class s1 is kept for the fault that acts.
      const std::string classes =
          is_truth ? "s1 main" : cli::SvgSeries(++series);
      legend.push_back({classes, "d_" + FaultName(fault) +
                                     (is_truth ? " (the fault)" : "")});
      const std::string line =
          trace_.fault_factors[f].PathData(area, panel.y(), merged_);
      if (is_truth) {
        truth_line = line;  // Above the others.
      } else {
        canvas_.Path(line, classes);
      }
    }
    canvas_.Path(truth_line, "s1 main");
    canvas_.Line(kLeft, panel.y()(threshold), area.right(),
                 panel.y()(threshold), "limit");
    cli::DrawLegend(canvas_, area.right() + 8.0, area.top + 8.0, legend);
  }

  // right: the fault alone; partly: it and others; wrong: without it.
  std::string BandClass(const TimeBand& band) const {
    const int fault = run_.indices.fault;
    if (band.faults.empty()) {
      return "open";
    }
    const bool acts = fault != 0 && band.to_s > trace_.fault_start_s;
    if (!run_.has_truth || (acts && band.faults.size() > 1 &&
                            std::find(band.faults.begin(), band.faults.end(),
                                      fault) != band.faults.end())) {
      return "partly";
    }
    return acts && band.faults == std::vector<int>{fault} ? "right" : "wrong";
  }

  void PaintBand(std::string_view name, const std::vector<TimeBand>& bands) {
    const SvgArea area = Next(kBandHeight, 6.0);
    const cli::SvgScale x{0.0, trace_.duration_s, area.left, area.right()};
    canvas_.Rectangle(area, "frame");
    canvas_.Text(kLeft - 5.0, area.top + 13.0, name, "end");
    for (const TimeBand& band : bands) {
      const std::string text = name == "detected"    ? ""
                               : band.faults.empty() ? "unknown"
                                                     : SetText(band.faults);
      const double width = x(band.to_s) - x(band.from_s);
      const std::string hint = text + (text.empty() ? "" : ", ") +
                               cli::ShortNumber(band.from_s) + " to " +
                               cli::ShortNumber(band.to_s) + " s";
      canvas_.Rectangle({x(band.from_s), area.top + 1.0, width, 16.0},
                        BandClass(band), hint);
      if (kLetter * static_cast<double>(text.size()) + 4.0 < width) {
        canvas_.Text(x(band.from_s) + 0.5 * width, area.top + 13.0, text,
                     "inside");
      }
    }
  }

  void PaintStrength() {
    const SvgArea area = Next(kStrengthHeight);
    const double low = std::min(0.0, trace_.strength.minimum());
    const double high = std::max(0.0, trace_.strength.maximum());
    const SvgPanel panel(
        canvas_, area, Time(),
        {1.1 * low, 1.1 * high, "strength of the fault [-]", 2, true});
    canvas_.Path(trace_.strength.PathData(area, panel.y(), merged_), "s1 wide");
    canvas_.Text(area.right() + 8.0, area.top + 14.0,
                 TruthText(run_) + " from " +
                     cli::ShortNumber(trace_.fault_start_s) + " s,");
    canvas_.Text(area.right() + 8.0, area.top + 29.0,
                 "to strength " + cli::ShortNumber(run_.indices.strength));
  }

  // Labels of the axis, and a line through all panels at the fault's start.
  void PaintTime() {
    const SvgAxis axis = Time();
    const cli::SvgScale x{axis.from, axis.to, kLeft, kLeft + kTraceColumns};
    const double bottom = top_ - 6.0;
    for (const double tick : cli::RoundTicks(axis.from, axis.to, axis.ticks)) {
      canvas_.Text(x(tick), bottom + 14.0, cli::ShortNumber(tick), "middle");
    }
    canvas_.Text(kLeft + 0.5 * kTraceColumns, bottom + 29.0,
                 trace_.duration_s > kInHours ? "time from the start [h]"
                                              : "time from the start [s]",
                 "middle");
    if (has_fault_) {
      const cli::SvgScale seconds{0.0, trace_.duration_s, kLeft,
                                  kLeft + kTraceColumns};
      const double at = seconds(trace_.fault_start_s);
      canvas_.Line(at, 18.0, at, bottom, "mark");
    }
  }

  const ModelSet& models_;
  const EvaluatedRun& run_;
  const RunTrace& trace_;
  int merged_;  // columns of a trace drawn as one
  std::vector<std::size_t> faults_;
  bool has_fault_;
  cli::SvgCanvas canvas_;
  double top_{0.0};
};

}  // namespace

std::string RunPicture(const ModelSet& models, const EvaluatedRun& run,
                       const RunTrace& trace) {
  std::string picture;
  for (int merged = 1; merged <= kCoarsest; ++merged) {
    picture = RunPainter(models, run, trace, merged).Paint();
    if (picture.size() <= kPictureBytes) {
      break;
    }
  }
  return picture;
}

}  // namespace fdi::trainer
