#include "diagnosis/observers/coverage.h"

#include <algorithm>
#include <cmath>

namespace fdi {
namespace {

constexpr double kEndOfTravel = 2.0;  // from 0 or 100 [% of CV]
constexpr int kParked = 60;           // samples without flow there

std::optional<int> ChannelOf(const ModelSet& models, Signal output) {
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    if (models.channels[c].output == output) {
      return static_cast<int>(c);
    }
  }
  return std::nullopt;
}

// Samples that a command is read for.
int ReadFor(const ModelSet& models) {
  int longest = 0;
  for (const Observer& observer : models.observers) {
    for (const ChannelObserver& channel : observer.channels) {
      longest = std::max(longest, MaxLag(channel.model));
    }
  }
  return longest + 1;
}

CoverageReasons If(bool holds, CoverageReason reason) {
  return holds ? BitOf(reason) : CoverageReasons{0};
}

}  // namespace

Coverage::Coverage(const ModelSet& models)
    : models_(&models),
      read_for_(ReadFor(models)),
      inputs_{{{Signal::kT1, CoverageReason::kT1, models.validity.t1,
                ChannelOf(models, Signal::kT1)},
               {Signal::kP1, CoverageReason::kP1, models.validity.p1,
                ChannelOf(models, Signal::kP1)},
               {Signal::kP2, CoverageReason::kP2, models.validity.p2,
                ChannelOf(models, Signal::kP2)}}} {
  Restart();
}

void Coverage::Restart() {
  armed_ = false;
  inside_ = 0;
  passing_ = 0;
  needed_ = std::max(models_->decision.settling_samples, kMaxLag);
  settling_ = needed_;
  at_end_ = 0;
  excused_ = 0;
  last_cv_.reset();
  last_stamp_ns_.reset();
}

bool Coverage::StartSettling(std::int64_t stamp_ns) {
  const bool holds = last_stamp_ns_ && stamp_ns > *last_stamp_ns_ &&
                     stamp_ns - *last_stamp_ns_ <= kMaxInterruptionNs;
  if (!holds) {
    Restart();
  }
  settling_ = std::max(models_->decision.settling_samples, kMaxLag);
  last_cv_.reset();
  return holds;
}

bool Coverage::IsParked(const Sample& sample) {
  const ValidityRegion& region = models_->validity;
  const double cv = sample[Signal::kCv];
  const bool closed = cv >= 100.0 - kEndOfTravel;
  // With pressure across it, an open valve without flow is faulty.
  const bool driven =
      sample.Has(Signal::kP1) && sample.Has(Signal::kP2) &&
      sample[Signal::kP1] - sample[Signal::kP2] >= region.dp.minimum;
  const bool open_without_pressure = cv <= kEndOfTravel && !driven;
  const bool no_flow =
      sample.Has(Signal::kF) && sample[Signal::kF] < region.flow_cutoff;
  at_end_ = no_flow && (closed || open_without_pressure)
                ? std::min(at_end_ + 1, kParked)
                : 0;
  return at_end_ >= kParked;
}

// Reasons that come from the operation of the process.
CoverageReasons Coverage::Operation(const Sample& sample) {
  CoverageReasons reasons =
      If(sample.mode != ValveMode::kAuto, CoverageReason::kMode);
  if (!sample.Has(Signal::kCv)) {
    return reasons;
  }
  const ValidityRegion& region = models_->validity;
  const double cv = sample[Signal::kCv];
  const bool steps = last_cv_ && std::abs(cv - *last_cv_) > region.cv_step;
  averaged_ = last_cv_ ? std::min(averaged_ + 1, kCvMeanSettling) : 0;
  mean_cv_ = last_cv_ ? mean_cv_ + kCvMeanGain * (cv - mean_cv_) : cv;
  last_cv_ = cv;
  const bool settled = averaged_ == kCvMeanSettling;
  const bool beyond = !region.cv.Contains(cv);
  const bool passes = beyond && settled && region.cv.Contains(mean_cv_);
  passing_ = passes ? read_for_ : std::max(passing_ - 1, 0);
  const bool mean_within = !settled || region.cv_mean.Contains(mean_cv_);
  reasons |= If((beyond && !passes) || !mean_within, CoverageReason::kCv);
  reasons |= If(steps, CoverageReason::kCvStep);
  reasons |= If(IsParked(sample), CoverageReason::kParked);
  return reasons;
}

CoverageReasons Coverage::Inputs(const Sample& sample,
                                 const ObserverBank& bank) const {
  CoverageReasons reasons = 0;
  if (sample.Has(Signal::kP1) && sample.Has(Signal::kP2)) {
    const double dp = sample[Signal::kP1] - sample[Signal::kP2];
    reasons |= If(!models_->validity.dp.Contains(dp), CoverageReason::kDp);
  }
  for (const Input& input : inputs_) {
    if (input.channel && bank.active(*input.channel)) {
      const auto c = static_cast<std::size_t>(*input.channel);
      const double r = bank.residual(0, *input.channel);
      reasons |= If(r < models_->channels[c].lower_threshold ||
                        r > models_->channels[c].upper_threshold,
                    input.reason);
    } else if (sample.Has(input.signal)) {
      reasons |= If(!input.range.Contains(sample[input.signal]), input.reason);
    }
  }
  return reasons;
}

Quality Coverage::Judge(const Sample& sample, const ObserverBank& bank,
                        bool episode_open, bool found, bool pending) {
  last_stamp_ns_ = sample.stamp_ns;
  armed_now_ = false;
  settled_ = settling_ == 0;
  CoverageReasons operation = Operation(sample);
  const bool abnormal = models_->floor && (episode_open || found);
  if (abnormal || (models_->floor && pending && armed_)) {
    operation &= BitOf(CoverageReason::kMode);
    passing_ = 0;
    armed_now_ = !armed_ && settled_ && operation == 0;
    armed_ = armed_ || armed_now_;
  }
  const CoverageReasons inputs = Inputs(sample, bank);
  const Quality quality = armed_ && operation == 0
                              ? JudgeArmed(inputs, episode_open)
                              : JudgeDisarmed(operation, inputs);
  settling_ = std::max(settling_ - 1, 0);
  return quality;
}

Quality Coverage::JudgeArmed(CoverageReasons inputs, bool episode_open) {
  excused_ = episode_open ? inputs : CoverageReasons{0};
  if (passing_ > 0) {
    reasons_ = BitOf(passing_ == read_for_ ? CoverageReason::kCv
                                           : CoverageReason::kWaiting);
    return Quality::kUncovered;
  }
  reasons_ = If(settling_ > 0, CoverageReason::kWaiting);
  return settling_ > 0 ? Quality::kSettling : Quality::kLive;
}

Quality Coverage::JudgeDisarmed(CoverageReasons operation,
                                CoverageReasons inputs) {
  excused_ &= inputs;
  operation |= If(passing_ == read_for_, CoverageReason::kCv);
  passing_ = 0;
  reasons_ = operation | (inputs & static_cast<CoverageReasons>(~excused_));
  if (reasons_ != 0) {
    armed_ = false;
    inside_ = 0;
    needed_ = models_->validity.rearm_samples;
    return (reasons_ & BitOf(CoverageReason::kMode)) != 0 ? Quality::kInhibited
                                                          : Quality::kUncovered;
  }
  ++inside_;
  if (inside_ > needed_ && settling_ == 0) {
    armed_ = true;
    armed_now_ = true;
    return Quality::kLive;
  }
  reasons_ = BitOf(CoverageReason::kWaiting);
  return settling_ > 0 ? Quality::kSettling : Quality::kUncovered;
}

void Coverage::Save(SnapshotWriter& writer) const {
  writer.Put(static_cast<std::uint8_t>(last_stamp_ns_.has_value()),
             last_stamp_ns_.value_or(0), static_cast<std::uint8_t>(armed_));
}

bool Coverage::Restore(SnapshotReader& reader) {
  std::uint8_t stamped = 0;
  std::int64_t stamp_ns = 0;
  std::uint8_t armed = 0;
  if (!reader.Get(stamped, stamp_ns, armed)) {
    return false;
  }
  Restart();
  if (stamped != 0) {
    last_stamp_ns_ = stamp_ns;
    armed_ = armed != 0;
    needed_ = armed_ ? needed_ : models_->validity.rearm_samples;
  }
  return true;
}

}  // namespace fdi
