#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/valve_costs.h"
#include "diagnosis/records/health_hour.h"
#include "planner/health_series.h"
#include "report/fault_texts.h"
#include "report/findings/finding.h"
#include "storage/history/history.h"

namespace fdi::planner {

/// A value and the ends of its interval.
struct Range {
  double value{0.0};
  double lowest{0.0};
  double highest{0.0};
};

/// The cost of a leak that stands.
struct Waiting {
  Range loss;  ///< Lost on average [`unit`].
  FlowUnit unit{FlowUnit::kM3PerHour};
  ValveCosts costs;
  std::string text;  ///< One sentence.

  /// A week of it [costs.currency].
  Range week() const;
};

/// Answers if a finding can wait until the stop.
struct StopAnswer {
  std::string safe;  ///< "yes", "no", "perhaps" or "not known".
  std::string text;  ///< Why, one sentence.
};

/// The loss of an episode that stands. Two kinds of faults have one:
///
/// - external leakage, f5: kExternalLeakShare x |strength| x F expected, with
///   the 95 % interval of the strength;
/// - internal leakage, an open bypass, flow through the shut valve (f6, f18,
///   shut_flow): the mean residual of F while CV is in its last bin x the share
///   of the time that the valve is shut, with the 5th and 95th percentile of
///   the hourly means. While it is open, its loop takes that flow back.
///
/// @param hours since the detection, of one valve; the last week of them
/// counts.
/// @returns nothing for other faults, without a price of the medium, and where
///   the hours or strengths do not tell. Where the price is of another unit
///   than F, only `text` is set.
std::optional<Waiting> WaitingOf(const findings::Finding& finding,
                                 const std::vector<StrengthPoint>& strengths,
                                 const std::vector<HealthHour>& hours);

/// Safe is a fault whose severity is no graver at the stop than now, and not
/// critical, wherever its strength is in the 95 % intervals of the last
/// strength and of its rate.
StopAnswer SafeUntil(const findings::Finding& finding,
                     const std::vector<StrengthPoint>& strengths,
                     const report::FaultTexts& texts, std::int64_t stop_ns);
/// Safe is a trend that reaches its limit later than the stop, with its whole
/// 90 % interval.
StopAnswer SafeUntil(const HealthForecast& forecast, std::int64_t stop_ns);

}  // namespace fdi::planner
