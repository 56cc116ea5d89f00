#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/sustained.h"

namespace fdi {

/// Rod position one sample later, for a constant `command` [%].
double NextRodPosition(const FloorLimits::Rod& rod, double x, double command);

/// The range of positions that the rod of a healthy valve may have. It moves by
/// x ← x + min(s |u − x|, v) sign(u − x), with s and v from those of the
/// quickest to those of the slowest response, which need not be the same both
/// ways: a rod may follow a step quickly and come back slowly. So each end of
/// the range goes outwards with the quickest response and inwards with the
/// slowest. Before leaving a stop, and at the start, the slowest waits because
/// a chamber has to be filled or vented first.
class RodBand {
 public:
  /// `limits` must outlive it.
  explicit RodBand(const FloorLimits& limits) : limits_(&limits) {}

  void Restart(double x);
  void Step(double command);

  double quick() const { return quick_; }
  double slow() const { return slow_; }
  double most_open() const { return lowest_; }
  double least_open() const { return highest_; }
  /// Distance of `x` from the range [%], positive above.
  double Beyond(double x) const;

 private:
  const FloorLimits* limits_;
  std::array<double, kMaxLag> commands_{};
  double quick_{0.0};
  double slow_{0.0};
  double lowest_{0.0};
  double highest_{0.0};
  int wait_{0};  // samples for which the slow rod stays at rest
  bool resting_{true};
};

/// f(X) of the floor.
double FlowShapeAt(const FloorLimits& floor, double x);
/// F(X, P1 − P2) of the floor; `dp` may be negative.
double FlowAt(const FloorLimits& floor, double x, double dp);

/// P1 − P2, or the usual one where they are not measured [kPa].
double DpOf(const FloorLimits& floor, const Sample& sample);

/// The least flow through the opening, before the share of the floor: F(X +
/// deviation/2, dp), but no more than the record has shown, and less with less
/// pressure. An opening beyond the record counts as the widest one there.
double LeastFlowAt(const FloorLimits& floor, double x, double dp);
/// Command and rod shut the valve.
bool IsShut(double x, double cv);

/// Wide limits that always apply in AUTO (FloorLimits): at every command,
/// inside and outside the trained region, from the first sample on.
///
///     travel_deviation  X is outside the range that the rod may have
///     shut_flow         F > c F(X_shut, P1 − P2) (100 − X)/(100 − X_shut) +
///                       m F_high although CV and X are beyond X_shut
///     excess_flow       F > c F(X − deviation/2, P1 − P2) + m F_high
///     x_stuck           X repeats, to the bit, while the rod should travel, or
///                       has no new reading meanwhile
///     f_stuck           F likewise, while F(X, P1 − P2) changes
///     low_flow          F < s LeastFlowAt(X, P1 − P2) − m F_high, X follows
///
/// Without X, the flow is tested against the range that the rod may have, and
/// the two tests of X find nothing.
///
/// They show that something is wrong, but not what: they name an episode until
/// a fault is isolated.
class Floor {
 public:
  /// `models` must outlive it.
  explicit Floor(const ModelSet& models);

  /// Clears all state: the rod is assumed where the next reading is.
  void Restart();

  /// Takes every accepted sample. Modes other than AUTO restart it; UNCERTAIN
  /// readings are not tested, except for silence where a reading was due.
  /// @param silent signals of which the source has no new reading; any other
  ///   UNCERTAIN value stands for a reading that is missing or was held out.
  void Push(const Sample& sample, SignalMask silent);
  void Push(const Sample& sample) { Push(sample, sample.uncertain()); }

  /// Signals that repeat, or are silent, although they should have moved.
  SignalMask stuck() const;

  /// The current findings; always empty without a floor.
  FaultSet findings() const { return findings_; }
  /// Tests that are beyond their limit, but not for long enough yet.
  FaultSet beginning() const { return beginning_; }
  /// Stamp of the first sample of the earliest current finding.
  std::optional<std::int64_t> stamp_ns() const;
  /// The distance of a finding from its model, as a signed share of the span.
  double size(std::size_t finding) const { return tests_[finding].size; }
  static constexpr std::size_t kTests = 6;
  /// The largest share of its limit that a test of the last sample has held for
  /// as long as it needs; above 1: a finding. Readings that repeat have none.
  double share() const { return share_; }

 private:
  struct Test {  // consecutive samples beyond a limit
    int length{0};
    std::int64_t since_ns{0};
    double size{0.0};
    bool found{false};
  };
  /// Two estimates of the expected value of a reading.
  using Expectations = std::array<double, 2>;
  struct Watched {
    int finding;
    double reading;
    double slack;  // what is closer to the reading is no other one
    int needed;    // samples
    Expectations expected;
    double most;  // change of both expectations without a finding
    bool counts{true};
  };
  struct Repeat {  // consecutive samples with the same reading
    double reading{0.0};
    std::int64_t since_ns{0};
    int length{0};
    Expectations lowest{};
    Expectations highest{};
  };

  double LeastFlow(double x, const Sample& sample) const;
  void Count(int finding, bool beyond, double share, double size, int needed,
             std::int64_t stamp_ns);
  void Watch(const Watched& what, std::int64_t stamp_ns, Repeat& repeat);
  void PushTravel(const Sample& sample);
  void WatchPosition(const Sample& sample, bool silent);
  void PushFlow(const Sample& sample);
  void WatchFlow(const Sample& sample, bool silent);

  const FloorLimits* limits_;  // null: no floor
  int position_silence_;       // samples without a reading of X
  int flow_silence_;           // and of F
  std::size_t first_;          // fault index of the first finding
  std::optional<RodBand> rod_;
  bool follows_{false};
  std::array<Test, kTests> tests_{};
  Repeat position_;
  Repeat flow_;
  FaultSet findings_{0};
  FaultSet beginning_{0};
  Sustained travel_share_;
  Sustained flow_shares_;  // by test
  double share_{0.0};
};

}  // namespace fdi
