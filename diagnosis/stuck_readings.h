#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diagnosis/model_set.h"

namespace fdi {

/// Finds transmitters of T1, P1 and P2 that repeat one reading, to the bit, for
/// longer than they ever did in normal operation (StuckLimits). No observer
/// sees that: the reading is a normal one. Signals whose transmitter fault is
/// not among those of the model set are not watched.
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
