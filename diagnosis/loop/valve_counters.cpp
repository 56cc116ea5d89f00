#include "diagnosis/loop/valve_counters.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <utility>

#include "base/time_units.h"

namespace fdi::loop {
namespace {

constexpr double kAtEnd = 0.5;  // [%]
constexpr double kStood = 0.1;  // A rod or a command that stands [%].
constexpr double kSlip = 0.5;   // [%]
constexpr double kRecentS = 10.0;
constexpr double kUsualS = 60.0;
constexpr double kUnusual = 5.0;    // Times the mean |ΔX|.
constexpr double kTurn = 0.25;      // [%]
constexpr double kFollowed = 0.25;  // [%]
constexpr double kFast = 1.0;       // [%/s]
constexpr double kRateS = 10.0;
constexpr double kSlowest = 0.01;  // Ramps [%/s].
constexpr double kSteepest = 0.25;
constexpr double kRampBegin = 2.0;  // Skipped part of a leg [%].
// Least mean slope, as a share of the largest recent step between samples: the
// mean has less noise. Else noise of the counted sample itself would select it.
constexpr double kStraight = 0.25;
constexpr std::int64_t kRampSamples = 60;
constexpr double kStep = 2.0;  // [%]
constexpr double kHoldS = 10.0;
constexpr double kLongestS = 60.0;
constexpr double kLeaves = 0.1;     // Share of the step of CV.
constexpr double kRealised = 0.25;  // Share of the step of CV.

std::int64_t Quanta(double value) {
  return std::llround(value / ValveCounts::kQuantum);
}

std::optional<double> MeanSize(std::int64_t sum, std::int64_t number,
                               double quantum) {
  return number > 0 ? std::optional(static_cast<double>(sum) /
                                    static_cast<double>(number) * quantum)
                    : std::nullopt;
}

// The answer of a rod to a step of its command. Times in samples from the
// first one with the new command, interpolated: good to a sample.
struct StepResponse {
  double realised{0.0};   // x_∞ − x_0, as x.
  double delay{0.0};      // Td: until 2 % of it.
  double t63{0.0};        // T63: until 63.2 % of it.
  double t86{0.0};        // T86: until 86.5 % of it.
  double overshoot{0.0};  // Largest excess, in shares of it.
};

constexpr double kMoved = 0.02;  // Share of the realised step.

// When x has come to `level` from `begin`, 0 to 1 of the way [samples].
double Crossing(std::span<const float> x, double begin, double level) {
  double before = 0.0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double now =
        level != begin ? (double{x[k]} - begin) / (level - begin) : 1.0;
    if (now >= 1.0) {
      return k == 0 ? 0.0
                    : static_cast<double>(k) - (now - 1.0) / (now - before);
    }
    before = now;
  }
  return static_cast<double>(x.size());
}

// @param x     from the first sample with the new command on; not empty.
// @param begin x_0, before the step. x_∞ is the mean of the last quarter of x.
//
// Source: ISA-75.25.01 (times of the realised step).
StepResponse ResponseOf(std::span<const float> x, double begin) {
  const std::span<const float> rest =
      x.last(std::max<std::size_t>(1, x.size() / 4));
  const double end = std::accumulate(rest.begin(), rest.end(), 0.0) /
                     static_cast<double>(rest.size());
  StepResponse response;
  response.realised = end - begin;
  const auto time = [&](double share) {
    return Crossing(x, begin, begin + share * response.realised);
  };
  response.delay = time(kMoved);
  response.t63 = time(1.0 - std::exp(-1.0));
  response.t86 = time(1.0 - std::exp(-2.0));
  for (const float value : x) {
    if (response.realised != 0.0) {
      response.overshoot = std::max(response.overshoot,
                                    (double{value} - end) / response.realised);
    }
  }
  return response;
}

}  // namespace

void ValveCounts::Add(const ValveCounts& other) {
  for (const auto count : kValveCounts) {
    this->*count += other.*count;
  }
}

constexpr std::array<std::pair<Signal, std::int64_t ValveCounts::*>, 6>
    kSingleCounts{{{Signal::kCv, &ValveCounts::single_cv},
                   {Signal::kP1, &ValveCounts::single_p1},
                   {Signal::kP2, &ValveCounts::single_p2},
                   {Signal::kT1, &ValveCounts::single_t1},
                   {Signal::kX, &ValveCounts::single_x},
                   {Signal::kF, &ValveCounts::single_f}}};

void CountSingle(SignalMask signals, ValveCounts& counts) {
  for (const auto& [signal, count] : kSingleCounts) {
    counts.*count += (signals & MaskOf(signal)) != 0 ? 1 : 0;
  }
}

SingleReadings MostSingle(const ValveCounts& counts) {
  SingleReadings most;
  for (const auto& [signal, count] : kSingleCounts) {
    if (counts.*count > most.number) {
      most = {signal, counts.*count};
    }
  }
  return most;
}

std::string_view FigureName(Figure figure) {
  constexpr std::array<std::string_view, kFigureCount> kNames{
      "at_limit", "slip_jump", "dead_band", "error_band",  "delay",
      "t63",      "t86",       "overshoot", "travel_gain", "single_readings"};
  return kNames[static_cast<std::size_t>(figure)];
}

std::optional<double> FigureOf(Figure figure, const ValveCounts& counts,
                               std::int64_t seen_ms) {
  constexpr double kMs = 1e-3;
  constexpr double kQuantum = ValveCounts::kQuantum;
  switch (figure) {
    case Figure::kAtLimit:
      return MeanSize(counts.limit_ms, seen_ms, 100.0);
    case Figure::kSlipJump:
      return MeanSize(counts.slip_size, counts.slips, kQuantum);
    case Figure::kDeadBand:
      return MeanSize(counts.dead_band, counts.turns, kQuantum);
    case Figure::kErrorBand:
      if (std::min(counts.opening, counts.closing) < kRampSamples) {
        return std::nullopt;
      }
      return *MeanSize(counts.opening_offset, counts.opening, kQuantum) -
             *MeanSize(counts.closing_offset, counts.closing, kQuantum);
    case Figure::kDelay:
      return MeanSize(counts.delay_ms, counts.steps, kMs);
    case Figure::kT63:
      return MeanSize(counts.t63_ms, counts.steps, kMs);
    case Figure::kT86:
      return MeanSize(counts.t86_ms, counts.steps, kMs);
    case Figure::kOvershoot:
      return MeanSize(counts.overshoot, counts.steps, kQuantum);
    case Figure::kTravelGain:
      return MeanSize(counts.gain, counts.steps, kQuantum);
    case Figure::kSingle:
      return MeanSize(MostSingle(counts).number, seen_ms, kMsPerHour);
  }
  return std::nullopt;
}

void ValveCounters::Push(const Reading& now, ValveCounts& counts) {
  const std::int64_t period_ms = std::llround(now.period_s * 1e3);
  counts.auto_ms += now.automatic ? period_ms : 0;
  if (now.cv <= kAtEnd || now.cv >= 100.0 - kAtEnd) {
    counts.limit_ms += period_ms;
  }
  const double moved = std::isfinite(now.x) ? now.x - x_ : now.cv - cv_;
  counts.path += std::isfinite(moved) ? Quanta(std::abs(moved)) : 0;
  const bool both = std::isfinite(now.cv) && std::isfinite(now.x);
  if (both && measurable_) {
    CountSlip(now, counts);
    CountTurn(now, counts);
    CountRamp(now, counts);
    CountStep(now, counts);
  } else if (both) {
    Begin(now);
  }
  measurable_ = both;
  cv_ = now.cv;
  x_before_ = std::exchange(x_, now.x);
}

void ValveCounters::Begin(const Reading& now) {
  leg_ = {0, now.cv, now.cv, now.x};
  turn_.reset();
  step_.reset();
  recent_cv_ = 0.0;
  usual_x_ = usual_s_ = 0.0;
  rate_ = 0.0;
  held_cv_ = now.cv;
  held_s_ = 0.0;
}

void ValveCounters::CountSlip(const Reading& now, ValveCounts& counts) {
  recent_cv_ = std::max(recent_cv_ * kRecentS / (kRecentS + now.period_s),
                        std::abs(now.cv - cv_));
  const double jump = std::abs(now.x - x_);
  if (jump >= kSlip && jump > 2.0 * recent_cv_ && jump > kUnusual * usual_x_ &&
      usual_s_ >= 0.5 * kUsualS && std::abs(x_ - x_before_) <= kStood) {
    ++counts.slips;
    counts.slip_size += Quanta(jump);
  }
  usual_s_ = std::min(usual_s_ + now.period_s, kUsualS);
  usual_x_ += (jump - usual_x_) * std::min(1.0, now.period_s / usual_s_);
}

void ValveCounters::CountTurn(const Reading& now, ValveCounts& counts) {
  const double moved = now.cv - leg_.extreme;
  if (moved * leg_.direction > 0.0 || moved == 0.0) {
    leg_.extreme = now.cv;
    leg_.x = now.x;
  } else if (std::abs(moved) >= kTurn) {
    if (leg_.direction != 0) {
      turn_ = {leg_.extreme, leg_.x};
    }
    leg_ = {moved > 0.0 ? 1 : -1, leg_.extreme, now.cv, now.x};
  }
  if (!turn_) {
    return;
  }
  const double followed = (now.x - turn_->x) * leg_.direction;
  if (std::abs(now.cv - cv_) > kFast * now.period_s) {
    turn_.reset();
  } else if (followed >= kFollowed) {
    const double band = std::abs(now.cv - turn_->cv) - followed;
    ++counts.turns;
    counts.dead_band += Quanta(std::max(band, 0.0));
    turn_.reset();
  }
}

void ValveCounters::CountRamp(const Reading& now, ValveCounts& counts) {
  rate_ += ((now.cv - cv_) / now.period_s - rate_) * now.period_s /
           (kRateS + now.period_s);
  const double onward = rate_ * leg_.direction;
  if (onward < kSlowest || onward > kSteepest ||
      onward * now.period_s < kStraight * recent_cv_ ||
      std::abs(now.cv - leg_.begin) < kRampBegin) {
    return;
  }
  const bool closing = leg_.direction > 0;
  ++(closing ? counts.closing : counts.opening);
  (closing ? counts.closing_offset : counts.opening_offset) +=
      Quanta(now.x - now.cv);
}

void ValveCounters::CountStep(const Reading& now, ValveCounts& counts) {
  if (step_) {
    const double step = std::abs(step_->cv - step_->cv_before);
    const bool left = std::abs(now.cv - step_->cv) > kLeaves * step;
    if (!left) {
      step_->x.push_back(static_cast<float>(now.x));
      step_->last_cv = now.cv;
    }
    const double lasted =
        static_cast<double>(step_->x.size() - 1) * now.period_s;
    if (left || lasted >= kLongestS) {
      if (lasted >= kHoldS) {
        FinishStep(now.period_s, counts);
      }
      step_.reset();
    }
  }
  if (std::abs(now.cv - held_cv_) <= kStood) {
    held_s_ += now.period_s;
    return;
  }
  // At most half a hold between two samples: nothing to tell of a step.
  if (!step_ && held_s_ >= kHoldS && std::abs(now.cv - cv_) >= kStep &&
      now.period_s <= 0.5 * kHoldS) {
    step_ = Step{cv_, now.cv, x_, now.cv};
    step_->x.push_back(static_cast<float>(now.x));
  }
  held_cv_ = now.cv;
  held_s_ = 0.0;
}

void ValveCounters::FinishStep(double period_s, ValveCounts& counts) const {
  const StepResponse response = ResponseOf(step_->x, step_->x_before);
  const double step = step_->last_cv - step_->cv_before;
  if (response.realised / step < kRealised) {
    return;
  }
  const auto time_ms = [period_s](double samples) {
    return std::llround(1e3 * period_s * samples);
  };
  ++counts.steps;
  counts.delay_ms += time_ms(response.delay);
  counts.t63_ms += time_ms(response.t63);
  counts.t86_ms += time_ms(response.t86);
  counts.overshoot += Quanta(100.0 * response.overshoot);
  counts.gain += Quanta(response.realised / step);
}

}  // namespace fdi::loop
