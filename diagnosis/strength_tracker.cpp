#include "diagnosis/strength_tracker.h"

#include <algorithm>
#include <cmath>

namespace fdi {
namespace {

// A fault may be this much weaker or stronger than those trained, and this
// much if there is but one observer to tell what strength does.
constexpr double kReachBelow = 0.5;
constexpr double kReachAbove = 1.5;
constexpr double kLoneReachBelow = 0.75;
constexpr double kLoneReachAbove = 1.25;
// A fault rarely develops faster than to full strength in 10 minutes.
constexpr double kRateDeviation = 1.0 / 1500.0;
// What a fault does to a channel counts from this share of the deviation on.
constexpr double kLeastEffect = 0.25;

}  // namespace

StrengthTracker::StrengthTracker(const ModelSet& models,
                                 const std::vector<int>& observers)
    : models_(&models),
      memory_(1.0 - 1.0 / models.decision.evidence_window),
      channel_times_(ChannelTimes(models)),
      evidence_(models.channels.size()),
      cells_(kCells, ChannelEvidence(models.channels.size())) {
  nodes_.push_back({0, 0.0, ChannelEvidence(models.channels.size())});
  for (const int index : observers) {
    const double s = models.observers[static_cast<std::size_t>(index)].strength;
    nodes_.push_back(
        {index, std::abs(s), ChannelEvidence(models.channels.size())});
    sign_ = s < 0.0 ? -1.0 : 1.0;
    segments_.push_back(
        ErrorsBetween(nodes_[nodes_.size() - 2], nodes_.back()));
  }
  SetReach();
}

const ChannelObserver& StrengthTracker::Channel(int observer,
                                                int channel) const {
  return models_->observers[static_cast<std::size_t>(observer)]
      .channels[static_cast<std::size_t>(channel)];
}

StrengthTracker::Errors StrengthTracker::ErrorsBetween(const Node& low,
                                                       const Node& high) const {
  Errors errors;
  for (int c = 0; c < static_cast<int>(models_->channels.size()); ++c) {
    double error = Channel(high.observer, c).interpolation_error;
    if (low.observer != 0) {
      error = std::min(error, Channel(low.observer, c).interpolation_error);
    }
    errors.push_back(error);
  }
  return errors;
}

void StrengthTracker::SetReach() {
  if (segments_.empty()) {
    return;
  }
  const bool lone = segments_.size() == 1;
  const double below = lone ? kLoneReachBelow : kReachBelow;
  const double above = lone ? kLoneReachAbove : kReachAbove;
  lowest_ = nodes_[1].strength * below;
  highest_ = std::min(1.0, nodes_.back().strength * above);
}

void StrengthTracker::Restart() {
  age_ = 0;
  strength_ = lowest_;
  rate_ = 0.0;
  refutable_ = false;
  evidence_.Clear();
  factor_ = 0.0;
  for (ChannelEvidence& cell : cells_) {
    cell.Clear();
  }
  for (Node& node : nodes_) {
    node.evidence.Clear();
  }
}

const StrengthTracker::Node& StrengthTracker::BestNode() const {
  return *std::max_element(nodes_.begin() + (segments_.empty() ? 0 : 1),
                           nodes_.end(), [](const Node& a, const Node& b) {
                             return a.evidence.total() < b.evidence.total();
                           });
}

double StrengthTracker::evidence() const {
  return std::max(evidence_.total(), BestNode().evidence.total());
}

double StrengthTracker::strength() const {
  const Node& best = BestNode();
  return sign_ * (best.evidence.total() > evidence_.total() ? best.strength
                                                            : strength_);
}

void StrengthTracker::RaiseEvidence(double least) {
  evidence_.RaiseTo(least);
  for (Node& node : nodes_) {
    node.evidence.RaiseTo(least);
  }
}

// −½ (ν²/S + ln S)/τ of one channel; outliers count up to a bound.
double StrengthTracker::Gain(const ObserverBank& bank, int channel,
                             double residual, double variance) const {
  const double distance = std::min(residual * residual / variance, kOutlier);
  const double density = bank.saturated(channel) ? 0.0 : std::log(variance);
  return -0.5 * (distance + density) /
         channel_times_[static_cast<std::size_t>(channel)];
}

void StrengthTracker::GatherOfNodes(const ObserverBank& bank) {
  const int channels = static_cast<int>(models_->channels.size());
  for (Node& node : nodes_) {
    node.evidence.Fade(bank, memory_);
    for (int c = 0; c < channels; ++c) {
      const double residual = bank.residual(node.observer, c);
      if (bank.active(c) && !std::isnan(residual)) {
        node.evidence.Add(
            c, Gain(bank, c, residual, Variance(bank, node.observer, c)));
      }
    }
  }
}

double StrengthTracker::Cell(int index) const {
  return lowest_ + (highest_ - lowest_) * index / (kCells - 1);
}

StrengthTracker::Prediction StrengthTracker::At(const ObserverBank& bank,
                                                int channel,
                                                double strength) const {
  if (segments_.empty()) {
    return {bank.residual(0, channel), 0.0, Variance(bank, 0, channel), 0};
  }
  std::size_t j = 0;
  while (j + 1 < segments_.size() && strength >= nodes_[j + 1].strength) {
    ++j;
  }
  const Node& low = nodes_[j];
  const Node& high = nodes_[j + 1];
  const bool high_nearer =
      j == 0 || strength - low.strength > high.strength - strength;
  const Node& nearest = high_nearer ? high : low;
  const double slope = (bank.prediction(high.observer, channel) -
                        bank.prediction(low.observer, channel)) /
                       (high.strength - low.strength);
  const double error = segments_[j][static_cast<std::size_t>(channel)] * slope *
                       (strength - nearest.strength);
  const double high_share = std::clamp(
      (strength - low.strength) / (high.strength - low.strength), 0.0, 1.0);
  const double low_share = 1.0 - high_share;
  const double variance =
      high_share * high_share * Variance(bank, high.observer, channel) +
      low_share * low_share * Variance(bank, low.observer, channel) +
      2.0 * high_share * low_share *
          Channel(high.observer, channel).residual_sd *
          Channel(low.observer, channel).residual_sd;
  const TsModel& model = Channel(nearest.observer, channel).model;
  const double prediction = bank.prediction(low.observer, channel) +
                            slope * (strength - low.strength);
  return {Residual(model, bank.reading(channel), prediction), slope,
          variance + error * error, nearest.observer};
}

// Of a residual under its own condition, and of what is extrapolated.
double StrengthTracker::Variance(const ObserverBank& bank, int observer,
                                 int channel) const {
  const double sd = Channel(observer, channel).residual_sd;
  const double extrapolated =
      kExtrapolationError * bank.extrapolation(observer, channel);
  return sd * sd + extrapolated * extrapolated;
}

void StrengthTracker::Step(const ObserverBank& bank) {
  GatherOfNodes(bank);
  refutable_ = refutable_ || CouldBeRefuted(bank);
  if (!segments_.empty() && age_ < kSearchSamples) {
    Search(bank);
  } else {
    Follow(bank);
  }
  ++age_;
  UpdateFactor(bank);
}

// True if a reading tells this fault from normal operation: some observer of it
// predicts another one, unless the limit of the transmitter hides both. A
// reading at the limit that normal operation does not explain is a test passed.
bool StrengthTracker::CouldBeRefuted(const ObserverBank& bank) const {
  const int channels = static_cast<int>(models_->channels.size());
  for (int c = 0; c < channels; ++c) {
    if (!bank.active(c) || std::isnan(bank.residual(0, c))) {
      continue;
    }
    for (std::size_t j = 1; j < nodes_.size(); ++j) {
      const int observer = nodes_[j].observer;
      const double effect =
          std::abs(bank.prediction(observer, c) - bank.prediction(0, c));
      if (effect > kLeastEffect * Channel(observer, c).residual_sd) {
        return true;
      }
    }
  }
  return false;
}

// Most evidence over a grid of constant strengths: the filter is only locally
// right, and a fault without effect at small strengths has no slope there.
void StrengthTracker::Search(const ObserverBank& bank) {
  const int channels = static_cast<int>(models_->channels.size());
  for (int cell = 0; cell < kCells; ++cell) {
    for (int c = 0; c < channels; ++c) {
      if (!bank.active(c)) {
        continue;
      }
      const Prediction p = At(bank, c, Cell(cell));
      if (std::isnan(p.residual)) {
        continue;
      }
      cells_[static_cast<std::size_t>(cell)].Add(
          c, Gain(bank, c, p.residual, p.variance));
    }
  }
  const auto best =
      std::max_element(cells_.begin(), cells_.end(),
                       [](const ChannelEvidence& a, const ChannelEvidence& b) {
                         return a.total() < b.total();
                       });
  strength_ = Cell(static_cast<int>(best - cells_.begin()));
  evidence_ = *best;
  const double width = (highest_ - lowest_) / (kCells - 1);
  var_strength_ = width * width;
  var_rate_ = kRateDeviation * kRateDeviation;
  covariance_ = 0.0;
  rate_ = 0.0;
}

void StrengthTracker::Follow(const ObserverBank& bank) {
  evidence_.Fade(bank, memory_);
  // Prediction: s ← s + ṡ; the old information fades by λ.
  strength_ += rate_;
  var_strength_ = (var_strength_ + 2.0 * covariance_ + var_rate_) / memory_;
  covariance_ = (covariance_ + var_rate_) / memory_;
  var_rate_ = std::min(var_rate_ / memory_, kRateDeviation * kRateDeviation);
  KeepBounded();
  const int channels = static_cast<int>(models_->channels.size());
  for (int c = 0; c < channels; ++c) {
    if (!bank.active(c)) {
      continue;
    }
    const double s = std::clamp(strength_, lowest_, highest_);
    const Prediction p = At(bank, c, s);
    if (std::isnan(p.residual)) {
      continue;
    }
    const double spread =
        p.variance + p.slope * p.slope * std::min(var_strength_, 1.0);
    const double distance = p.residual * p.residual / spread;
    evidence_.Add(c, Gain(bank, c, p.residual, spread));
    if (p.slope == 0.0 || segments_.empty()) {
      continue;
    }
    const double innovation =
        p.residual *
        (distance > kOutlier ? std::sqrt(kOutlier / distance) : 1.0);
    const double gain_s = p.slope * var_strength_ / spread;
    const double gain_r = p.slope * covariance_ / spread;
    strength_ = s + gain_s * innovation;
    rate_ += gain_r * innovation;
    var_rate_ -= gain_r * p.slope * covariance_;
    covariance_ -= gain_s * p.slope * covariance_;
    var_strength_ -= gain_s * p.slope * var_strength_;
  }
  KeepBounded();
  if (strength_ < lowest_ || strength_ > highest_) {
    strength_ = std::clamp(strength_, lowest_, highest_);
    rate_ = 0.0;
  }
}

// A strength that the residuals say nothing of stays within [0, 1] all the
// same.
void StrengthTracker::KeepBounded() {
  var_strength_ = std::clamp(var_strength_, 0.0, 1.0);
  var_rate_ = std::max(var_rate_, 0.0);
  const double most = std::sqrt(var_strength_ * var_rate_);
  covariance_ = std::clamp(covariance_, -most, most);
}

void StrengthTracker::UpdateFactor(const ObserverBank& bank) {
  factor_ = 1.0;
  const int channels = static_cast<int>(models_->channels.size());
  for (int c = 0; c < channels; ++c) {
    if (!bank.active(c)) {
      continue;
    }
    const Prediction p = At(bank, c, strength_);
    if (std::isnan(p.residual)) {
      continue;
    }
    const ChannelObserver& nearest = Channel(p.nearest, c);
    const double shrunk =
        p.residual * nearest.residual_sd / std::sqrt(p.variance);
    factor_ = std::min(factor_, nearest.membership(shrunk));
  }
}

}  // namespace fdi
