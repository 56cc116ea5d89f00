#include "diagnosis/decision/strength_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/decision/rules.h"
#include "diagnosis/model/fault_catalogue.h"

namespace fdi {
namespace {

constexpr int kSearchSamples = 40;  // initial samples with a grid search
// A fault rarely develops faster than to full strength in 10 minutes: at 1 Hz
// that is 1/600 per sample, 2.5 of these deviations.
constexpr double kRateDeviation = 1.0 / 1500.0;
constexpr double kAccounted = 0.5;    // of the normal observer's residual
constexpr double kOnsetError = 0.5;   // of the effect, while a fault begins
constexpr double kUnaccounted = 2.0;  // misfit of what only tolerates

double Lane(const std::vector<Quad>& quads, std::size_t slot) {
  return quads[slot / kLanes].lane[slot % kLanes];
}

// Variance of a residual under its own condition, including extrapolation.
double Variance(const ObserverBank& bank, const StrengthPath::Point& point) {
  const double extrapolated =
      kExtrapolationError *
      Lane(bank.state().outputs->extrapolations, point.slot);
  return point.sd * point.sd + extrapolated * extrapolated;
}

}  // namespace

StrengthTracker::StrengthTracker(const FaultPlan& plan,
                                 const StrengthPath& path)
    : plan_(&plan),
      path_(&path),
      channels_(plan.models().channels.size()),
      fit_(plan.models().decision.isolation_samples, channels_),
      cells_(kStrengthCells * channels_, 0.0) {}

void StrengthTracker::Restart() {
  age_ = 0;
  strength_ = path_->lowest;
  rate_ = 0.0;
  accounts_ = false;
  total_ = 0.0;
  evidence_.fill(0.0);
  factor_ = 0.0;
  fit_.Restart();
  misfit_ = 0.0;
  tolerates_ = false;
  accounted_.fill({});
  std::fill(cells_.begin(), cells_.end(), 0.0);
}

const StrengthPath::Node& StrengthTracker::BestNode(
    const ObserverEvidence& trained) const {
  // The first node is normal operation.
  return *std::max_element(path_->nodes.begin() + 1, path_->nodes.end(),
                           [&](const auto& a, const auto& b) {
                             return trained.total(a.observer) <
                                    trained.total(b.observer);
                           });
}

double StrengthTracker::evidence(const ObserverEvidence& trained) const {
  const double best = trained.total(BestNode(trained).observer);
  return !Acts(Rule::kTrackedStrength)    ? best
         : !Acts(Rule::kTrainedStrengths) ? total_
                                          : std::max(total_, best);
}

double StrengthTracker::strength(const ObserverEvidence& trained) const {
  const StrengthPath::Node& best = BestNode(trained);
  return path_->sign *
         (trained.total(best.observer) > total_ ? best.strength : strength_);
}

double StrengthTracker::Interpolation(const ObserverEvidence& trained) const {
  return trained.total(BestNode(trained).observer) >= total_
             ? 0.0
             : TrackedInterpolation();
}

double StrengthTracker::TrackedInterpolation() const {
  const PathPlace place = path_->PlaceOf(strength_);
  const double h = place.from_low / (path_->nodes[place.segment + 1].strength -
                                     path_->nodes[place.segment].strength);
  // h (1 − h) is negative beyond the trained strengths.
  return std::min(1.0, std::abs(4.0 * h * (1.0 - h)));
}

// Forgives the contradiction of the channel that objects most; the others keep
// what they have gathered. In the first samples this lasts until
// the next one, because Search() sums the cells again.
void StrengthTracker::RaiseEvidence(double least) {
  const double lacking = least - total_;
  if (lacking > 0.0) {
    const auto end = evidence_.begin() + static_cast<std::ptrdiff_t>(channels_);
    *std::min_element(evidence_.begin(), end) += lacking;
    total_ = Sum(evidence_.data());
  }
}

double StrengthTracker::Sum(const double* parts) const {
  double total = 0.0;
  for (std::size_t c = 0; c < channels_; ++c) {
    total += parts[c];
  }
  return total;
}

// The evidence −½ (ν²/S + ln S)/τ of one channel. Division by τ counts readings
// that repeat each other once.
double StrengthTracker::Gain(const ObserverBank& bank, std::size_t channel,
                             double residual, double variance) const {
  const double distance =
      std::min(residual * residual / variance, kMaxSquaredDistance);
  const double density =
      bank.saturated(static_cast<int>(channel)) ? 0.0 : std::log(variance);
  return -0.5 * (distance + density) / plan_->channel_time(channel);
}

StrengthTracker::Segment StrengthTracker::SegmentOf(const ObserverBank& bank,
                                                    std::size_t channel,
                                                    std::size_t segment) const {
  const StrengthPath::Point& low = path_->points[segment * channels_ + channel];
  const StrengthPath::Point& high =
      path_->points[(segment + 1) * channels_ + channel];
  const double from = Lane(bank.state().outputs->predictions, low.slot);
  const double to = Lane(bank.state().outputs->predictions, high.slot);
  return {from,
          (to - from) / (path_->nodes[segment + 1].strength -
                         path_->nodes[segment].strength),
          Variance(bank, low),
          Variance(bank, high),
          low.sd,
          high.sd};
}

// With w = high_share, the residual of the interpolation has the variance
//
//     S = (w σ_h + (1 − w) σ_l)² + (w e_h)² + ((1 − w) e_l)² + (κ Δs dŷ/ds)².
//
// The deviations σ add up, because both nodes are compared with the same noisy
// reading; the errors e of extrapolation are taken as independent. The last
// term is the error of interpolation at a distance Δs from place.nearest.
StrengthTracker::Prediction StrengthTracker::At(const ObserverBank& bank,
                                                std::size_t channel,
                                                const Segment& segment,
                                                const PathPlace& place) const {
  const double error = path_->errors[place.segment * channels_ + channel] *
                       segment.slope * place.from_nearest;
  const double high_share = place.high_share;
  const double low_share = 1.0 - high_share;
  const double variance =
      high_share * high_share * segment.high_variance +
      low_share * low_share * segment.low_variance +
      2.0 * high_share * low_share * segment.high_sd * segment.low_sd;
  const double saturation =
      path_->points[place.nearest * channels_ + channel].saturation;
  return {Residual(saturation, bank.reading(static_cast<int>(channel)),
                   segment.low + segment.slope * place.from_low),
          segment.slope, variance + error * error, error * error};
}

void StrengthTracker::Step(const ObserverBank& bank) {
  if (age_ < kSearchSamples) {
    Search(bank);
  } else {
    Track(bank);
  }
  ++age_;
  UpdateFactor(bank);
}

// The best of a grid of constant strengths: the filter is only valid locally,
// and a fault without effect at small strengths has no slope there.
void StrengthTracker::Search(const ObserverBank& bank) {
  for (std::size_t c = 0; c < channels_; ++c) {
    if (bank.active(static_cast<int>(c))) {
      SearchChannel(bank, c);
    }
  }
  std::size_t best = 0;
  total_ = Sum(cells_.data());
  for (std::size_t cell = 1; cell < kStrengthCells; ++cell) {
    const double total = Sum(&cells_[cell * channels_]);
    best = total_ < total ? cell : best;
    total_ = std::max(total_, total);
  }
  strength_ = path_->cells[best];
  std::copy_n(&cells_[best * channels_], channels_, evidence_.begin());
  // The filter starts with what the grid leaves open: one cell in strength, and
  // any likely rate.
  const double width = (path_->highest - path_->lowest) / (kStrengthCells - 1);
  var_strength_ = width * width;
  var_rate_ = kRateDeviation * kRateDeviation;
  covariance_ = 0.0;
  rate_ = 0.0;
}

// The cells ascend, so the predictions of each segment are read only once.
void StrengthTracker::SearchChannel(const ObserverBank& bank,
                                    std::size_t channel) {
  std::size_t index = path_->places[0].segment;
  Segment segment = SegmentOf(bank, channel, index);
  for (std::size_t cell = 0; cell < kStrengthCells; ++cell) {
    const PathPlace& place = path_->places[cell];
    if (place.segment != index) {
      index = place.segment;
      segment = SegmentOf(bank, channel, index);
    }
    const Prediction p = At(bank, channel, segment, place);
    if (!std::isnan(p.residual)) {
      cells_[cell * channels_ + channel] +=
          Gain(bank, channel, p.residual, p.variance);
    }
  }
}

// Kalman filter for the state (s, ṡ) with covariance P, in units of samples:
//
//     s ← s + ṡ,   P ← F P Fᵀ / λ,   F = [1 1; 0 1].
//
// Division by λ replaces process noise: a sample that is n old counts λⁿ. The
// channels correct the state in turn, which for independent errors equals a
// joint correction but needs no matrix inverse. Each gains its evidence before
// it corrects the state: an innovation is the error of a prediction, and after
// the correction every fault would seem to fit.
void StrengthTracker::Track(const ObserverBank& bank) {
  const double memory = plan_->memory();
  // Prediction step: s ← s + ṡ; old information fades by λ.
  strength_ += rate_;
  var_strength_ = (var_strength_ + 2.0 * covariance_ + var_rate_) / memory;
  covariance_ = (covariance_ + var_rate_) / memory;
  var_rate_ = std::min(var_rate_ / memory, kRateDeviation * kRateDeviation);
  ClampEstimate();
  double s = std::clamp(strength_, path_->lowest, path_->highest);
  PathPlace place = path_->PlaceOf(s);
  for (std::size_t c = 0; c < channels_; ++c) {
    const int channel = static_cast<int>(c);
    if (!bank.active(channel)) {
      continue;
    }
    evidence_[c] *= bank.fades(channel) ? memory : 1.0;
    const Prediction p = At(bank, c, SegmentOf(bank, c, place.segment), place);
    if (std::isnan(p.residual)) {
      continue;
    }
    const double spread =
        p.variance + p.slope * p.slope * std::min(var_strength_, 1.0);
    evidence_[c] += Gain(bank, c, p.residual, spread);
    if (p.slope != 0.0) {
      Correct(p, s, spread);
      s = std::clamp(strength_, path_->lowest, path_->highest);
      place = path_->PlaceOf(s);
    }
  }
  total_ = Sum(evidence_.data());
  ClampEstimate();
  // A rate that points out of the range would hold the estimate at its end.
  if (strength_ < path_->lowest || strength_ > path_->highest) {
    strength_ = std::clamp(strength_, path_->lowest, path_->highest);
    rate_ = 0.0;
  }
}

// Correction step of the filter for one channel; outliers have bounded
// influence. With H = [dŷ/ds 0], the innovation ν and its variance S = spread,
//
//     K = P Hᵀ/S,   (s, ṡ) ← (s, ṡ) + K ν,   P ← P − K H P.
//
// The variance of the rate comes first, because it needs the covariance from
// before the correction.
void StrengthTracker::Correct(const Prediction& prediction, double strength,
                              double spread) {
  const double residual = prediction.residual;
  const double slope = prediction.slope;
  const double distance = residual * residual / spread;
  const double innovation =
      residual * (distance > kMaxSquaredDistance
                      ? std::sqrt(kMaxSquaredDistance / distance)
                      : 1.0);
  const double gain_s = slope * var_strength_ / spread;
  const double gain_r = slope * covariance_ / spread;
  strength_ = strength + gain_s * innovation;
  rate_ += gain_r * innovation;
  var_rate_ -= gain_r * slope * covariance_;
  covariance_ -= gain_s * slope * covariance_;
  var_strength_ -= gain_s * slope * var_strength_;
}

// Bounds a strength on which the residuals have no information to [0, 1] in
// standard deviation.
void StrengthTracker::ClampEstimate() {
  var_strength_ = std::clamp(var_strength_, 0.0, 1.0);
  var_rate_ = std::max(var_rate_, 0.0);
  const double most = std::sqrt(var_strength_ * var_rate_);
  covariance_ = std::clamp(covariance_, -most, most);
}

void StrengthTracker::UpdateFactor(const ObserverBank& bank) {
  factor_ = 1.0;
  const PathPlace place = path_->PlaceOf(strength_);
  for (std::size_t c = 0; c < channels_ && factor_ > 0.0; ++c) {
    if (!bank.active(static_cast<int>(c))) {
      continue;
    }
    const Prediction p = At(bank, c, SegmentOf(bank, c, place.segment), place);
    if (std::isnan(p.residual)) {
      continue;
    }
    const StrengthPath::Point& nearest =
        path_->points[place.nearest * channels_ + c];
    // The trapezoid is that of residuals with deviation σ; these have √S.
    const double shrunk = p.residual * nearest.sd / std::sqrt(p.variance);
    factor_ = std::min(factor_, nearest.membership(shrunk));
  }
}

PathPlace StrengthTracker::PlaceOfBest(const ObserverEvidence& trained) const {
  const StrengthPath::Node& best = BestNode(trained);
  const bool is_trained = trained.total(best.observer) >= total_;
  return path_->PlaceOf(is_trained ? best.strength : strength_);
}

void StrengthTracker::JudgeAccount(const ObserverBank& bank,
                                   const ObserverEvidence& trained) {
  if (age_ > plan_->models().decision.isolation_samples) {
    return;
  }
  accounts_ = false;
  double furthest = 0.0;
  const PathPlace place = PlaceOfBest(trained);
  for (std::size_t c = 0; c < channels_; ++c) {
    const auto channel = static_cast<int>(c);
    // The first node is normal operation.
    const double sd = path_->points[c].sd;
    const double normal = std::abs(bank.residual(0, channel));
    if (!bank.active(channel) || !(normal > furthest * sd)) {
      continue;
    }
    const Prediction p = At(bank, c, SegmentOf(bank, c, place.segment), place);
    furthest = normal / sd;
    // No residual: both reading and prediction are beyond the transmitter's
    // limit, where normal operation is not.
    accounts_ =
        std::isnan(p.residual) || std::abs(p.residual) < kAccounted * normal;
  }
}

void StrengthTracker::PushFit(const ObserverBank& bank,
                              const ObserverEvidence& trained, bool shown) {
  const int t_k = plan_->models().decision.isolation_samples;
  // The first t_k samples are those of a rod on its way.
  const bool early = age_ <= t_k;
  if (age_ == t_k + 1) {
    accounted_.fill({});
  }
  const bool begins = shown && early;
  const PathPlace place = PlaceOfBest(trained);
  std::array<double, kMaxChannels> z;
  z.fill(std::numeric_limits<double>::quiet_NaN());
  for (std::size_t c = 0; c < channels_; ++c) {
    if (bank.active(static_cast<int>(c))) {
      const Prediction p =
          At(bank, c, SegmentOf(bank, c, place.segment), place);
      const double sd = path_->points[place.nearest * channels_ + c].sd;
      const double normal = bank.residual(0, static_cast<int>(c));
      // An error of interpolation excuses a part of an effect, not one that is
      // not there: nearer to normal operation, there is none.
      const bool apart =
          Acts(Rule::kApart) && std::abs(normal) < std::abs(p.residual);
      const bool on_its_way = begins && Acts(Rule::kOnset) && !apart;
      const double onset = on_its_way && !std::isnan(normal)
                               ? kOnsetError * (normal - p.residual)
                               : 0.0;
      const double most = Acts(Rule::kFitVariance)
                              ? kMaxFitVariance * sd * sd
                              : std::numeric_limits<double>::infinity();
      const double spread = std::sqrt(std::min(p.variance - p.error, most) +
                                      (apart ? 0.0 : p.error) + onset * onset);
      z[c] = p.residual / spread;
      PushAccount(bank, c, p.residual);
    }
  }
  fit_.Push({z.data(), channels_});
  misfit_ = 0.0;
  // Normal operation, the first node, has no limits.
  const std::size_t node = std::max<std::size_t>(place.nearest, 1);
  for (std::size_t c = 0; c < channels_ && Acts(Rule::kFitLimits); ++c) {
    const FitBounds& limits = path_->points[node * channels_ + c].fit;
    misfit_ = std::max(misfit_, fit_.Excess(c, limits));
  }
  const SignalMask explains =
      plan_->models().observers[path_->nodes[node].observer].moved;
  const Account account =
      AccountOf(early ? plan_->models().decision.detection_samples + 1 : t_k);
  // In between there are too few samples since.
  if (early || age_ > 2 * t_k) {
    tolerates_ = account.tolerates;
  }
  if (Acts(Rule::kAccounted) && !early && (account.lacks & explains) != 0) {
    misfit_ = std::max(misfit_, kUnaccounted);
  }
}

void StrengthTracker::PushAccount(const ObserverBank& bank, std::size_t channel,
                                  double residual) {
  const int c = static_cast<int>(channel);
  const double normal = bank.residual(0, c);
  if (bank.saturated(c) || std::isnan(residual) || std::isnan(normal)) {
    return;
  }
  const double sd = path_->points[channel].sd;  // of normal operation
  accounted_[channel].Fade(plan_->memory());
  accounted_[channel].Push(normal / sd, residual / sd);
}

// An observer that explains its own data, or knows none that normal operation
// does not, has to explain what is seen; any other one may tolerate it.
StrengthTracker::Account StrengthTracker::AccountOf(int least) const {
  const ModelSet& models = plan_->models();
  Account account;
  double most = 0.0;  // mean of r_0²
  double lacking = 0.0;
  for (std::size_t c = 0; c < channels_; ++c) {
    const SignalMask output = MaskOf(models.channels[c].output) & kRodSignals;
    if (output != 0 && accounted_[c].tells(least)) {
      const bool lacks = accounted_[c].share() < AccountedShare::kLeast;
      const double normal = accounted_[c].normal();
      most = std::max(most, normal);
      if (lacks) {
        account.lacks |= output;
        lacking = std::max(lacking, normal);
      }
    }
  }
  account.tolerates = lacking > 0.5 * most;
  return account;
}

}  // namespace fdi
