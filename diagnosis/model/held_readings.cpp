#include "diagnosis/model/held_readings.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace fdi {

int* EveryOf(ReadEvery& every, Signal signal) {
  switch (signal) {
    case Signal::kP1:
      return &every.p1;
    case Signal::kP2:
      return &every.p2;
    case Signal::kT1:
      return &every.t1;
    case Signal::kX:
      return &every.x;
    case Signal::kF:
      return &every.f;
    default:
      return nullptr;
  }
}

HeldReadings::HeldReadings(double period_s, const ReadEvery& known)
    : period_ns_(1e9 * period_s), every_(known) {}

void HeldReadings::Mark(Sample& sample) {
  for (const Signal signal :
       {Signal::kP1, Signal::kP2, Signal::kT1, Signal::kX, Signal::kF}) {
    const std::size_t i = Index(signal);
    if (!sample.Has(signal) || sample.quality[i] == SignalQuality::kBad) {
      continue;
    }
    Watch& watch = watches_[i];
    int& every = *EveryOf(every_, signal);
    const auto since = [&](std::int64_t stamp_ns) {
      return static_cast<double>(sample.stamp_ns - stamp_ns) / period_ns_;
    };
    if (!watch.begun || sample.values[i] != watch.value) {
      if (watch.begun) {
        TakeChange(std::round(since(watch.changed_ns)), watch, every);
      }
      watch.begun = true;
      watch.value = sample.values[i];
      watch.changed_ns = watch.new_ns = sample.stamp_ns;
    } else if (const double age = since(watch.new_ns);
               age >= 0.0 && age < every - 0.5) {
      sample.quality[i] = SignalQuality::kUncertain;
    } else {
      watch.new_ns = sample.stamp_ns;
    }
  }
}

// The poll is the mean of the steps about the shortest but one, which may be a
// retry. One of the steps may fit by no multiple of it.
void HeldReadings::TakeChange(double step, Watch& watch, int& every) const {
  watch.steps[watch.changes++ % kChanges] = step;
  if (watch.changes < kChanges || watch.changes % (kChanges / 2) != 0) {
    return;
  }
  every = 0;
  // Nearly every transmitter is read for each sample.
  if (std::ranges::count_if(watch.steps, [](double s) { return s < 2.0; }) >
      1) {
    return;
  }
  std::array<double, kChanges> sorted = watch.steps;
  std::ranges::sort(sorted);
  const double shortest = sorted[1];
  const auto end = std::ranges::upper_bound(sorted, 1.5 * shortest);
  double poll = 0.0;
  for (auto at = sorted.begin() + 1; at != end; ++at) {
    poll += *at / static_cast<double>(end - sorted.begin() - 1);
  }
  const auto fits = std::ranges::count_if(sorted, [&](double s) {
    return std::abs(std::remainder(s, poll)) <= std::max(0.5, 0.1 * poll);
  });
  if (fits + 1 >= static_cast<std::ptrdiff_t>(kChanges)) {
    every = static_cast<int>(std::lround(poll));
  }
}

}  // namespace fdi
