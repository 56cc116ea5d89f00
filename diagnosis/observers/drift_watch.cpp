#include "diagnosis/observers/drift_watch.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <span>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/student.h"
#include "diagnosis/model/ts_model.h"

namespace fdi {
namespace {

constexpr double kSecondsPerHour = 3600.0;
constexpr std::array kBlockHours{0.5, 15.0};
constexpr std::size_t kLeastBlocks = 6;
constexpr double kSignificance = 0.999;  // one-sided

// Half of the least limit on a mean.
constexpr double kLeastDeviations = 0.25;
// A deviation of more than this many drifts came on top of it.
constexpr double kOnTop = 2.0;
// Between a small fault (.25) and a medium one (.5).
constexpr double kMedium = 0.375;
// In evidence windows: a fault that took hours may wait for a name.
constexpr double kMemories = 8.0;

double StepSquares(std::span<const double> y, double sum, double square) {
  double least = std::numeric_limits<double>::infinity();
  double before = 0.0;
  for (std::size_t i = 1; i < y.size(); ++i) {
    before += y[i - 1];
    const double after = sum - before;
    least =
        std::min(least, square - before * before / static_cast<double>(i) -
                            after * after / static_cast<double>(y.size() - i));
  }
  return least;
}

// Per block; the line ends half a block behind the middle of the last one.
std::optional<SlowDrift> LineThrough(std::span<const double> y, double least) {
  if (y.size() < kLeastBlocks) {
    return std::nullopt;
  }
  const auto n = static_cast<double>(y.size());
  const double middle = 0.5 * (n - 1.0);
  double sum = 0.0;
  double square = 0.0;
  double product = 0.0;
  for (std::size_t i = 0; i < y.size(); ++i) {
    sum += y[i];
    square += y[i] * y[i];
    product += (static_cast<double>(i) - middle) * y[i];
  }
  const double about = n * (n * n - 1.0) / 12.0;  // Σ (i − middle)²
  const double slope = product / about;
  const double left =
      std::max(square - sum * sum / n - product * product / about, 0.0);
  const double now = sum / n + slope * (n - middle - 0.5);
  const double error = std::sqrt(left / (n - 2.0) / about);
  if (now * slope <= 0.0 || std::abs(now) < least ||
      std::abs(slope) < StudentQuantile(kSignificance, n - 2.0) * error ||
      left >= StepSquares(y, sum, square)) {
    return std::nullopt;
  }
  return SlowDrift{now, slope, std::min(now / slope, n)};
}

// With X among its regressors, a flow tells whether it is the one that belongs
// to X.
bool MovesWithX(const ModelSet& models, std::size_t channel) {
  const TsModel& model = models.observers.front().channels[channel].model;
  return model.output == Signal::kX ||
         (model.output == Signal::kF &&
          (RequiredSignals(model) & MaskOf(Signal::kX)) == 0);
}

}  // namespace

SlowMemory::SlowMemory(double period_s) {
  for (std::size_t i = 0; i < spans_.size(); ++i) {
    spans_[i].hours = kBlockHours[i];
    spans_[i].length = std::max<std::int64_t>(
        std::llround(kBlockHours[i] * kSecondsPerHour / period_s), 1);
  }
}

void SlowMemory::Restart() {
  for (Span& span : spans_) {
    span.count = 0;
    span.sum = 0.0;
    span.filled = 0;
  }
}

bool SlowMemory::Push(double residual) {
  bool ended = false;
  for (Span& span : spans_) {
    span.sum += residual;
    if (++span.count < span.length) {
      continue;
    }
    if (span.filled == kBlocks) {
      std::rotate(span.means.begin(), span.means.begin() + 1, span.means.end());
    }
    span.filled = std::min<std::uint64_t>(span.filled + 1, kBlocks);
    span.means[span.filled - 1] = span.sum / static_cast<double>(span.count);
    span.count = 0;
    span.sum = 0.0;
    ended = true;
  }
  return ended;
}

std::optional<SlowDrift> SlowMemory::Line(double least) const {
  for (const Span& span : spans_) {
    const auto line =
        LineThrough(std::span(span.means).first(span.filled), least);
    if (line) {
      return SlowDrift{line->now, line->slope / span.hours,
                       line->hours * span.hours};
    }
  }
  return std::nullopt;
}

void SlowMemory::Save(SnapshotWriter& writer) const {
  for (const Span& span : spans_) {
    writer.Put(span.count, span.sum, span.filled);
    for (std::size_t i = 0; i < span.filled; ++i) {
      writer.Put(span.means[i]);
    }
  }
}

bool SlowMemory::Restore(SnapshotReader& reader) {
  for (Span& span : spans_) {
    if (!reader.Get(span.count, span.sum, span.filled) || span.count < 0 ||
        span.count >= span.length || !std::isfinite(span.sum) ||
        span.filled > kBlocks) {
      return false;
    }
    for (std::size_t i = 0; i < span.filled; ++i) {
      if (!reader.Get(span.means[i]) || !std::isfinite(span.means[i])) {
        return false;
      }
    }
  }
  return true;
}

void AddDriftFinding(ModelSet& models) {
  const bool has_x = std::ranges::any_of(
      models.channels,
      [](const ChannelSpec& channel) { return channel.output == Signal::kX; });
  if (models.floor && has_x && models.decision.interpolation_allowance > 0.0) {
    models.faults.push_back(kPositionDrift);
  }
}

DriftWatch::DriftWatch(const ModelSet& models)
    : models_(&models),
      memory_(models.sample_period_s),
      recent_(static_cast<int>(models.decision.evidence_window)) {
  if (FaultIndex(models, kPositionDrift) < 0) {
    return;
  }
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    follow_ |= MovesWithX(models, c) ? std::uint32_t{1} << c : 0;
    if (models.channels[c].output == Signal::kX) {
      channel_ = c;
      watches_ = true;
    }
  }
  least_ = kLeastDeviations *
           models.observers.front().channels[channel_].residual_sd;
  // Undetectable faults look normal, so they explain nothing.
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    const int fault = models.faults[i];
    faults_ |= IsFault(fault) && !Contains(models.undetectable, fault)
                   ? FaultSet{1} << i
                   : 0;
  }
}

void DriftWatch::Restart() {
  memory_.Restart();
  recent_.Restart();
  line_.reset();
  drift_.reset();
}

bool DriftWatch::Restore(SnapshotReader& reader) {
  const bool restored = memory_.Restore(reader);
  line_ = restored ? memory_.Line(least_) : std::nullopt;
  return restored;
}

void DriftWatch::Push(const Verdict& verdict, std::uint32_t beyond) {
  const double residual = verdict.residuals[channel_];
  ended_ = false;
  if (!watches_ || !std::isfinite(residual)) {
    return;
  }
  recent_.Push(residual);
  ended_ = memory_.Push(residual);
  line_ = ended_ ? memory_.Line(least_) : line_;
  if (!drift_) {
    return;
  }
  drift_ = ended_ && line_ ? line_ : drift_;
  Judge(beyond);
}

// A step on top of the drift, and another channel, speak against it for as long
// as they last.
void DriftWatch::Judge(std::uint32_t beyond) {
  const bool against = !Alone(beyond) || OnTop();
  against_ = std::max(against_ + (against ? 1 : -1), 0);
  const double window = models_->decision.evidence_window;
  if (against_ > window || (age_ >= kMemories * window &&
                            share_ >= models_->decision.join_fraction)) {
    drift_.reset();
  }
}

bool DriftWatch::OnTop() const {
  return std::abs(recent_.mean()) > kOnTop * std::abs(drift_->now);
}

void DriftWatch::Begin(std::uint32_t beyond) {
  drift_.reset();
  if (watches_ && beyond != 0 && Alone(beyond)) {
    Take();
  }
}

void DriftWatch::Take() {
  drift_ = line_;
  against_ = 0;
  age_ = 0;
  share_ = 0.0;
  if (drift_ && OnTop()) {
    drift_.reset();
  }
}

bool DriftWatch::Emerges() {
  drift_.reset();
  if (ended_ && recent_.full() && present()) {
    Take();
  }
  return drift_.has_value();
}

bool DriftWatch::present() const {
  constexpr double kShare = 0.5;
  return line_ && recent_.mean() / line_->now >= kShare;
}

void DriftWatch::Follow(const Verdict& verdict) {
  if (!drift_ || verdict.state == State::kNormal) {
    drift_.reset();
    return;
  }
  bool medium = false;
  for (FaultSet left = faults_; left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    medium = medium || (verdict.fault_factors[i] >=
                            models_->decision.isolation_threshold &&
                        std::abs(verdict.strengths[i]) >= kMedium);
  }
  ++age_;
  const double gain = std::max(
      1.0 / age_, 1.0 / (kMemories * models_->decision.evidence_window));
  share_ += gain * ((medium ? 1.0 : 0.0) - share_);
}

}  // namespace fdi
