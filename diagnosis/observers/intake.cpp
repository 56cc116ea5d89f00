#include "diagnosis/observers/intake.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "diagnosis/model/fault_catalogue.h"

namespace fdi {
namespace {

constexpr std::int64_t kFarNs = std::int64_t{1} << 61;  // 73 years.

}  // namespace

SourceOrder::SourceOrder(double sample_period_s) : period_ns_(0) {
  SetPeriod(sample_period_s);
}

void SourceOrder::SetPeriod(double sample_period_s) {
  period_ns_ = std::llround(sample_period_s * 1e9);
  off_period_ = 0;
}

bool SourceOrder::Superseded(std::uint64_t source_id) const {
  const int known = std::min(superseded_count_, kRemembered);
  return std::find(superseded_.begin(), superseded_.begin() + known,
                   source_id) != superseded_.begin() + known;
}

SourceOrder::Placement SourceOrder::Place(const Sample& sample) {
  Placement placement;
  if (!has_source_ || sample.source_id != source_id_) {
    if (Superseded(sample.source_id)) {
      placement.intake = Intake::kSuperseded;
      return placement;
    }
    if (has_source_) {
      superseded_[static_cast<std::size_t>(superseded_count_++ % kRemembered)] =
          source_id_;
    }
    placement.new_source = true;
    has_source_ = true;
    has_stamp_ = false;
    off_period_ = 0;
    source_id_ = sample.source_id;
  } else if (sample.seq <= last_seq_) {
    placement.intake =
        sample.seq == last_seq_ ? Intake::kRepeat : Intake::kLate;
    return placement;
  }
  // Consecutive samples with a different, constant interval come from a
  // publisher with another period; an interval explained by lost samples is a
  // gap.
  if (has_stamp_) {
    // Stamps up to 400 years apart would overflow in nanoseconds.
    const std::int64_t interval =
        std::clamp(sample.stamp_ns - last_stamp_ns_, -kFarNs, kFarNs);
    const bool consecutive = sample.seq == last_seq_ + 1;
    placement.gap = std::abs(interval - period_ns_) > period_ns_ / 2;
    const bool steady =
        std::abs(interval - off_interval_ns_) <= period_ns_ / 10;
    off_period_ = !placement.gap || !consecutive ? 0
                  : off_period_ == 0 || steady   ? off_period_ + 1
                                                 : 1;
    off_interval_ns_ = interval;
  }
  last_seq_ = sample.seq;
  last_stamp_ns_ = sample.stamp_ns;
  has_stamp_ = true;
  if (off_period_ >= kPeriodStrikes) {
    off_period_ = kPeriodStrikes;
    placement.intake = Intake::kPeriod;
  }
  return placement;
}

bool Bridge::Mend(SignalMask unusable, const Sample& past, Sample& sample) {
  length_ = unusable == 0 ? 0 : std::min(length_ + 1, kMost + 1);
  if (length_ > kMost) {
    return false;
  }
  for (unsigned left = unusable; left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    sample.Set(static_cast<Signal>(i), past.values[i]);
    sample.quality[i] = SignalQuality::kUncertain;
  }
  return true;
}

StuckReadings::StuckReadings(const ModelSet& models) {
  const auto watch = [&](Signal signal, int fault, int limit) {
    const int index = FaultIndex(models, fault);
    return Watch{signal, index < 0 ? 0 : limit,
                 index < 0 ? 0 : FaultSet{1} << index};
  };
  watches_ = {
      watch(Signal::kT1, kTemperatureTransmitterFault, models.stuck.t1),
      watch(Signal::kP1, kInletPressureTransmitterFault, models.stuck.p1),
      watch(Signal::kP2, kOutletPressureTransmitterFault, models.stuck.p2)};
}

void StuckReadings::Restart() {
  for (Watch& watch : watches_) {
    watch.length = 0;
  }
  faults_ = 0;
}

void StuckReadings::Push(const Sample& sample) {
  faults_ = 0;
  const SignalMask uncertain = sample.uncertain();
  for (Watch& watch : watches_) {
    if (watch.limit == 0 || !sample.Has(watch.signal)) {
      watch.length = 0;
      continue;
    }
    if ((uncertain & MaskOf(watch.signal)) == 0) {
      const double reading = sample[watch.signal];
      watch.length = watch.length > 0 && reading == watch.reading
                         ? std::min(watch.length, watch.limit + 1) + 1
                         : 1;
      watch.reading = reading;
      if (watch.length == watch.limit + 1) {
        watch.since_ns = sample.stamp_ns;
      }
    }
    faults_ |= watch.length > watch.limit ? watch.fault : 0;
  }
}

std::optional<std::int64_t> StuckReadings::stamp_ns() const {
  std::optional<std::int64_t> stamp;
  for (const Watch& watch : watches_) {
    if ((faults_ & watch.fault) != 0) {
      stamp = std::min(stamp.value_or(watch.since_ns), watch.since_ns);
    }
  }
  return stamp;
}

}  // namespace fdi
