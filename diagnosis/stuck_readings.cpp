#include "diagnosis/stuck_readings.h"

#include <algorithm>

#include "diagnosis/fault_catalogue.h"

namespace fdi {

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
  for (Watch& watch : watches_) {
    if (watch.limit == 0 || !sample.Has(watch.signal)) {
      watch.length = 0;
      continue;
    }
    const double reading = sample[watch.signal];
    watch.length = watch.length > 0 && reading == watch.reading
                       ? std::min(watch.length, watch.limit + 1) + 1
                       : 1;
    watch.reading = reading;
    if (watch.length == watch.limit + 1) {
      watch.since_ns = sample.stamp_ns;
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
