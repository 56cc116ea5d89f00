#include "trainer/onboarding/record_checks.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>

#include "base/error.h"
#include "base/local_sense.h"
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
constexpr double kCurve = 10.0;  // error of X that no calibration makes [%]
constexpr double kFixed = 0.25;  // times it: X is nearly a function of CV

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
    throw DataError(std::string(SignalName(r.signal)) +
                    " counts in shares of 1 and not in per cent: " + r.Seen() +
                    "; expected is per cent of closing, 0 to 100. Map it with "
                    "scale = 100");
  }
}

// The likeliest explanation of a P1 that is so low, or so low for T1.
std::string WhyLow(double p1_kpa, double t1_degc,
                   const simulator::Medium& medium) {
  constexpr double kKelvin = 273.15;
  constexpr double kHotC = 110.0;  // Few liquids, most steam.
  if (p1_kpa < kMinPressure) {
    return p1_kpa <= 0.0  ? "P1 is a gauge pressure and not absolute: "
           : p1_kpa < 3.0 ? "P1 is likely in MPa (or in bar), not in kPa: "
                          : "P1 is likely in bar (or in MPa), not in kPa: ";
  }
  if (t1_degc > kKelvin &&
      1e-3 * simulator::VapourPressure(medium, t1_degc - kKelvin) < p1_kpa) {
    return "T1 is likely in K, not in degC, or the medium is steam or a gas: ";
  }
  return t1_degc > kHotC
             ? "the medium is likely steam or a gas, which its type does not "
               "say; else P1 or T1 is in another unit: "
             : "P1 or T1 is in another unit, or P1 a gauge pressure: ";
}

void CheckPressures(const Readings& p1, const Readings& p2, const Readings& t1,
                    const simulator::Medium& medium) {
  const double vapour =
      t1.measured() ? 1e-3 * simulator::VapourPressure(medium, t1.middle) : 0.0;
  if (p1.measured() &&
      p1.middle < std::max(kMinPressure, kBoilingShare * vapour)) {
    throw DataError(
        WhyLow(p1.middle, t1.measured() ? t1.middle : 0.0, medium) + p1.Seen() +
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
    throw DataError(
        "P1 and P2 are exchanged, or in different units: " + p1.Seen() + ", " +
        p2.Seen() + "; expected is P1 before the valve above P2 behind it");
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

// The strongest correlation of `b` with what `a` was up to three samples
// before: a rod takes some seconds.
double LaggedCorrelation(Readings a, Readings b) {
  constexpr int kLags = 3;
  double strongest = Correlation(a, b);
  for (int lag = 1; lag <= kLags && a.values.size() > 1; ++lag) {
    a.values.pop_back();
    b.values.erase(b.values.begin());
    const double lagged = Correlation(a, b);
    strongest = std::abs(lagged) > std::abs(strongest) ? lagged : strongest;
  }
  return strongest;
}

// Without X: whether F falls while CV closes, and follows it at all.
void CheckFlowFollows(const Readings& cv, const Readings& f) {
  if (cv.deviation < kMinVariation || f.values.size() != cv.values.size() ||
      f.deviation <= 0.0) {
    return;
  }
  const double rises = LaggedCorrelation(cv, f);
  if (rises > kAgainst) {
    throw DataError("F rises while CV closes (correlation " + Text(rises) +
                    "): CV counts in the other sense than is stated. If it "
                    "counts opening, map it with sense = \"opening\"; if it is "
                    "mapped so, it counts closing");
  }
  if (rises > -kAgainst) {
    throw DataError(
        "F does not follow CV (correlation " + Text(rises) +
        "), and there is no position (X): nothing here shows what the valve "
        "does. Likeliest: F is not the flow through this valve, or a pressure "
        "moves it more than the valve does (map P1 and P2), or the valve is "
        "not healthy. fdi-store audit judges the loop from OP, PV and SP");
  }
}

void CheckSense(const Readings& cv, const Readings& x, const Readings& f) {
  if (!x.measured()) {
    CheckFlowFollows(cv, f);
    return;
  }
  if (std::min(cv.deviation, x.deviation) < kMinVariation) {
    return;
  }
  const double follows = Correlation(cv, x);
  if (follows < -kAgainst) {
    throw DataError("X moves against CV (correlation " + Text(follows) +
                    "): one of them counts in the other sense than is stated. "
                    "Map with sense = \"opening\" what counts opening, and "
                    "nothing else");
  }
  if (f.values.size() != x.values.size() ||
      f.deviation < 0.01 * kMinVariation * std::abs(f.high)) {
    return;
  }
  const double rises = Correlation(x, f);
  LocalSense minutes;
  for (std::size_t k = 0; k < x.values.size(); ++k) {
    minutes.Add(x.values[k], f.values[k]);
  }
  if (rises > kAgainst && minutes.Value() < 0.0) {
    throw DataError(
        "F ends while X is open, although most minutes show that it falls "
        "when X closes (correlation of all " +
        Text(rises) +
        "): likeliest a line that was shut, or a supply that was lost, and no "
        "healthy record. Leave that time out with @from:to");
  }
  if (rises > kAgainst) {
    throw DataError("F rises while X closes (correlation " + Text(rises) +
                    "): CV and X count in the other sense than is stated. If "
                    "they count opening, map both with sense = \"opening\"; if "
                    "they are mapped so, they count closing. Else the record "
                    "is not of a healthy valve: the line was shut, or the "
                    "supply lost");
  }
}

// Records that no unit makes right: not of a control valve, or not measured.
void CheckKind(const std::vector<TrainingRun>& runs, const Readings& cv,
               const Readings& x, const Readings& f) {
  if (!x.measured() && !f.measured()) {
    throw DataError(
        "there is neither a position (X) nor a flow (F), one of which "
        "onboarding needs: map the position transmitter as [signal.X] or the "
        "flow through the valve as [signal.F]. A level or a pressure shows "
        "neither; fdi-store audit judges such a loop from OP, PV and SP");
  }
  if (x.measured() && !runs.front().samples.front().sample.Has(Signal::kX)) {
    throw DataError("run " + runs.front().id +
                    " begins without a position (X), which comes later: begin "
                    "where it is measured, with @from:to");
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
  if (x.measured() && cv.deviation > kMinVariation &&
      100 * same > 99 * x.values.size()) {
    throw DataError(
        "X is a copy of CV: it was not measured, and no fault shows in it. Map "
        "the position transmitter as [signal.X]");
  }
}

// A cause beside the others, where the command moves much in a sample: what it
// was meanwhile is not in the record.
std::string SlowRecord(const std::vector<TrainingRun>& runs) {
  const double period_s = runs.front().period_s;
  return period_s < kSlowS
             ? std::string()
             : ". One sample in " + Text(period_s) +
                   " s may be too slow for a command that moves faster: export "
                   "every second, or unfiltered values";
}

// Explains a flow that is not simulated: the flow meter of the type ends
// before the readings do. Empty if it does not.
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

// How far readings of X lie from their mean at the same CV, rounded to 1 % [%].
double ScatterOfX(const std::vector<TrainingRun>& runs) {
  std::map<long, std::vector<double>> bins;
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      const Sample& sample = labelled.sample;
      if (sample.Has(Signal::kCv) && sample.Has(Signal::kX)) {
        bins[std::lround(sample[Signal::kCv])].push_back(sample[Signal::kX]);
      }
    }
  }
  double squares = 0.0;
  double count = 0.0;
  for (const auto& [cv, values] : bins) {
    const double mean = Mean(values);
    for (const double value : values) {
      squares += (value - mean) * (value - mean);
      count += 1.0;
    }
  }
  return std::sqrt(squares / std::max(count, 1.0));
}

}  // namespace

void CheckRecords(const std::vector<TrainingRun>& runs,
                  const simulator::Medium& medium) {
  const Readings cv = ReadingsOf(runs, Signal::kCv);
  const Readings x = ReadingsOf(runs, Signal::kX);
  CheckShare(cv);
  CheckShare(x);
  const Readings f = ReadingsOf(runs, Signal::kF);
  CheckKind(runs, cv, x, f);
  CheckPressures(ReadingsOf(runs, Signal::kP1), ReadingsOf(runs, Signal::kP2),
                 ReadingsOf(runs, Signal::kT1), medium);
  CheckSense(cv, x, f);
}

void CheckFit(const std::vector<TrainingRun>& runs,
              const simulator::RecordFit& simulation,
              const std::vector<simulator::FittedParameter>& parameters,
              double meter_end) {
  const Readings f = ReadingsOf(runs, Signal::kF);
  const Readings cv = ReadingsOf(runs, Signal::kCv);
  const Readings x = ReadingsOf(runs, Signal::kX);
  const auto refuse = [&](const char* what, double error, double naive,
                          const char* model, const char* unit) {
    const std::string beyond = BeyondMeter(runs, f, meter_end);
    throw DataError(
        (beyond.empty() ? std::string("the unit or sense of a column is wrong, "
                                      "or the record is not of a healthy valve "
                                      "in AUTO, or the valve is of another "
                                      "kind or size than its type: ")
                        : beyond) +
        "the simulated valve follows the record worse than " +
        std::string(model) + " does: " + what + " RMSE " + Text(error) +
        " instead of " + Text(naive) + unit +
        ". fdi-store runs sniff shows what each column was taken for; "
        "--type FILE.toml states another kind or size" +
        SlowRecord(runs));
  };
  double squares = 0.0;
  for (std::size_t k = 0; k < x.values.size(); ++k) {
    squares += (x.values[k] - cv.values[k]) * (x.values[k] - cv.values[k]);
  }
  const double naive =
      std::sqrt(squares / std::max(1.0, static_cast<double>(x.values.size())));
  if (x.measured() &&
      simulation.x_rmse_pct > std::max(kWorse * naive, kMinVariation)) {
    refuse("X", simulation.x_rmse_pct, naive, "X = CV", " %");
  }
  if (x.measured() && simulation.x_rmse_pct > kCurve &&
      ScatterOfX(runs) < kFixed * simulation.x_rmse_pct) {
    throw DataError(
        "X is a fixed curve of CV, and the simulated valve is off by " +
        Text(simulation.x_rmse_pct) + " % (RMSE), expected at most " +
        Text(kCurve) +
        " %: the positioner has a characteristic of its own, of which it is "
        "not known what faults do to it; map the command behind the curve as "
        "[signal.CV] (the positioner's set point). If the curve is a straight "
        "line, CV or X has another span: try raw and span in --map");
  }
  // Where the command hardly moves, a flow that does is that of the pressures,
  // and following the command does not make the simulation the worse model.
  const bool shows =
      cv.deviation >= kMinVariation || !BeyondMeter(runs, f, meter_end).empty();
  if (f.measured() && shows &&
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
          "a column is in another unit, or the valve of another kind or size "
          "than its type (--type FILE.toml gives its parameters): " +
          p.name + " fits best at " + Text(p.value) + ", the " +
          (low ? "lower" : "upper") + " bound of its search (" + Text(p.lower) +
          " to " + Text(p.upper) + " about " + Text(p.nominal) + ")");
    }
  }
}

}  // namespace fdi::trainer
