#include "monitor/trace.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

// Four rings of equal length hold one row for each instant: head, signals,
// residuals and factors. A factor is kept in 1/32768 and a residual as a float,
// which is enough to show; signals stay exact, because what is stored of an
// episode may be learnt from (docs/learning.md).
namespace fdi::monitor {
namespace {

constexpr std::size_t kFirstGrowth = 32;
constexpr double kFactorSteps = 32768.0;

std::uint16_t PackFactor(double factor) {
  const double bounded =
      std::isfinite(factor) ? std::clamp(factor, 0.0, 1.0) : 0.0;
  return static_cast<std::uint16_t>(std::lround(bounded * kFactorSteps));
}

std::uint32_t PackQuality(const Sample& sample) {
  std::uint32_t bits = 0;
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    bits |= static_cast<std::uint32_t>(sample.quality[s]) << (2 * s);
  }
  return bits;
}

// Rotates a ring of rows of `columns` values so that its oldest row, at
// `first`, comes to the front, and resizes it to `rows`.
template <typename T>
void Linearize(std::vector<T>& ring, std::size_t first, std::size_t columns,
               std::size_t rows) {
  std::rotate(ring.begin(),
              ring.begin() + static_cast<std::ptrdiff_t>(first * columns),
              ring.end());
  ring.reserve(rows * columns);
  ring.resize(rows * columns);
}

}  // namespace

bool Trace::Continues(const Sample& sample, const Verdict& verdict,
                      int channels, int faults) const {
  return size_ > 0 && sample.source_id == layout_.source_id &&
         sample.epoch == layout_.epoch &&
         sample.flow_unit == layout_.flow_unit &&
         (sample.present & ~layout_.signals) == 0 &&
         (!keeps_isolated_ || verdict.isolated == layout_.isolated) &&
         static_cast<std::size_t>(channels) == layout_.channels &&
         static_cast<std::size_t>(faults) == layout_.faults;
}

void Trace::Begin(const Sample& sample, const Verdict& verdict, int channels,
                  int faults) {
  *this = Trace(capacity_, span_ns_, keeps_isolated_);
  layout_.source_id = sample.source_id;
  layout_.epoch = sample.epoch;
  layout_.flow_unit = sample.flow_unit;
  layout_.signals = sample.present;
  layout_.isolated = keeps_isolated_ ? verdict.isolated : 0;
  layout_.signal_count =
      static_cast<std::size_t>(std::popcount(sample.present));
  layout_.channels = static_cast<std::size_t>(channels);
  layout_.faults = static_cast<std::size_t>(faults);
}

// The rings double up to the capacity, so that a short trace takes little
// memory.
void Trace::Grow() {
  const std::size_t rows =
      std::min(capacity_, std::max(kFirstGrowth, 2 * heads_.size()));
  Linearize(heads_, first_, 1, rows);
  Linearize(values_, first_, layout_.signal_count, rows);
  Linearize(residuals_, first_, layout_.channels, rows);
  Linearize(factors_, first_, layout_.faults + 1, rows);
  first_ = 0;
}

void Trace::MakeRoom(std::int64_t stamp_ns) {
  // First what is too old, then, if the rings are full at their capacity, the
  // oldest.
  while (size_ > 0 && stamp_ns - heads_[first_].stamp_ns > span_ns_) {
    first_ = Row(1);
    --size_;
  }
  if (size_ == heads_.size() && size_ < capacity_) {
    Grow();
  } else if (size_ == heads_.size()) {
    first_ = Row(1);
    --size_;
  }
}

void Trace::Push(const Sample& sample, const Verdict& verdict, int channels,
                 int faults) {
  if (!Continues(sample, verdict, channels, faults)) {
    Begin(sample, verdict, channels, faults);
  }
  MakeRoom(sample.stamp_ns);
  const std::size_t row = Row(size_++);
  heads_[row] = {sample.stamp_ns, sample.seq,     PackQuality(sample),
                 sample.present,  verdict.intake, verdict.quality,
                 verdict.state,   sample.mode,    verdict.initialised};
  std::size_t value = row * layout_.signal_count;
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    if ((layout_.signals >> s & 1U) != 0) {
      // A missing signal keeps its column, so that all rows have one size.
      values_[value++] = sample.values[s];
    }
  }
  for (std::size_t c = 0; c < layout_.channels; ++c) {
    residuals_[row * layout_.channels + c] =
        static_cast<float>(verdict.residuals[c]);
  }
  std::uint16_t* factors = &factors_[row * (layout_.faults + 1)];
  factors[0] = PackFactor(verdict.normal_factor);
  for (std::size_t f = 0; f < layout_.faults; ++f) {
    factors[f + 1] = PackFactor(verdict.fault_factors[f]);
  }
}

TracePoint Trace::PointAt(std::size_t row) const {
  const Head& head = heads_[row];
  TracePoint point;
  Sample& sample = point.sample;
  sample.stamp_ns = head.stamp_ns;
  sample.seq = head.seq;
  sample.source_id = layout_.source_id;
  sample.epoch = layout_.epoch;
  sample.flow_unit = layout_.flow_unit;
  sample.present = head.present;
  sample.mode = head.mode;
  std::size_t value = row * layout_.signal_count;
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    sample.quality[s] =
        static_cast<SignalQuality>(head.signal_quality >> (2 * s) & 3U);
    if ((layout_.signals >> s & 1U) != 0) {
      sample.values[s] = values_[value++];
    }
  }
  point.intake = head.intake;
  point.initialised = head.initialised;
  point.quality = head.quality;
  point.state = head.state;
  point.isolated = layout_.isolated;
  for (std::size_t c = 0; c < layout_.channels; ++c) {
    point.residuals.push_back(
        static_cast<double>(residuals_[row * layout_.channels + c]));
  }
  const std::uint16_t* factors = &factors_[row * (layout_.faults + 1)];
  point.normal_factor = factors[0] / kFactorSteps;
  for (std::size_t f = 0; f < layout_.faults; ++f) {
    point.factors.push_back(factors[f + 1] / kFactorSteps);
  }
  return point;
}

std::vector<TracePoint> Trace::Unpack(std::size_t count) const {
  std::vector<TracePoint> points;
  points.reserve(std::min(count, size_));
  for (std::size_t i = size_ - std::min(count, size_); i < size_; ++i) {
    points.push_back(PointAt(Row(i)));
  }
  return points;
}

Trace Trace::Take() {
  return std::exchange(*this, Trace(capacity_, span_ns_, keeps_isolated_));
}

std::size_t Trace::bytes() const {
  return heads_.capacity() * sizeof(Head) +
         values_.capacity() * sizeof(double) +
         residuals_.capacity() * sizeof(float) +
         factors_.capacity() * sizeof(std::uint16_t);
}

}  // namespace fdi::monitor
