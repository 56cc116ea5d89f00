#include "report/plot/run_figure.h"

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <map>

#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"

namespace fdi::plot {
namespace {

using storage::StoredRun;
using storage::StoredSample;

std::vector<double> Readings(const std::vector<StoredSample>& samples,
                             Signal signal) {
  std::vector<double> values;
  values.reserve(samples.size());
  std::transform(samples.begin(), samples.end(), std::back_inserter(values),
                 [signal](const StoredSample& stored) {
                   return stored.sample.Has(signal) ? stored.sample[signal]
                                                    : kMissing;
                 });
  return values;
}

struct SignalInk {
  Signal signal;
  const char* colour;
  Dash dash;
  double width{1.5};
};

Panel PanelOf(const std::vector<StoredSample>& samples,
              const std::string& label, const std::vector<SignalInk>& signals) {
  Panel panel;
  panel.label = label;
  for (const SignalInk& line : signals) {
    panel.series.push_back({std::string(SignalName(line.signal)), line.colour,
                            line.width, line.dash,
                            Readings(samples, line.signal)});
  }
  return panel;
}

std::vector<Panel> Panels(const StoredRun& run,
                          const std::vector<StoredSample>& samples) {
  const std::string flow(FlowUnitName(run.info.run.flow_unit));
  const bool has_pv = (run.info.signals & MaskOf(Signal::kPv)) != 0;
  return {PanelOf(samples, "closing [%]",
                  {{Signal::kCv, ink::kGrey, Dash::kSolid, 3.0},
                   {Signal::kX, ink::kBlack, Dash::kSolid}}),
          PanelOf(samples, "flow F [" + flow + "]",
                  {{Signal::kF, ink::kBlack, Dash::kSolid}}),
          PanelOf(samples, "pressures [kPa]",
                  {{Signal::kP1, ink::kBlack, Dash::kSolid},
                   {Signal::kP2, ink::kBlue, Dash::kDashed},
                   {Signal::kPs, ink::kGreen, Dash::kDashDot},
                   {Signal::kPz, ink::kVermilion, Dash::kDotted}}),
          PanelOf(samples, "temperature T1 [degC]",
                  {{Signal::kT1, ink::kBlack, Dash::kSolid}}),
          has_pv ? PanelOf(samples, "PV, SP [unit of PV]",
                           {{Signal::kPv, ink::kBlack, Dash::kSolid},
                            {Signal::kSp, ink::kBlue, Dash::kDashed}})
                 : PanelOf(samples, "set point SP [%]",
                           {{Signal::kSp, ink::kBlack, Dash::kSolid}}),
          PanelOf(samples, "positioner CVI [-]",
                  {{Signal::kCvi, ink::kBlack, Dash::kSolid}})};
}

std::string TruthText(const FaultTruth& truth) {
  char text[32];
  std::snprintf(text, sizeof text, " %.2f", truth.strength);
  return FaultName(truth.fault) + text;
}

double TimeOf(const StoredRun& run, const StoredSample& stored) {
  return static_cast<double>(stored.sample.stamp_ns - run.info.run.start_ns) *
         1e-9;
}

// Intervals with one fault; for a growing fault, the strength that it reached.
std::vector<Band> TruthBands(const StoredRun& run,
                             const std::vector<StoredSample>& samples) {
  std::vector<Band> bands;
  int fault = 0;
  for (const StoredSample& stored : samples) {
    const int now = stored.truth ? stored.truth->fault : 0;
    const double t_s = TimeOf(run, stored);
    if (now != 0) {
      if (now != fault) {
        bands.push_back({t_s, t_s, "", "#fbe3c0"});
      }
      bands.back().to = t_s;
      bands.back().text = TruthText(*stored.truth);
    }
    fault = now;
  }
  return bands;
}

std::vector<Mark> Marks(const StoredRun& run,
                        const std::vector<StoredSample>& samples) {
  std::vector<Mark> marks;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].model_swapped) {
      marks.push_back({TimeOf(run, samples[i]), "model set", ink::kBlue});
    } else if (samples[i].initialised) {
      marks.push_back({TimeOf(run, samples[i]), "initialised", ink::kGrey});
    }
  }
  return marks;
}

// "3 late, 1 repeat samples are not drawn"
std::string Refused(const std::vector<StoredSample>& samples) {
  std::map<Intake, int> counts;
  for (const StoredSample& stored : samples) {
    if (stored.intake != Intake::kAccepted) {
      ++counts[stored.intake];
    }
  }
  const std::string text = JoinText(counts, ", ", [](const auto& of) {
    return std::to_string(of.second) + " " + std::string(IntakeName(of.first));
  });
  return text.empty() ? "" : "refused and not drawn: " + text + " samples";
}

}  // namespace

Figure RunFigure(const StoredRun& run) {
  std::vector<StoredSample> samples = run.samples;
  Figure figure;
  figure.footnote = Refused(samples);
  std::erase_if(samples, [](const StoredSample& stored) {
    return stored.intake != Intake::kAccepted;
  });
  std::stable_sort(samples.begin(), samples.end(),
                   [](const StoredSample& a, const StoredSample& b) {
                     return a.sample.stamp_ns < b.sample.stamp_ns;
                   });
  figure.title = run.info.run.valve_id + ":  run " + run.info.id;
  figure.is_time = true;
  figure.x_label = "time from the start of the run";
  figure.gap = 1.5 * run.info.run.period_s;
  for (const StoredSample& stored : samples) {
    figure.x.push_back(TimeOf(run, stored));
  }
  figure.panels = Panels(run, samples);
  figure.bands = TruthBands(run, samples);
  figure.marks = Marks(run, samples);
  return figure;
}

}  // namespace fdi::plot
