#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/records/health_hour.h"

namespace fdi::planner {

/// A reading that has moved away from what the normal model expects, over a day
/// or longer: a fault that grows, a transmitter, or a plant that is no longer
/// the one the model was made from.
struct ChannelDrift {
  Signal signal{Signal::kX};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  double now{0.0};           ///< Mean residual at the end, signed [unit].
  double per_hour{0.0};      ///< Its slope, of the same sign [unit/h].
  std::int64_t since_ns{0};  ///< Where the line was at zero, or begins.
  std::int64_t last_ns{0};   ///< The newest hour.
};

/// The drifts in the hours of one valve, of its last epoch and model set.
///
/// A line (FitTrend) through the hourly mean residuals of the last day, three
/// days, week or 30 days, all bins of CV on common slope (HealthSeries), is a
/// drift if
///
/// - it spans 20 h or more, so that a daily cycle is none,
/// - its slope is significant, and leads away from zero,
/// - over the span it rises by half a deviation of the single residual or more,
///   as no limit on a mean is closer, and
/// - it leaves less than the best single step does: an abrupt fault is no
/// drift.
///
/// The shortest such time counts, which has the pace as of now.
std::vector<ChannelDrift> DriftsOf(std::span<const HealthHour> hours);

/// "X reads 1.1 % above its model since 2026-11-20 14:00, growing by 0.05 % an
/// hour: a fault that grows, or the transmitter"
std::string DriftText(const ChannelDrift& drift);

}  // namespace fdi::planner
