#pragma once

#include <array>
#include <cstdint>

#include "diagnosis/sample.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// Keeps the order of one valve's samples: per source by seq, between sources
/// the newest wins, and their distance in time by the sample period.
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
  std::int64_t off_interval_ns_{0};
  std::array<std::uint64_t, kRemembered> superseded_{};
  int superseded_count_{0};
};

}  // namespace fdi
