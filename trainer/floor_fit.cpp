#include "trainer/floor_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "diagnosis/decision/floor.h"

namespace fdi::trainer {
namespace {

constexpr std::array kShares{0.15, 0.25, 0.35, 0.5, 0.65, 0.8, 1.0};
constexpr std::array kRates{2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 100.0};
constexpr int kDelays = 3;
constexpr std::size_t kMaxSamples =
    7200;                              // samples that dynamics are sought on
constexpr std::size_t kSettling = 30;  // samples of every stretch
constexpr double kMaxError = 10.0;     // counts; one more is an outlier [%]
constexpr double kTolerance = 1.1;     // of the smallest squared error
constexpr double kSlower = 0.5;        // than any rate that explains the record
constexpr double kMinError = 0.05;     // [%²], that of the reading
constexpr double kFloorMargin = 2.0;   // times what the record showed
constexpr double kMinFloorDeviation = 8.0;
constexpr double kMaxFloorDeviation = 15.0;  // a positioner's alert is at 20 %
constexpr double kDeviationS = 5.0;
constexpr double kMinStuckTravel = 5.0;
constexpr double kFlowS = 10.0;
constexpr double kMinTravel = 1.5;     // of X, to tell an exponent [% rms]
constexpr double kMaxFlowShare = 0.9;  // of the largest: no saturation
constexpr double kFlowMargin = 1.3;    // times what the record showed

// Filling and venting have a rate each; the floor keeps the extremes.
struct Answer {
  int delay;
  double share;
  double closing;  // [%/sample]
  double opening;
  double error{0.0};

  FloorLimits::Rod Towards(double command, double x) const {
    return {share, command > x ? closing : opening};
  }
};

// An estimate of the position, of which Floor only tests that it stays.
bool IsHeld(const Sample& sample) {
  return (sample.uncertain() & (MaskOf(Signal::kCv) | MaskOf(Signal::kX))) != 0;
}

double Command(const Stretch& stretch, std::size_t k, int delay) {
  const std::size_t at = k - std::min(k, static_cast<std::size_t>(delay));
  return std::clamp(stretch.samples[at][Signal::kCv], 0.0, 100.0);
}

// Mean squared error of the rod, run freely from the first reading of every
// stretch,
//
//   x ← x + clamp(s (u − x), −v_opening, v_closing),   u = CV `delay` before
//
// Errors are bounded, so that a few outliers do not choose the dynamics.
double SquaredError(const std::vector<Stretch>& stretches,
                    const Answer& answer) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const Stretch& stretch : stretches) {
    double x = stretch.samples.front()[Signal::kX];
    for (std::size_t k = 0; k < stretch.samples.size() && count < kMaxSamples;
         ++k) {
      const double command = Command(stretch, k, answer.delay);
      x = NextRodPosition(answer.Towards(command, x), x, command);
      if (k >= kSettling && !IsHeld(stretch.samples[k])) {
        const double error =
            std::min(std::abs(stretch.samples[k][Signal::kX] - x), kMaxError);
        sum += error * error;
        ++count;
      }
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

// An exhaustive search: 3 · 7 · 7 · 7 = 1029 answers over at most 7200 samples.
// The error is flat where a rate is never reached, and what is wanted is not
// the minimum but the extent of all answers that are nearly as good. kMinError
// keeps that extent open where the best answer is all but exact.
void FitRod(const std::vector<Stretch>& stretches, FloorLimits& floor) {
  std::vector<Answer> answers;
  for (int delay = 0; delay < kDelays; ++delay) {
    for (const double share : kShares) {
      for (const double closing : kRates) {
        for (const double opening : kRates) {
          answers.push_back({delay, share, closing, opening});
          answers.back().error = SquaredError(stretches, answers.back());
        }
      }
    }
  }
  const Answer& best = *std::ranges::min_element(answers, {}, &Answer::error);
  floor.delay = best.delay;
  floor.quick = {best.share, std::max(best.closing, best.opening)};
  floor.slow = {best.share, std::min(best.closing, best.opening)};
  for (const Answer& answer : answers) {
    if (answer.delay == best.delay &&
        answer.error <= kTolerance * best.error + kMinError) {
      const auto [low, high] = std::minmax(answer.closing, answer.opening);
      floor.quick.share = std::max(floor.quick.share, answer.share);
      floor.quick.rate = std::max(floor.quick.rate, high);
      floor.slow.share = std::min(floor.slow.share, answer.share);
      floor.slow.rate = std::min(floor.slow.rate, low);
    }
  }
  floor.slow.rate *= kSlower;
}

// Nothing shows how the rod moves: at once, or as slowly as a rod of any valve,
// 1 %/s and a sixth of the way in a second.
void AssumeRod(double period_s, FloorLimits& floor) {
  floor.delay = 0;
  floor.quick = {1.0, kRates.back()};
  floor.slow = {1.0 - std::pow(1.0 - kShares.front(), period_s),
                kSlower * kRates.front() * period_s};
  floor.deviation = kMinFloorDeviation;
  floor.stuck_travel = kMinStuckTravel;
}

// The largest value that `values` stay at or above for `length` in a row: a
// limit from there on is never exceeded for so long.
double Sustained(const std::vector<double>& values, int length) {
  double most = 0.0;
  const auto n = static_cast<std::ptrdiff_t>(length);
  for (auto from = values.begin(); values.end() - from >= n; ++from) {
    most = std::max(most, *std::min_element(from, from + n));
  }
  return most;
}

// Runs the rods of Floor over the record. Both sides count separately, as they
// do there: a deviation that changes its sign starts over.
void FitDeviation(const std::vector<Stretch>& stretches, FloorLimits& floor) {
  double most = 0.0;
  double repeated = 0.0;  // travel of the slow rod while X repeats
  for (const Stretch& stretch : stretches) {
    RodBand rod(floor);
    rod.Restart(stretch.samples.front()[Signal::kX]);
    double lowest = rod.slow();
    double highest = rod.slow();
    double last = stretch.samples.front()[Signal::kX];
    std::vector<double> above;
    std::vector<double> below;
    for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
      const double x = stretch.samples[k][Signal::kX];
      rod.Step(stretch.samples[k][Signal::kCv]);
      const bool silent =
          (stretch.samples[k].uncertain() & MaskOf(Signal::kX)) != 0;
      const double slack = silent ? kWidestDeadBand : 0.0;
      if (std::abs(x - last) > slack || k < kSettling) {
        lowest = highest = rod.slow();
        last = x;
      }
      if (k < kSettling) {
        continue;
      }
      lowest = std::min(lowest, rod.slow());
      highest = std::max(highest, rod.slow());
      repeated = std::max(repeated, highest - lowest);
      if (IsHeld(stretch.samples[k])) {
        continue;
      }
      above.push_back(rod.Beyond(x));
      below.push_back(-rod.Beyond(x));
    }
    most = std::max({most, Sustained(above, floor.deviation_samples),
                     Sustained(below, floor.deviation_samples)});
  }
  floor.deviation =
      std::clamp(kFloorMargin * most, kMinFloorDeviation, kMaxFloorDeviation);
  floor.stuck_travel = std::max(kMinStuckTravel, kFloorMargin * repeated);
}

// In the place of X where that is not measured.
Signal Position(const Sample& sample) {
  return sample.Has(Signal::kX) ? Signal::kX : Signal::kCv;
}

bool HasDp(const Sample& sample) {
  return sample.Has(Signal::kP1) && sample.Has(Signal::kP2);
}

void FitLevels(const std::vector<Stretch>& stretches, FloorLimits& floor) {
  double sum = 0.0;
  double count = 0.0;
  for (const Stretch& stretch : stretches) {
    for (const Sample& sample : stretch.samples) {
      floor.flow_high = std::max(floor.flow_high, sample[Signal::kF]);
      if (HasDp(sample)) {
        sum += sample[Signal::kP1] - sample[Signal::kP2];
        count += 1.0;
      }
    }
  }
  // Without pressures, any constant does: the gain is fitted with it.
  floor.dp_level = count > 0.0 ? std::max(sum / count, 1.0) : 1.0;
}

// F = g exp(−n X/100) √dP as a straight line in x = X/100,
//
//   ln(F/√dP) = ln g − n x,
//   n = −cov(x, y)/var(x),   ln g = mean(y) + n mean(x)
//
// Noise of constant deviation σ in F is σ/F in ln F, hence the weights F².
// Flows near the largest may be those of a saturated transmitter and are left
// out. Where X hardly moves, the slope is noise, and the exponent stays at its
// default. With the f of a trim, y is ln(F/(f √dP)) and n is 0.
//
// Without X, the straight line is that of CV. False where no row tells it.
bool FitFlowCurve(const std::vector<Stretch>& stretches, FloorLimits& floor) {
  FitLevels(stretches, floor);
  const bool shaped = !floor.flow_shape.empty();
  double w = 0.0;
  double wx = 0.0;
  double wy = 0.0;
  double wxx = 0.0;
  double wxy = 0.0;
  for (const Stretch& stretch : stretches) {
    for (const Sample& sample : stretch.samples) {
      const double flow = sample[Signal::kF];
      const double dp = DpOf(floor, sample);
      const double at = sample[Position(sample)];
      const double shape = shaped ? FlowShapeAt(floor, at) : 1.0;
      if (flow <= floor.flow_margin * floor.flow_high ||
          flow >= kMaxFlowShare * floor.flow_high || dp <= 0.0 ||
          shape <= 0.0) {
        continue;
      }
      const double weight = flow * flow;
      const double x = 0.01 * at;
      const double y = std::log(flow / std::sqrt(dp)) - std::log(shape);
      w += weight;
      wx += weight * x;
      wy += weight * y;
      wxx += weight * x * x;
      wxy += weight * x * y;
    }
  }
  if (w <= 0.0) {
    return false;
  }
  const double variance = wxx / w - wx / w * (wx / w);
  if (shaped) {
    floor.flow_exponent = 0.0;
  } else if (variance > 1e-4 * kMinTravel * kMinTravel) {
    floor.flow_exponent =
        std::clamp(-(wxy / w - wx / w * (wy / w)) / variance, 1.0, 8.0);
  }
  floor.flow_gain = std::exp(wy / w + floor.flow_exponent * wx / w);
  return true;
}

// The factor solves the test F > c F(X − L/2, dP) + m F_high of Floor for the
// largest c that the record reached for flow_samples in a row; the share in the
// test F < s LeastFlowAt(X, dP) − m F_high is found likewise.
// Without X, the factor takes the most open position that the rod may have, as
// Floor does.
void FitFlowFactors(const std::vector<Stretch>& stretches, FloorLimits& floor) {
  double too_little = floor.flow_factor;  // its inverse is the share
  for (const Stretch& stretch : stretches) {
    std::vector<double> ratios;
    RodBand rod(floor);
    rod.Restart(stretch.samples.front()[Signal::kCv]);
    std::vector<double> shortfalls;
    for (const Sample& sample : stretch.samples) {
      rod.Step(sample[Signal::kCv]);
      const bool has_x = sample.Has(Signal::kX);
      if (IsHeld(sample) || (sample.uncertain() & MaskOf(Signal::kF)) != 0) {
        continue;
      }
      const double x = has_x ? sample[Signal::kX] : rod.most_open();
      const double least_open = has_x ? x : rod.least_open();
      const double least =
          FlowAt(floor, x - 0.5 * floor.deviation, DpOf(floor, sample));
      const double flow =
          sample[Signal::kF] - floor.flow_margin * floor.flow_high;
      ratios.push_back(least > 0.0 ? flow / least : 0.0);
      // Floor does not test a shut valve for too little flow.
      shortfalls.push_back(
          IsShut(x, sample[Signal::kCv])
              ? 0.0
              : LeastFlowAt(floor, least_open, DpOf(floor, sample)) /
                    (std::max(sample[Signal::kF], 0.0) +
                     floor.flow_margin * floor.flow_high));
    }
    too_little = std::max(
        too_little, kFlowMargin * Sustained(shortfalls, floor.flow_samples));
    floor.flow_factor = std::max(
        floor.flow_factor, kFlowMargin * Sustained(ratios, floor.flow_samples));
  }
  floor.flow_share = 1.0 / too_little;
}

}  // namespace

std::optional<FloorLimits> FitFloor(const Condition& normal, double period_s,
                                    std::vector<double> flow_shape) {
  const std::vector<Stretch> stretches = WholeStretches(normal);
  const Sample& first = stretches.front().samples.front();
  const bool has_x = first.Has(Signal::kX);
  if (!first.Has(Signal::kCv) || !(has_x || first.Has(Signal::kF))) {
    return std::nullopt;
  }
  // FitDeviation() runs the rod that FitRod() has found, and FitFlowFactors()
  // allows for the deviation that FitDeviation() has found.
  FloorLimits floor;
  const auto samples = [&](double seconds) {
    return std::max(2, static_cast<int>(std::lround(seconds / period_s)));
  };
  floor.deviation_samples = samples(kDeviationS);
  floor.flow_samples = samples(kFlowS);
  if (has_x) {
    FitRod(stretches, floor);
    FitDeviation(stretches, floor);
  } else {
    AssumeRod(period_s, floor);
  }
  if (first.Has(Signal::kF)) {
    floor.flow_shape = std::move(flow_shape);
    if (FitFlowCurve(stretches, floor)) {
      FitFlowFactors(stretches, floor);
    }
  }
  return floor;
}

void WidenFloor(const std::vector<Stretch>& normal, FloorLimits& floor) {
  if (normal.empty() || !normal.front().samples.front().Has(Signal::kX)) {
    return;
  }
  FloorLimits shown = floor;
  FitDeviation(normal, shown);
  floor.deviation = std::max(floor.deviation, shown.deviation);
  floor.stuck_travel = std::max(floor.stuck_travel, shown.stuck_travel);
}

}  // namespace fdi::trainer
