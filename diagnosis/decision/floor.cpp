#include "diagnosis/decision/floor.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "diagnosis/model/fault_catalogue.h"

namespace fdi {
namespace {

constexpr double kShut = 98.0;     // of CV and X [%]
constexpr double kStop = 2.0;      // from an end of the travel [%]
constexpr int kBreakaway = 5;      // samples that a rod may stay at rest
constexpr int kStuckSamples = 10;  // for the position; twice as many for F
// Without any reading of F, or of an X that the record was never without: as
// long as nothing may be known of a valve, and of F two polls at least.
constexpr int kSilentSamples = 60;
constexpr int kSilentPolls = 2;
constexpr int kMaxRepeats = 1 << 20;  // counted
constexpr double kLeastDp = 0.5;      // of the usual pressure drop
constexpr double kFlowBorder = 0.9;   // of the largest flow: not saturated

int SilenceOf(int every) {
  return every == ReadEvery::kOnChange
             ? kSilentSamples
             : std::max(kSilentSamples, kSilentPolls * every);
}

}  // namespace

double NextRodPosition(const FloorLimits::Rod& rod, double x, double command) {
  return x + std::clamp(rod.share * (command - x), -rod.rate, rod.rate);
}

void RodBand::Restart(double x) {
  quick_ = slow_ = lowest_ = highest_ = std::clamp(x, 0.0, 100.0);
  commands_.fill(quick_);
  resting_ = true;
  wait_ = kBreakaway;
}

void RodBand::Step(double command) {
  std::shift_right(commands_.begin(), commands_.end(), 1);
  commands_[0] = std::clamp(command, 0.0, 100.0);
  const double target = commands_[static_cast<std::size_t>(limits_->delay)];
  quick_ = NextRodPosition(limits_->quick, quick_, target);
  wait_ = resting_ && wait_ > 0 && std::abs(target - slow_) > kStop ? wait_ - 1
                                                                    : wait_;
  const bool leaves = !resting_ || wait_ == 0;
  // An end of the range stands with the rod only where the rod rests.
  const auto inwards = [&](double end) {
    return leaves || std::abs(end - slow_) > kStop ? limits_->slow
                                                   : FloorLimits::Rod{0.0, 0.0};
  };
  highest_ = NextRodPosition(
      target > highest_ ? limits_->quick : inwards(highest_), highest_, target);
  lowest_ = NextRodPosition(
      target < lowest_ ? limits_->quick : inwards(lowest_), lowest_, target);
  if (leaves) {
    slow_ = NextRodPosition(limits_->slow, slow_, target);
    resting_ = slow_ < kStop || slow_ > 100.0 - kStop;
    const bool left = std::abs(target - slow_) > kStop;
    wait_ = resting_ && !left ? kBreakaway : wait_;
  }
}

double RodBand::Beyond(double x) const {
  return x - std::max(std::min(x, highest_), std::min(lowest_, highest_));
}

double FlowShapeAt(const FloorLimits& floor, double x) {
  const std::vector<double>& f = floor.flow_shape;
  if (f.empty()) {
    return std::exp(-0.01 * floor.flow_exponent * x);
  }
  const double at =
      std::clamp(0.01 * x, 0.0, 1.0) * static_cast<double>(f.size() - 1);
  const auto i = std::min(static_cast<std::size_t>(at), f.size() - 2);
  return std::lerp(f[i], f[i + 1], at - static_cast<double>(i));
}

double FlowAt(const FloorLimits& floor, double x, double dp) {
  return floor.flow_gain * FlowShapeAt(floor, x) * std::sqrt(std::max(dp, 0.0));
}

double DpOf(const FloorLimits& floor, const Sample& sample) {
  return sample.Has(Signal::kP1) && sample.Has(Signal::kP2)
             ? sample[Signal::kP1] - sample[Signal::kP2]
             : floor.dp_level;
}

double LeastFlowAt(const FloorLimits& floor, double x, double dp) {
  const double share = std::clamp(dp / floor.dp_level, 0.0, 1.0);
  return std::min(FlowAt(floor, x + 0.5 * floor.deviation, dp),
                  floor.flow_high * std::sqrt(share));
}

bool IsShut(double x, double cv) {
  return x >= kShut && cv >= kShut;
}

Floor::Floor(const ModelSet& models)
    : limits_(models.floor ? &*models.floor : nullptr),
      position_silence_(models.every.x > ReadEvery::kNoRepeats
                            ? kStuckSamples
                            : kSilentSamples),
      flow_silence_(SilenceOf(models.every.f)),
      first_(static_cast<std::size_t>(
          std::max(FaultIndex(models, kFirstFinding), 0))),
      travel_share_(limits_ != nullptr ? limits_->deviation_samples : 1),
      flow_shares_(limits_ != nullptr ? limits_->flow_samples : 1, kTests) {
  if (limits_ != nullptr) {
    rod_.emplace(*limits_);
  }
}

void Floor::Restart() {
  follows_ = false;
  tests_ = {};
  position_ = {};
  flow_ = {};
  findings_ = 0;
  beginning_ = 0;
  travel_share_.Restart();
  flow_shares_.Restart();
  share_ = 0.0;
}

void Floor::Push(const Sample& sample, SignalMask silent) {
  share_ = 0.0;
  if (limits_ == nullptr) {
    return;
  }
  const bool has_x = sample.Has(Signal::kX);
  if (sample.mode != ValveMode::kAuto || !sample.Has(Signal::kCv) ||
      !(has_x || (sample.Has(Signal::kF) && limits_->flow_share > 0.0))) {
    Restart();
    return;
  }
  if (!follows_) {
    rod_->Restart(sample[has_x ? Signal::kX : Signal::kCv]);
    follows_ = true;
  }
  rod_->Step(sample[Signal::kCv]);
  const SignalMask uncertain = sample.uncertain();
  const auto is_in = [](Signal signal, SignalMask mask) {
    return (mask & MaskOf(signal)) != 0;
  };
  const bool read =
      !is_in(Signal::kCv, uncertain) && !is_in(Signal::kX, uncertain);
  if (has_x && read) {
    PushTravel(sample);
  }
  const auto made_up = static_cast<SignalMask>(uncertain & ~silent);
  if (has_x && !is_in(Signal::kX, made_up)) {
    WatchPosition(sample, is_in(Signal::kX, silent));
  }
  if (limits_->flow_gain > 0.0 && sample.Has(Signal::kF)) {
    if (read && !is_in(Signal::kF, uncertain)) {
      PushFlow(sample);
    }
    if (!is_in(Signal::kX, made_up) && !is_in(Signal::kF, made_up)) {
      WatchFlow(sample, is_in(Signal::kF, silent));
    }
  }
  findings_ = 0;
  beginning_ = 0;
  for (std::size_t i = 0; i < kTests; ++i) {
    const FaultSet bit = FaultSet{1} << (first_ + i);
    findings_ |= tests_[i].found ? bit : 0;
    beginning_ |= !tests_[i].found && tests_[i].length > 0 ? bit : 0;
  }
}

void Floor::Count(int finding, bool beyond, double share, double size,
                  int needed, std::int64_t stamp_ns) {
  const auto at = static_cast<std::size_t>(finding - kTravelDeviation);
  Test& test = tests_[at];
  share = std::max(0.0, share);  // Not NaN.
  share_ = at == 0 ? travel_share_.Push(share, 0, share_)
                   : flow_shares_.Push(share, at, share_);
  test.since_ns = beyond && test.length == 0 ? stamp_ns : test.since_ns;
  test.length = beyond ? std::min(test.length + 1, needed) : 0;
  test.size = std::clamp(size, -1.0, 1.0);
  test.found = test.length >= needed;
}

// Finds a reading that repeats while its expected value moves.
void Floor::Watch(const Watched& what, std::int64_t stamp_ns, Repeat& repeat) {
  const Expectations& expected = what.expected;
  if (repeat.length == 0 || !what.counts ||
      std::abs(what.reading - repeat.reading) > what.slack) {
    repeat = {what.reading, stamp_ns, 0, expected, expected};
  }
  repeat.length = std::min(repeat.length, kMaxRepeats) + 1;
  double travel = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < expected.size(); ++i) {
    repeat.lowest[i] = std::min(repeat.lowest[i], expected[i]);
    repeat.highest[i] = std::max(repeat.highest[i], expected[i]);
    travel = std::min(travel, repeat.highest[i] - repeat.lowest[i]);
  }
  Test& test =
      tests_[static_cast<std::size_t>(what.finding - kTravelDeviation)];
  // A reading that repeats says so from the first time on, silence from when
  // another one was due.
  repeat.since_ns =
      what.slack > 0.0 && travel <= what.most ? stamp_ns : repeat.since_ns;
  test.found = repeat.length >= what.needed && travel > what.most;
  test.since_ns = repeat.since_ns;
  test.size = test.found ? 1.0 : 0.0;
}

void Floor::PushTravel(const Sample& sample) {
  const double x = sample[Signal::kX];
  const double deviation = rod_->Beyond(x);
  // Each side counts separately: noise beyond both limits in turn is no
  // finding.
  Test& test = tests_[0];
  if (test.length > 0 && std::signbit(test.size) != std::signbit(deviation)) {
    test.length = 0;
    travel_share_.Restart();
  }
  Count(kTravelDeviation, std::abs(deviation) > limits_->deviation,
        std::abs(deviation) / limits_->deviation, 0.01 * deviation,
        limits_->deviation_samples, sample.stamp_ns);
}

// Where readings come by exception, silence says that the value stays within
// the dead band; what is held or interpolated meanwhile is no other reading.
void Floor::WatchPosition(const Sample& sample, bool silent) {
  // At a stop the rod does not move, whatever the command.
  const auto within = [](double at) {
    return std::clamp(at, kStop, 100.0 - kStop);
  };
  Watch({.finding = kPositionStuck,
         .reading = sample[Signal::kX],
         .slack = silent ? kWidestDeadBand : 0.0,
         .needed = silent ? position_silence_ : kStuckSamples,
         .expected = {within(rod_->quick()), within(rod_->slow())},
         .most = limits_->stuck_travel},
        sample.stamp_ns, position_);
}

// A valve in control that has lost its pressure has lost its flow with it, and
// that is a finding. One that stands wide open without pressure is parked.
double Floor::LeastFlow(double x, const Sample& sample) const {
  const double least_dp =
      sample[Signal::kCv] > kStop ? kLeastDp * limits_->dp_level : 0.0;
  return limits_->flow_share *
             LeastFlowAt(*limits_, x,
                         std::max(DpOf(*limits_, sample), least_dp)) -
         limits_->flow_margin * limits_->flow_high;
}

void Floor::PushFlow(const Sample& sample) {
  // Without a position the rod is where the flow is largest and smallest.
  const bool has_x = sample.Has(Signal::kX);
  const double x = has_x ? sample[Signal::kX] : rod_->most_open();
  const double least_open = has_x ? x : rod_->least_open();
  const double flow = sample[Signal::kF];
  const double dp = DpOf(*limits_, sample);
  const double margin = limits_->flow_margin * limits_->flow_high;
  const bool shut = IsShut(x, sample[Signal::kCv]);
  // The trim still passes a share of its rangeability, which ends at the seat.
  const double seat = std::clamp((100.0 - x) / (100.0 - kShut), 0.0, 1.0);
  const double leak =
      margin + limits_->flow_factor * seat * FlowAt(*limits_, kShut, dp);
  Count(kShutFlow, shut && flow > leak, shut ? flow / leak : 0.0,
        (flow - leak) / limits_->flow_high, limits_->flow_samples,
        sample.stamp_ns);
  const double most = limits_->flow_factor *
                          FlowAt(*limits_, x - 0.5 * limits_->deviation, dp) +
                      margin;
  Count(kExcessFlow, !shut && flow > most, shut ? 0.0 : flow / most,
        (flow - most) / limits_->flow_high, limits_->flow_samples,
        sample.stamp_ns);
  const double least = LeastFlow(least_open, sample);
  const bool follows = std::abs(rod_->Beyond(x)) <= limits_->deviation;
  const bool judged = limits_->flow_share > 0.0 && !shut && follows;
  // No flow at all would be beyond any multiple of the limit. So what lacks
  // counts in shares of the largest flow.
  Count(kLowFlow, judged && flow < least,
        judged ? 1.0 + (least - flow) / limits_->flow_high : 0.0,
        (least - flow) / limits_->flow_high, limits_->flow_samples,
        sample.stamp_ns);
}

// As the position; but how long F is silent while the flow changes, the record
// does not show.
void Floor::WatchFlow(const Sample& sample, bool silent) {
  const bool has_x = sample.Has(Signal::kX);
  const double most_open = has_x ? sample[Signal::kX] : rod_->most_open();
  const double least_open = has_x ? sample[Signal::kX] : rod_->least_open();
  const double flow = sample[Signal::kF];
  const double dp = DpOf(*limits_, sample);
  const double margin = limits_->flow_margin * limits_->flow_high;
  const double opened = FlowAt(*limits_, most_open, dp);
  Watch(
      {.finding = kFlowStuck,
       .reading = flow,
       .slack = silent ? 0.01 * kWidestDeadBand * limits_->flow_high : 0.0,
       .needed = silent ? flow_silence_ : 2 * kStuckSamples,
       .expected = {opened, has_x ? opened : FlowAt(*limits_, least_open, dp)},
       .most = margin,
       .counts = flow > margin && flow < kFlowBorder * limits_->flow_high},
      sample.stamp_ns, flow_);
}

SignalMask Floor::stuck() const {
  const auto found = [&](int finding) {
    return tests_[static_cast<std::size_t>(finding - kTravelDeviation)].found;
  };
  return static_cast<SignalMask>(
      (found(kPositionStuck) ? MaskOf(Signal::kX) : SignalMask{0}) |
      (found(kFlowStuck) ? MaskOf(Signal::kF) : SignalMask{0}));
}

std::optional<std::int64_t> Floor::stamp_ns() const {
  std::optional<std::int64_t> stamp;
  for (const Test& test : tests_) {
    if (test.found) {
      stamp = std::min(stamp.value_or(test.since_ns), test.since_ns);
    }
  }
  return stamp;
}

}  // namespace fdi
