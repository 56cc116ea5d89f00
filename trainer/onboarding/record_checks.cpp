#include "trainer/onboarding/record_checks.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "base/error.h"
#include "simulator/valve_equations.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kMaxShare = 1.5;      // of CV or X: per cent goes to 100
constexpr double kMinPressure = 50.0;  // water boils below at 81 degC [kPa]
constexpr double kBoilingShare = 0.8;  // of the vapour pressure
constexpr double kMinVariation = 1.0;  // of CV, X [% rms]; 2 % of the flow
constexpr double kAgainst = 0.3;       // correlation of the wrong sign
constexpr double kWorse = 1.05;        // times the error of the naive model
constexpr double kAtBound = 1e-3;      // relative

std::string Text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

struct Readings {
  Signal signal;
  std::vector<double> values;
  double middle{0.0};
  double low{0.0};
  double high{0.0};
  double deviation{0.0};

  bool measured() const { return !values.empty(); }
  std::string Seen() const {
    return std::string(SignalName(signal)) + " is " + Text(low) + " to " +
           Text(high) + " " + std::string(SignalUnit(signal)) + ", " +
           Text(middle) + " in the middle";
  }
};

Readings ReadingsOf(const std::vector<TrainingRun>& runs, Signal signal) {
  Readings readings{signal, {}};
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      if (labelled.sample.Has(signal)) {
        readings.values.push_back(labelled.sample[signal]);
      }
    }
  }
  if (!readings.measured()) {
    return readings;
  }
  std::vector<double> sorted = readings.values;
  std::sort(sorted.begin(), sorted.end());
  readings.low = sorted.front();
  readings.high = sorted.back();
  readings.middle = SortedQuantile(sorted, 0.5);
  readings.deviation = std::sqrt(Variance(readings.values));
  return readings;
}

void CheckShare(const Readings& r) {
  if (r.measured() && r.high <= kMaxShare && r.low >= -kMaxShare) {
    throw DataError(r.Seen() +
                    ": expected per cent of closing, 0 to 100; if "
                    "it counts in shares of 1, map it with scale = 100");
  }
}

void CheckPressures(const Readings& p1, const Readings& p2, const Readings& t1,
                    const simulator::Medium& medium) {
  const double vapour =
      t1.measured() ? 1e-3 * simulator::VapourPressure(medium, t1.middle) : 0.0;
  if (p1.measured() &&
      p1.middle < std::max(kMinPressure, kBoilingShare * vapour)) {
    throw DataError(
        p1.Seen() +
        (vapour > 0.0 ? ", and " + t1.Seen() +
                            ": the liquid boils there below " + Text(vapour) +
                            " kPa (for a gas or steam, give a --type of that "
                            "medium)"
                      : std::string()) +
        "; expected kPa absolute and degC. Map bar with scale = 100, MPa with "
        "scale = 1000, gauge pressure with offset = 101.3, K with offset = "
        "-273.15");
  }
  if (p1.measured() && p2.measured() && p1.middle < p2.middle) {
    throw DataError(p1.Seen() + ", " + p2.Seen() +
                    ": expected P1 before the valve above P2 behind it; are "
                    "the two exchanged, or in different units?");
  }
}

double Correlation(const Readings& a, const Readings& b) {
  double sum = 0.0;
  const double mean_a = Mean(a.values);
  const double mean_b = Mean(b.values);
  for (std::size_t k = 0; k < a.values.size(); ++k) {
    sum += (a.values[k] - mean_a) * (b.values[k] - mean_b);
  }
  return sum /
         (static_cast<double>(a.values.size()) * a.deviation * b.deviation);
}

void CheckSense(const Readings& cv, const Readings& x, const Readings& f) {
  if (std::min(cv.deviation, x.deviation) < kMinVariation) {
    return;
  }
  const double follows = Correlation(cv, x);
  if (follows < -kAgainst) {
    throw DataError("X moves against CV (correlation " + Text(follows) +
                    "): both must count in % of closing; map the one that "
                    "counts opening with sense = \"opening\"");
  }
  if (f.values.size() != x.values.size() ||
      f.deviation < 0.01 * kMinVariation * std::abs(f.high)) {
    return;
  }
  const double rises = Correlation(x, f);
  if (rises > kAgainst) {
    throw DataError("F rises while X closes (correlation " + Text(rises) +
                    "): CV and X must count in % of closing; if they count "
                    "opening, map both with sense = \"opening\"");
  }
}

// Records that no unit makes right: not of a control valve, or not measured.
void CheckKind(const std::vector<TrainingRun>& runs, const Readings& cv,
               const Readings& x) {
  if (!x.measured()) {
    throw DataError(
        "there is no position (X), which onboarding needs to tell the rod from "
        "the trim: map the position transmitter as [signal.X]");
  }
  const auto at_end = [](double value) { return value < 2.0 || value > 98.0; };
  const auto ends = std::ranges::count_if(cv.values, at_end);
  if (50 * ends > 49 * std::ssize(cv.values) && cv.low < 2.0 &&
      cv.high > 98.0) {
    throw DataError(
        "CV is 0 or 100 % throughout: this is an open/shut valve, and the "
        "models are for control valves. If CV is a limit switch, map the "
        "command of the positioner as [signal.CV]");
  }
  std::size_t same = 0;
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      const Sample& s = labelled.sample;
      same += s.Has(Signal::kCv) && s.Has(Signal::kX) &&
                      s[Signal::kCv] == s[Signal::kX]
                  ? 1U
                  : 0U;
    }
  }
  if (cv.deviation > kMinVariation && 100 * same > 99 * x.values.size()) {
    throw DataError(
        "X is a copy of CV: it was not measured, and no fault shows in it. Map "
        "the position transmitter as [signal.X]");
  }
}

// What explains a flow that is not simulated: the flow meter of the type ends
// before the readings do. Else empty.
std::string BeyondMeter(const std::vector<TrainingRun>& runs, const Readings& f,
                        double meter_end) {
  const auto beyond = std::ranges::count_if(
      f.values, [&](double value) { return value > meter_end; });
  if (20 * beyond <= std::ssize(f.values)) {
    return {};
  }
  const std::string unit(
      FlowUnitName(runs.front().samples.front().sample.flow_unit));
  return "F goes up to " + Text(f.high) + ' ' + unit +
         ", and the flow meter of the valve's type ends at " + Text(meter_end) +
         ' ' + unit +
         ": state the range of this one as flow = { low = 0, high = ... } "
         "under [instruments] of --type FILE.toml. With the present range, ";
}

}  // namespace

void CheckRecords(const std::vector<TrainingRun>& runs,
                  const simulator::Medium& medium) {
  const Readings cv = ReadingsOf(runs, Signal::kCv);
  const Readings x = ReadingsOf(runs, Signal::kX);
  CheckShare(cv);
  CheckShare(x);
  CheckKind(runs, cv, x);
  CheckPressures(ReadingsOf(runs, Signal::kP1), ReadingsOf(runs, Signal::kP2),
                 ReadingsOf(runs, Signal::kT1), medium);
  CheckSense(cv, x, ReadingsOf(runs, Signal::kF));
}

void CheckFit(const std::vector<TrainingRun>& runs,
              const simulator::RecordFit& simulation,
              const std::vector<simulator::FittedParameter>& parameters,
              double meter_end) {
  const Readings f = ReadingsOf(runs, Signal::kF);
  const auto refuse = [&](const char* what, double error, double naive,
                          const char* model, const char* unit) {
    throw DataError(BeyondMeter(runs, f, meter_end) +
                    "the simulated valve follows the record worse than " +
                    std::string(model) + " does: " + what + " RMSE " +
                    Text(error) + " instead of " + Text(naive) + unit +
                    ". Check units and sense of all columns, and that the "
                    "record is of a healthy valve in AUTO; for a valve of "
                    "another kind or size give its parameters, --type "
                    "FILE.toml");
  };
  const Readings cv = ReadingsOf(runs, Signal::kCv);
  const Readings x = ReadingsOf(runs, Signal::kX);
  double squares = 0.0;
  for (std::size_t k = 0; k < x.values.size(); ++k) {
    squares += (x.values[k] - cv.values[k]) * (x.values[k] - cv.values[k]);
  }
  const double naive =
      std::sqrt(squares / static_cast<double>(x.values.size()));
  if (simulation.x_rmse_pct > std::max(kWorse * naive, kMinVariation)) {
    refuse("X", simulation.x_rmse_pct, naive, "X = CV", " %");
  }
  if (f.measured() &&
      simulation.flow_rmse >
          std::max(kWorse * f.deviation, 0.02 * kMinVariation * f.high)) {
    refuse("F", simulation.flow_rmse, f.deviation, "the mean of F", "");
  }
  for (const simulator::FittedParameter& p : parameters) {
    const bool low = p.value <= (1.0 + kAtBound) * p.lower;
    // A record does not tell how much shorter than a sample a lag is.
    const bool harmless = low && p.name == "positioner.filter_time_s";
    if (p.identified && !harmless &&
        (low || p.value >= (1.0 - kAtBound) * p.upper)) {
      throw DataError(
          p.name + " fits best at " + Text(p.value) + ", the " +
          (low ? "lower" : "upper") + " bound of its search (" + Text(p.lower) +
          " to " + Text(p.upper) + " about " + Text(p.nominal) +
          "): check the units of all columns; for a valve "
          "of another kind or size give its parameters, --type FILE.toml");
    }
  }
}

}  // namespace fdi::trainer
