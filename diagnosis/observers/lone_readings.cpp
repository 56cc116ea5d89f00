#include "diagnosis/observers/lone_readings.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "base/time_units.h"
#include "diagnosis/observers/detection.h"

namespace fdi {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A wire that was loose for a moment will be so again within a day, or has been
// mended.
constexpr std::int64_t kDoubtNs = kNsPerDay;

constexpr std::uint32_t SidesOf(std::size_t channel) {
  return std::uint32_t{3} << (2 * channel);
}

}  // namespace

// An input that has no channel of its own, as a pressure of the paper's set,
// shows only in the channels that read it, so it is held out with them. The
// command is no transmitter, unless a position stands in its place.
LoneReadings::LoneReadings(const ModelSet& models) : models_(&models) {
  SignalMask others = models.position_as_command ? 0 : MaskOf(Signal::kCv);
  for (const ChannelSpec& channel : models.channels) {
    others = static_cast<SignalMask>(others | MaskOf(channel.output));
  }
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const TsModel& model = models.observers.front().channels[c].model;
    bounds_[c] = BoundsOf(models.channels[c]);
    doubtful_[c] = static_cast<SignalMask>((RequiredSignals(model) & ~others) |
                                           MaskOf(model.output));
    for (std::size_t of = 0; of < models.channels.size(); ++of) {
      const Signal output = models.channels[of].output;
      if (output != model.output &&
          (RequiredSignals(model) & MaskOf(output)) == 0) {
        independent_[of] |= std::uint32_t{1} << c;
      }
    }
  }
  residuals_.fill(kNan);
  doubted_until_ns_.fill(std::numeric_limits<std::int64_t>::min());
}

// In normal operation a window has less than half of what its limits allow. So
// readings that bring the other half are a matter of this class, too:
// thresholds that are far out, as those of X in a noisy loop, do not see them.
// A window is taken to hold one of them, or as many as are held out in its time
// in the long run.
LoneReadings::Bounds LoneReadings::BoundsOf(const ChannelSpec& channel) {
  Bounds bounds{channel.lower_threshold, channel.upper_threshold};
  for (const WindowLimits& limits : channel.windows) {
    const double each = 0.5 * std::min<double>(limits.length, 1.0 / kRecovery);
    const double rms = std::sqrt(each) * std::exp(limits.upper_log_rms);
    bounds.lower = std::max({bounds.lower, -rms, each * limits.lower_mean});
    bounds.upper = std::min({bounds.upper, rms, each * limits.upper_mean});
  }
  return bounds;
}

// Bit 0: below, bit 1: above.
LoneReadings::Sides LoneReadings::SidesBeyond(const Bounds& bounds,
                                              double residual) {
  return (residual < bounds.lower ? 1U : 0U) |
         (residual > bounds.upper ? 2U : 0U);
}

void LoneReadings::Restart() {
  has_past_ = false;
  beyond_ = 0;
  held_ = 0;
  wrong_ = 0;
}

void LoneReadings::Save(SnapshotWriter& writer) const {
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    writer.Put(doubted_until_ns_[c]);
  }
}

bool LoneReadings::Restore(SnapshotReader& reader) {
  bool all = true;
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    all = all && reader.Get(doubted_until_ns_[c]);
  }
  return all;
}

const Sample& LoneReadings::Step(ObserverBank& bank, const Sample& sample) {
  const Sides held = std::exchange(held_, 0);
  const std::size_t channels = models_->channels.size();
  std::fill_n(residuals_.begin(), channels, kNan);
  wrong_ = 0;
  // An UNCERTAIN past would keep the deciding reading from being judged.
  for (std::size_t k = 0; held != 0 && k < held_count_; ++k) {
    bank.Amend(static_cast<int>(k), last_held_[k].judged.values,
               last_held_[k].original.uncertain());
  }
  bank.Step(sample);
  Read(bank);
  Sides again = 0;
  if (held != 0) {
    const Sides confirmed = Confirmed(held, sample.stamp_ns);
    const bool more =
        held_count_ < kMostHeldOut && Doubted(confirmed, sample.stamp_ns);
    again = more ? confirmed : 0;
    Judge(bank, sample, confirmed != 0 && !more);
  }
  const Sides beyond = Beyond();
  const Sides lone =
      again | TakeRare(has_past_ ? beyond & Jumped(sample) & ~beyond_ : 0);
  beyond_ = beyond;
  has_past_ = true;
  for (std::size_t c = 0; c < channels; ++c) {
    last_[c] = std::isnan(now_[c]) ? last_[c] : now_[c];
  }
  if (lone != 0) {
    HoldOut(bank, sample, lone, again);
  } else {
    judged_ = sample;
  }
  return judged_;
}

// The held-out sides that the next reading confirms. If that is inside the
// limits, the reading before was wrong.
LoneReadings::Sides LoneReadings::Confirmed(Sides held, std::int64_t stamp_ns) {
  const Sides read = held & ~Unread();
  const Sides confirmed = Beyond() & read;
  const Sides refuted = read & ~confirmed;
  for (std::size_t c = 0; c < now_.size(); ++c) {
    if ((refuted & SidesOf(c)) != 0) {
      doubted_until_ns_[c] = stamp_ns + kDoubtNs;
    }
  }
  wrong_ = refuted != 0 ? WrongIn(refuted) : SignalMask{0};
  return confirmed;
}

// The outputs that jumped with their residuals, or else the input that changed
// most.
SignalMask LoneReadings::WrongIn(Sides refuted) const {
  const HeldOut& held = last_held_[0];
  const auto change = [&held](std::size_t i) {
    return held.original.values[i] - held.judged.values[i];
  };
  SignalMask outputs = 0;
  unsigned inputs = 0;
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    const ChannelSpec& channel = models_->channels[c];
    if ((refuted & SidesOf(c)) == 0) {
      continue;
    }
    inputs |= doubtful_[c];
    if (SidesBeyond(bounds_[c], change(Index(channel.output))) != 0) {
      outputs = static_cast<SignalMask>(outputs | MaskOf(channel.output));
    }
  }
  std::size_t most = 0;
  double largest = 0.0;
  for (unsigned left = inputs; outputs == 0 && left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    const double share = std::abs(change(i) / held.judged.values[i]);
    if (share > largest) {
      largest = share;
      most = i;
    }
  }
  return largest > 0.0 ? MaskOf(static_cast<Signal>(most)) : outputs;
}

bool LoneReadings::Doubted(Sides sides, std::int64_t stamp_ns) const {
  for (std::size_t c = 0; sides != 0 && c < now_.size(); ++c) {
    if ((sides & SidesOf(c)) != 0 && stamp_ns < doubted_until_ns_[c] &&
        doubted_until_ns_[c] - kDoubtNs <= stamp_ns) {
      return true;
    }
  }
  return false;
}

// The past gets back the held-out readings if the step was real.
void LoneReadings::Judge(ObserverBank& bank, const Sample& sample, bool real) {
  for (std::size_t k = 0; k < held_count_; ++k) {
    const Sample& past = real ? last_held_[k].original : last_held_[k].judged;
    bank.Amend(static_cast<int>(k) + 1, past.values, past.uncertain());
  }
  bank.StepAgain(sample);
  if (real) {
    Read(bank);
  }
}

void LoneReadings::Read(const ObserverBank& bank) {
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    const int channel = static_cast<int>(c);
    now_[c] = bank.active(channel) && bank.measured(channel)
                  ? CertainResidual(bank, channel)
                  : kNan;
  }
}

// A channel that was not read stays where it was: between readings of slow data
// stand interpolated ones.
LoneReadings::Sides LoneReadings::Beyond() const {
  Sides beyond = 0;
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    beyond |= std::isnan(now_[c]) ? beyond_ & SidesOf(c)
                                  : SidesBeyond(bounds_[c], now_[c]) << 2 * c;
  }
  return beyond;
}

// Within the threshold the reading itself has to jump, and no other signal may
// be out of line: where a rod goes elsewhere for a moment, so does the flow,
// seen from the command.
LoneReadings::Sides LoneReadings::Jumped(const Sample& sample) const {
  Sides jumped = 0;
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    const ChannelSpec& channel = models_->channels[c];
    const std::size_t i = Index(channel.output);
    Sides sides = SidesBeyond(bounds_[c], now_[c] - last_[c]);
    if (sides != 0 && now_[c] >= channel.lower_threshold &&
        now_[c] <= channel.upper_threshold) {
      const double change = sample.values[i] - judged_.values[i];
      sides &= IsSupported(c) ? 0U : SidesBeyond(bounds_[c], change);
    }
    jumped |= sides << 2 * c;
  }
  return jumped;
}

bool LoneReadings::IsSupported(std::size_t channel) const {
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    if ((independent_[channel] >> c & 1U) != 0 && !std::isnan(now_[c]) &&
        SidesBeyond(bounds_[c], now_[c]) != 0) {
      return true;
    }
  }
  return false;
}

LoneReadings::Sides LoneReadings::Unread() const {
  Sides unread = 0;
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    unread |= std::isnan(now_[c]) ? SidesOf(c) : 0;
  }
  return unread;
}

LoneReadings::Sides LoneReadings::TakeRare(Sides lone) {
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    load_[c] = std::max(load_[c] - kRecovery, 0.0);
    if ((lone & SidesOf(c)) == 0) {
      continue;
    }
    if (load_[c] + 1.0 > kBurst) {
      lone &= ~SidesOf(c);
    } else {
      load_[c] += 1.0;
    }
  }
  return lone;
}

void LoneReadings::HoldOut(ObserverBank& bank, const Sample& sample, Sides lone,
                           Sides again) {
  SignalMask doubtful = 0;
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    if ((lone & SidesOf(c)) != 0) {
      const bool counts = (again & SidesOf(c)) != 0 ||
                          !Doubted(lone & SidesOf(c), sample.stamp_ns);
      residuals_[c] = counts ? now_[c] : kNan;
      doubtful = static_cast<SignalMask>(doubtful | doubtful_[c]);
    }
  }
  const std::array<double, kSignalCount> last = judged_.values;
  judged_ = sample;
  for (unsigned left = doubtful & sample.present; left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    judged_.values[i] = last[i];
    judged_.quality[i] = SignalQuality::kUncertain;
  }
  last_held_[1] = last_held_[0];
  last_held_[0] = {sample, judged_};
  held_count_ = again != 0 ? held_count_ + 1 : 1;
  held_ = lone;
  bank.StepAgain(judged_);
}

}  // namespace fdi
