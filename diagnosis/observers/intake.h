#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/ts_model.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// Orders one valve's samples: within a source by seq, between sources the
/// newest wins, and their intervals are checked against the sample period. If
/// the stamp steps back while seq continues, the sample is accepted as a gap.
class SourceOrder {
 public:
  explicit SourceOrder(double sample_period_s);

  struct Placement {
    Intake intake{Intake::kAccepted};
    bool new_source{false};
    bool gap{false};  ///< Not one period after the last accepted one.
  };

  Placement Place(const Sample& sample);

  void SetPeriod(double sample_period_s);

  /// Whichever source sends next is the newest one: a superseded one may return
  /// once its successor has gone.
  void ForgetSuperseded() { superseded_count_ = 0; }

 private:
  bool Superseded(std::uint64_t source_id) const;

  static constexpr int kRemembered = 8;  // number of earlier sources remembered
  static constexpr int kPeriodStrikes = 3;

  std::int64_t period_ns_;
  std::uint64_t source_id_{0};
  std::uint64_t last_seq_{0};
  std::int64_t last_stamp_ns_{0};
  bool has_source_{false};
  bool has_stamp_{false};
  int off_period_{0};  // consecutive intervals that were not one period
  std::int64_t off_interval_ns_{0};  // Length of the last one.
  std::array<std::uint64_t, kRemembered> superseded_{};
  int superseded_count_{0};
};

/// Bridges single samples in which a signal is missing or its reading cannot be
/// used: the reading before stands there as UNCERTAIN, so the past of the
/// observers stays consecutive and nothing counts the sample. After kMost
/// samples in a row the past of the observers is made up from end to end, and
/// the signal is missing.
class Bridge {
 public:
  static constexpr int kMost = kMaxLag;

  void Restart() { length_ = 0; }

  /// Takes every sample in order.
  /// @param past the sample before, as it was judged.
  /// @returns whether nothing unusable is left in `sample`.
  bool Mend(SignalMask unusable, const Sample& past, Sample& sample);

  /// The last sample is the first one in a row that was mended.
  bool begins() const { return length_ == 1; }

 private:
  int length_{0};  // samples in a row
};

/// Detects transmitters of T1, P1 and P2 that repeat one reading, to the bit,
/// for longer than ever in normal operation (StuckLimits). Observers cannot see
/// that, because the reading itself is normal. UNCERTAIN readings are ignored.
/// Signals whose transmitter fault is not in the model set are not watched.
class StuckReadings {
 public:
  /// `models` must outlive it.
  explicit StuckReadings(const ModelSet& models);

  void Restart();

  /// Takes every sample that is passed to the observers.
  void Push(const Sample& sample);

  /// Transmitter faults of the signals that are stuck at present.
  FaultSet faults() const { return faults_; }
  /// Stamp of the first sample beyond the limit, while one is stuck.
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
