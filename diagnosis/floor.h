#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diagnosis/model_set.h"
#include "diagnosis/sample.h"

namespace fdi {

/// Where the rod is a sample later, under `command` [%].
double Follow(const FloorLimits::Rod& rod, double x, double command);

/// The positions that the rod of a healthy valve may have: those of the
/// quickest and the slowest answer, x ← x + min(s |u − x|, v) sign(u − x), and
/// all between. Before it leaves a stop, and at the start, the slowest waits:
/// a chamber has to be filled or emptied first.
class RodBand {
 public:
  /// `limits` must outlive it.
  explicit RodBand(const FloorLimits& limits) : limits_(&limits) {}

  void Restart(double x);
  void Step(double command);

  double quick() const { return quick_; }
  double slow() const { return slow_; }
  /// By how much `x` is outside [%], positive above.
  double Beyond(double x) const;

 private:
  const FloorLimits* limits_;
  std::array<double, kMaxLag> commands_{};
  double quick_{0.0};
  double slow_{0.0};
  int wait_{0};  // samples that the slow rod still rests
  bool resting_{true};
};

/// F(X, P1 − P2) of the floor; `dp` may be negative.
double FlowAt(const FloorLimits& floor, double x, double dp);

/// The limits that never sleep (FloorLimits): they hold in AUTO at every
/// command, within the trained region and outside, from the first sample on.
///
///     travel_deviation  X is none of the positions that the rod may have
///     shut_flow         F > m F_high although CV and X are shut
///     excess_flow       F > c F(X − deviation/2, P1 − P2) + m F_high
///     x_stuck           X repeats, to the bit, while the rod should travel
///     f_stuck           F likewise, while F(X, P1 − P2) changes
///
/// They tell that something is wrong, not what: names of their own, until a
/// fault is named.
class Floor {
 public:
  /// `models` must outlive it.
  explicit Floor(const ModelSet& models);

  /// Nothing is known: the rod is where the next reading says.
  void Restart();

  /// Takes every accepted sample. Other modes than AUTO restart it; UNCERTAIN
  /// readings are not tested.
  void Push(const Sample& sample);

  /// What is found right now; never anything without a floor.
  FaultSet findings() const { return findings_; }
  /// Stamp of the first sample of the earliest of its runs.
  std::optional<std::int64_t> stamp_ns() const;
  /// By how much a finding is beyond its model, in shares of the span, signed.
  double size(std::size_t finding) const { return tests_[finding].size; }
  /// Fault index of its first finding; the others follow.
  std::size_t first() const { return first_; }
  static constexpr std::size_t kTests = 5;

 private:
  struct Test {  // a run of samples beyond a limit
    int length{0};
    std::int64_t since_ns{0};
    double size{0.0};
    bool found{false};
  };
  /// Two accounts of what a reading should follow.
  using Expectations = std::array<double, 2>;
  struct Repeat {  // a run of samples with one reading
    double reading{0.0};
    std::int64_t since_ns{0};
    int length{0};
    Expectations lowest{};
    Expectations highest{};
  };

  double Expected(double x, const Sample& sample) const;
  void Count(int finding, bool beyond, double size, int needed,
             std::int64_t stamp_ns);
  void Watch(int finding, double reading, Expectations expected, double most,
             bool counts, const Sample& sample, Repeat& repeat);
  void PushTravel(const Sample& sample);
  void PushFlow(const Sample& sample);

  const FloorLimits* limits_;  // null: no floor
  std::size_t first_;
  std::optional<RodBand> rod_;
  bool follows_{false};
  std::array<Test, kTests> tests_{};
  Repeat position_;
  Repeat flow_;
  FaultSet findings_{0};
};

}  // namespace fdi
