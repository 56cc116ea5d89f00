#include "report/plot/loop_figure.h"

#include <algorithm>
#include <cstdio>

namespace fdi::plot {
namespace {

// The range of `values` with some room on both sides.
Range RoomyRange(const std::vector<double>& values) {
  const auto [low, high] = std::ranges::minmax_element(values);
  const double room = std::max(0.05 * (*high - *low), 1e-3);
  return {*low - room, *high + room};
}

// Two lines, which the legend has room for.
std::vector<std::string> BandTexts(const loop::Band& found) {
  char band[48];
  char range[64];
  std::snprintf(band, sizeof band, "band %.2f %%", found.width);
  std::snprintf(range, sizeof range, "(%.2f to %.2f %%)", found.low,
                found.high);
  return {band, range};
}

Panel AnswerOverOp(const loop::Window& window, const loop::Audit& audit) {
  const bool by_x = !window.x.empty();
  const std::vector<double>& answer = by_x ? window.x : window.pv;
  Panel panel;
  panel.label = by_x ? "position X [%]" : "PV";
  panel.height = 420.0;
  panel.own_axis = RoomyRange(window.op);
  panel.own_label = "OP [%]";
  panel.series.push_back({"samples", ink::kGrey, 1.0, Dash::kSolid, answer,
                          window.op, Shape::kPoints});
  const auto& fit = audit.evidence.fit;
  if (fit && fit->slope != 0.0) {
    panel.range = RoomyRange(answer);
    const Range op = *panel.own_axis;
    const loop::Band band = *audit.evidence.band();
    for (const double side : {-0.5, 0.5}) {
      const auto at = [&](double u) {
        return fit->offset + fit->slope * (u + side * band.width);
      };
      panel.series.push_back({side < 0.0 ? "sides of the play" : "",
                              ink::kVermilion,
                              2.0,
                              Dash::kSolid,
                              {at(op.from), at(op.to)},
                              {op.from, op.to}});
    }
    panel.notes = BandTexts(band);
  }
  return panel;
}

}  // namespace

Figure LoopFigure(const std::string& name, const loop::Window& window,
                  const loop::Audit& audit) {
  Figure figure;
  figure.title = name + ":  " + std::string(loop::VerdictName(audit.verdict)) +
                 (audit.verdict != loop::Verdict::kStiction ? ""
                  : audit.sure                              ? " (sure)"
                                                            : " (likely)");
  figure.subtitle = std::string(audit.reason);
  figure.is_time = true;
  figure.x_label = "time from the start of the window";
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    figure.x.push_back(static_cast<double>(k) * window.period_s);
  }
  Panel op;
  op.label = "OP [%]";
  op.series.push_back({"OP", ink::kBlack, 1.5, Dash::kSolid, window.op});
  if (!window.x.empty()) {
    op.label = "OP, X [%]";
    op.series.push_back({"X", ink::kBlue, 1.5, Dash::kSolid, window.x});
  }
  Panel pv;
  pv.label = "PV";
  pv.series.push_back({"PV", ink::kBlue, 1.5, Dash::kSolid, window.pv});
  if (!window.sp.empty()) {
    pv.series.push_back({"SP",
                         ink::kVermilion,
                         1.5,
                         Dash::kDashed,
                         window.sp,
                         {},
                         Shape::kSteps});
  }
  figure.panels = {op, pv, AnswerOverOp(window, audit)};
  return figure;
}

}  // namespace fdi::plot
