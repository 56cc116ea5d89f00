#include "diagnosis/model/held_readings.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

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

int SamplesOf(const ReadEvery& every, Signal signal) {
  ReadEvery copy = every;
  const int* of_signal = EveryOf(copy, signal);
  return of_signal != nullptr ? *of_signal : 0;
}

namespace {

// The largest of later changes is not among sixteen. With 1, three of four
// valves in a loop had an episode a day, with 1.5 none; the results are those
// of others.
constexpr double kRarer = 1.5;
// In 64 changes by more than half.
constexpr double kFading = 1.0 / 8.0;

// There a reading repeats itself because its range ends.
bool IsEnd(Signal signal, double value) {
  return value == 0.0 || (signal == Signal::kX && value == 100.0);
}

}  // namespace

HeldReadings::HeldReadings(double period_s, const ReadEvery& known)
    : period_ns_(1e9 * period_s), known_(known), every_(known) {}

void HeldReadings::Mark(Sample& sample) {
  // Between the stamps of two publishers nothing is held.
  if (std::exchange(source_id_, sample.source_id) != sample.source_id) {
    every_ = known_;
    watches_ = {};
    unseen_ = {};
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if (!sample.Has(signal) || sample.quality[i] == SignalQuality::kBad) {
      continue;
    }
    Watch& watch = watches_[i];
    if (sample.quality[i] == SignalQuality::kUncertain) {
      watch.told = watch.stood = true;
      ++watch.repeats;
      if (IsWithin(signal, sample)) {
        sample.quality[i] = SignalQuality::kGood;
      }
      continue;
    }
    const int every = SamplesOf(every_, signal);
    const auto since = [&](std::int64_t stamp_ns) {
      return static_cast<double>(sample.stamp_ns - stamp_ns) / period_ns_;
    };
    const double value = sample.values[i];
    const double age = since(watch.new_ns);
    if (!watch.begun || value != watch.value) {
      if (watch.begun) {
        // A sample that is lost says nothing of a value that stood.
        TakeChange(signal,
                   watch.stood ? std::round(since(watch.changed_ns)) : 1.0,
                   std::abs(value - watch.value));
      }
      watch.begun = true;
      watch.stood = false;
      watch.value = value;
      watch.changed_ns = watch.new_ns = sample.stamp_ns;
    } else if (IsEnd(signal, value) && (every <= ReadEvery::kNoRepeats ||
                                        every == ReadEvery::kOnChange)) {
      watch.changed_ns = watch.new_ns = sample.stamp_ns;
    } else if (!watch.told && age >= 0.0 &&
               (age < every - 0.5 || every == ReadEvery::kNoRepeats)) {
      sample.quality[i] = IsWithin(signal, sample) ? SignalQuality::kGood
                                                   : SignalQuality::kUncertain;
      watch.stood = true;
      ++watch.repeats;
    } else {
      watch.new_ns = sample.stamp_ns;
      watch.stood = true;
      ++watch.repeats;
    }
    watch.told = false;
  }
}

bool HeldReadings::Repeats(Signal signal) const {
  const Watch& watch = watches_[Index(signal)];
  return watch.changes < kChanges || 10 * watch.repeats > watch.changes;
}

Unseen HeldReadings::unseen() const {
  Unseen unseen;
  unseen.unknown = IsUnknown(known_.x != 0 ? Signal::kX : Signal::kF);
  if (unseen_[Index(Signal::kX)] == 0.0 && unseen_[Index(Signal::kF)] == 0.0) {
    return unseen;
  }
  unseen.changes = unseen_;
  for (const Signal signal : {Signal::kX, Signal::kF}) {
    unseen.within = static_cast<SignalMask>(
        unseen.within |
        (watches_[Index(signal)].has_dead_band ? MaskOf(signal) : 0));
  }
  // A command may go in steps, which the rod follows at once.
  double& command = unseen.changes[Index(Signal::kCv)];
  command =
      std::min(command, std::max(kWidestDeadBand, unseen_[Index(Signal::kX)]));
  return unseen;
}

// No longer silent than lately.
bool HeldReadings::IsWithin(Signal signal, const Sample& sample) const {
  const Watch& watch = watches_[Index(signal)];
  return (signal == Signal::kX || signal == Signal::kF) &&
         watch.has_dead_band && sample[signal] == watch.value &&
         static_cast<double>(sample.stamp_ns - watch.changed_ns) <=
             period_ns_ * *std::ranges::max_element(watch.steps);
}

SignalMask HeldReadings::held() const {
  unsigned held = 0;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    held |= signal != Signal::kCv && unseen_[i] > 0.0 ? MaskOf(signal) : 0U;
  }
  return static_cast<SignalMask>(held);
}

// In an hour the slowest source has told of sixteen changes.
bool HeldReadings::IsUnknown(Signal signal) const {
  constexpr double kHourNs = 3.6e12;
  const Watch& watch = watches_[Index(signal)];
  return SamplesOf(known_, signal) == ReadEvery::kNoRepeats &&
         watch.changes < kChanges && watch.repeats > 0 &&
         static_cast<double>(watch.repeats) * period_ns_ < kHourNs;
}

void HeldReadings::TakeChange(Signal signal, double step, double size) {
  Watch& watch = watches_[Index(signal)];
  const std::size_t at = watch.changes++ % kChanges;
  watch.steps[at] = step;
  watch.sizes[at] = size;
  watch.quick += step < 2.0 ? 1U : 0U;
  if (watch.changes < kChanges || watch.changes % (kChanges / 2) != 0) {
    return;
  }
  if (int* every = EveryOf(every_, signal)) {
    *every = Poll(watch);
    if (*every == 0 && IsToldOnChange(watch)) {
      *every = ReadEvery::kOnChange;
    }
  }
  UpdateUnseen(signal);
}

// A finding fades slowly: a signal that changes quickly for a while looks
// as if each sample had a reading, and one that rests is told of its noise,
// after a time limit.
void HeldReadings::UpdateUnseen(Signal signal) {
  Watch& watch = watches_[Index(signal)];
  const int every = signal == Signal::kCv && IsToldOnChange(watch)
                        ? ReadEvery::kOnChange
                        : SamplesOf(every_, signal);
  if (every <= ReadEvery::kNoRepeats ||
      SamplesOf(known_, signal) > ReadEvery::kNoRepeats) {
    return;
  }
  const bool has_dead_band = every == ReadEvery::kOnChange && watch.quick > 1;
  const double found = has_dead_band
                           ? DeadBandOf(watch)
                           : kRarer * *std::ranges::max_element(watch.sizes);
  double& unseen = unseen_[Index(signal)];
  unseen = std::exchange(watch.has_dead_band, has_dead_band) == has_dead_band
               ? std::max(found, unseen + kFading * (found - unseen))
               : found;
}

// After a repeat a change is hardly larger than the dead band.
double HeldReadings::DeadBandOf(const Watch& watch) {
  std::array<double, kChanges> sizes{};
  std::size_t count = 0;
  for (std::size_t k = 0; k < kChanges; ++k) {
    if (watch.steps[k] > 1.0) {
      sizes[count++] = watch.sizes[k];
    }
  }
  std::sort(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(count));
  return sizes[count / 4];
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
