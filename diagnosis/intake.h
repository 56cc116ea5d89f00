#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diagnosis/model_set.h"
#include "diagnosis/sample.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// Keeps the order of one valve's samples: per source by seq, between sources
/// the newest wins, and their distance in time by the sample period. A stamp
/// that steps back under a seq that goes on is a gap, and the sample accepted.
class SourceOrder {
 public:
  explicit SourceOrder(double sample_period_s);

  struct Placement {
    Intake intake{Intake::kAccepted};
    bool new_source{false};
    bool gap{false};  ///< Not one period after the last accepted sample.
  };

  Placement Place(const Sample& sample);

  void SetPeriod(double sample_period_s);

 private:
  bool Superseded(std::uint64_t source_id) const;

  static constexpr int kRemembered = 8;  // sources that spoke before
  static constexpr int kPeriodStrikes = 3;

  std::int64_t period_ns_;
  std::uint64_t source_id_{0};
  std::uint64_t last_seq_{0};
  std::int64_t last_stamp_ns_{0};
  bool has_source_{false};
  bool has_stamp_{false};
  int off_period_{0};  // intervals in a row that were not one period
  std::int64_t off_interval_ns_{0};  // Their distance.
  std::array<std::uint64_t, kRemembered> superseded_{};
  int superseded_count_{0};
};

/// Finds transmitters of T1, P1 and P2 that repeat one reading, to the bit, for
/// longer than they ever did in normal operation (StuckLimits). No observer
/// sees that: the reading is a normal one. What is UNCERTAIN is no reading.
/// Signals whose transmitter fault is not among those of the model set are not
/// watched.
class StuckReadings {
 public:
  /// `models` must outlive it.
  explicit StuckReadings(const ModelSet& models);

  void Restart();

  /// Takes every sample that reaches the observers.
  void Push(const Sample& sample);

  /// The faults of the transmitters that are stuck now.
  FaultSet faults() const { return faults_; }
  /// Stamp of the first sample beyond a limit, while one is stuck.
  std::optional<std::int64_t> stamp_ns() const;

 private:
  struct Watch {
    Signal signal;
    int limit;       // 0: not watched
    FaultSet fault;  // its bit
    int length{0};   // samples with the same reading
    double reading{0.0};
    std::int64_t since_ns{0};  // beyond the limit
  };

  std::array<Watch, 3> watches_;
  FaultSet faults_{0};
};

}  // namespace fdi
