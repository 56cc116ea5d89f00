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

namespace {

// There a reading repeats itself because its range ends.
bool IsEnd(Signal signal, double value) {
  return value == 0.0 || (signal == Signal::kX && value == 100.0);
}

}  // namespace

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
    if (sample.quality[i] == SignalQuality::kUncertain) {
      watch.told = true;
      continue;
    }
    int& every = *EveryOf(every_, signal);
    const auto since = [&](std::int64_t stamp_ns) {
      return static_cast<double>(sample.stamp_ns - stamp_ns) / period_ns_;
    };
    const double value = sample.values[i];
    const double age = since(watch.new_ns);
    if (!watch.begun || value != watch.value) {
      if (watch.begun) {
        TakeChange(std::round(since(watch.changed_ns)),
                   std::abs(value - watch.value), watch, every);
      }
      watch.begun = true;
      watch.value = value;
      watch.changed_ns = watch.new_ns = sample.stamp_ns;
    } else if (IsEnd(signal, value) &&
               (every == 0 || every == ReadEvery::kOnChange)) {
      watch.changed_ns = watch.new_ns = sample.stamp_ns;
    } else if (!watch.told && age >= 0.0 && age < every - 0.5) {
      sample.quality[i] = SignalQuality::kUncertain;
    } else {
      watch.new_ns = sample.stamp_ns;
    }
    watch.told = false;
  }
}

void HeldReadings::TakeChange(double step, double size, Watch& watch,
                              int& every) const {
  const std::size_t at = watch.changes++ % kChanges;
  watch.steps[at] = step;
  watch.sizes[at] = size;
  if (watch.changes < kChanges || watch.changes % (kChanges / 2) != 0) {
    return;
  }
  every = Poll(watch);
  if (every == 0 && IsToldOnChange(watch)) {
    every = ReadEvery::kOnChange;
  }
}

// The poll is the mean of the steps about the shortest but one, which may be a
// retry. One of the steps may fit by no multiple of it.
int HeldReadings::Poll(const Watch& watch) {
  // Nearly every transmitter is read for each sample.
  if (std::ranges::count_if(watch.steps, [](double s) { return s < 2.0; }) >
      1) {
    return 0;
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
  return fits + 1 >= static_cast<std::ptrdiff_t>(kChanges)
             ? static_cast<int>(std::lround(poll))
             : 0;
}

// A third of the changes come after repeats, and their sizes differ by less
// than an eighth of what nearly all of them have: they are no multiples of a
// resolution. What is told now and then although it has hardly changed is not
// counted. The differences of a coarse transmitter are 0 or 1 of its step; the
// closest two of sixteen sizes at random differ by about a hundredth.
bool HeldReadings::IsToldOnChange(const Watch& watch) {
  constexpr std::size_t kFewest = kChanges / 4;
  constexpr double kFine = 1.0 / 8.0;
  constexpr double kSame = 1e-4;  // errors of conversion
  const auto after_repeats = static_cast<std::size_t>(
      std::ranges::count_if(watch.steps, [](double s) { return s > 1.0; }));
  if (3 * after_repeats < kChanges) {
    return false;
  }
  std::array<double, kChanges> sizes = watch.sizes;
  std::ranges::sort(sizes);
  const double size = sizes[kFewest];
  for (std::size_t k = 1; k < kChanges; ++k) {
    const double finer = sizes[k] - sizes[k - 1];
    if (finer > kSame * size && finer < kFine * size) {
      return true;
    }
  }
  return false;
}

}  // namespace fdi
