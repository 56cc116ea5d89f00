#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "diagnosis/model/sample.h"

namespace fdi {

/// Samples from one new reading of a transmitter to the next, where it is read
/// less often than samples are taken: a position that is polled by HART every
/// 30 s and stands in the rows between. 1: each sample had another reading, of
/// X and F alone; 0: each had one, which may repeat the last; kOnChange: a
/// value is new when it changes, as by exception.
struct ReadEvery {
  static constexpr int kOnChange = std::numeric_limits<int>::max();
  static constexpr int kNoRepeats = 1;

  int p1{0};
  int p2{0};
  int t1{0};
  int x{0};
  int f{0};

  bool operator==(const ReadEvery&) const = default;
};

/// The member of `signal`; null for those that are no transmitters. A command
/// that stands is the command.
int* EveryOf(ReadEvery& every, Signal signal);
/// Its value; 0 for those.
int SamplesOf(const ReadEvery& every, Signal signal);

/// The widest dead band within which historians keep a value to themselves, in
/// % of the span.
inline constexpr double kWidestDeadBand = 1.0;

/// Changes that a source does not tell.
struct Unseen {
  /// How far a value may be from the last one that came, by signal [unit].
  std::array<double, kSignalCount> changes{};
  SignalMask within{0};  ///< Those that would have been told of a larger one.
  /// It is not known yet whether values that repeat are readings.
  bool unknown{false};

  bool any() const { return changes != decltype(changes){}; }
};

/// Tells new readings from repeats. A polled transmitter changes only at
/// multiples of a fixed number of samples, whatever it measures. One that tells
/// a value on change changes at any time, but by more than its dead band, and
/// not by multiples of one step, as a coarse one would: two readings of a
/// process are never the same to the bit. The repeats of both become UNCERTAIN:
/// they stay in the past of the observers and are no evidence of anything.
/// After the time of a poll an unchanged value is a new reading, and so it is
/// after rows that are UNCERTAIN already. Where none ever repeated itself in
/// the record, one that does is none from the first sample on, until this is
/// known. O(1) a sample.
class HeldReadings {
 public:
  /// @param known what is known of the transmitters, before any reading.
  explicit HeldReadings(double period_s, const ReadEvery& known = {});

  void Mark(Sample& sample);

  /// More than every tenth reading so far was the last one again.
  bool Repeats(Signal signal) const;

  const ReadEvery& every() const { return every_; }

  /// Counts transmitters that are not read for each sample, and were not
  /// `known` not to be.
  Unseen unseen() const;
  /// These transmitters.
  SignalMask held() const;

 private:
  /// Fifteen of them at multiples by chance: below 1e-3 for every second
  /// sample, where an error only drops each second repeat, and below 1e-9 from
  /// ten samples on.
  static constexpr std::size_t kChanges = 16;

  struct Watch {
    bool begun{false};
    bool told{false};   // the source has said that it held since
    bool stood{false};  // in some sample since it changed
    double value{0.0};
    std::int64_t changed_ns{0};
    std::int64_t new_ns{0};
    std::array<double, kChanges> steps{};  // between changes [samples]
    std::array<double, kChanges> sizes{};  // of the changes
    std::size_t changes{0};
    std::size_t quick{0};  // changes from one sample to the next
    std::size_t repeats{0};
    bool has_dead_band{false};
  };

  static int Poll(const Watch& watch);
  static bool IsToldOnChange(const Watch& watch);
  bool IsWithin(Signal signal, const Sample& sample) const;
  void UpdateUnseen(Signal signal);
  static double DeadBandOf(const Watch& watch);
  void TakeChange(Signal signal, double step, double size);
  bool IsUnknown(Signal signal) const;

  double period_ns_;
  std::uint64_t source_id_{0};
  ReadEvery known_;
  ReadEvery every_;
  std::array<Watch, kSignalCount> watches_{};
  std::array<double, kSignalCount> unseen_{};
};

/// Marks a whole record from its first sample on. `at(k)` is sample k. @returns
/// which signals were held at its end and known to be for a quarter of it.
template <typename At>
ReadEvery MarkHeld(double period_s, std::size_t samples, At at) {
  HeldReadings search(period_s);
  std::array<std::size_t, kSignalCount> held{};
  const auto count = [&](ReadEvery every) {
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      const int* found = EveryOf(every, static_cast<Signal>(i));
      held[i] += found != nullptr && *found > 0 ? 1U : 0U;
    }
  };
  for (std::size_t k = 0; k < samples; ++k) {
    Sample copy = at(k);
    search.Mark(copy);
    count(search.every());
  }
  ReadEvery every = search.every();
  bool any = false;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if (int* found = EveryOf(every, signal)) {
      *found = 4 * held[i] > samples ? *found : 0;
      any = any || *found > 0;
      // A pressure or T1 that repeats is one for StuckReadings.
      if ((signal == Signal::kX || signal == Signal::kF) && *found == 0 &&
          !search.Repeats(signal)) {
        *found = ReadEvery::kNoRepeats;
      }
    }
  }
  HeldReadings marks(period_s, every);
  for (std::size_t k = 0; any && k < samples; ++k) {
    marks.Mark(at(k));
  }
  return every;
}

}  // namespace fdi
