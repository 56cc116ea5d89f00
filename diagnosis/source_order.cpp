#include "diagnosis/source_order.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace fdi {

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
  // Consecutive samples that keep another distance come from a publisher with
  // another period; a distance that a lost sample explains is a gap.
  if (has_stamp_) {
    const std::int64_t interval = sample.stamp_ns - last_stamp_ns_;
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

}  // namespace fdi
