#pragma once

#include <cstdint>
#include <optional>

#include "diagnosis/model/verdict.h"

namespace fdi {

/// The strength of a fault at one time of its episode.
struct StrengthPoint {
  std::uint64_t episode_id{0};
  std::int64_t stamp_ns{0};  ///< Middle of the readings that tell it.
  int fault{0};
  double strength{0.0};            ///< Most likely; signed [-].
  double lowest{0.0};              ///< Ends of its 95 % interval [-].
  double highest{0.0};             ///<
  Layer layer{Layer::kObservers};  ///< Layer that estimated it.
  /// The episode's severity by now; set for the fault whose strength is that of
  /// the episode. Not part of the curve.
  std::optional<Severity> severity{};

  bool operator==(const StrengthPoint&) const = default;
};

}  // namespace fdi
