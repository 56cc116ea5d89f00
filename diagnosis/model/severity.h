#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

namespace fdi {

/// Severity of a fault. The priority of its alarm follows from it.
enum class Severity : std::uint8_t { kLow, kMedium, kHigh, kCritical };
inline constexpr int kSeverityCount = 4;

std::string_view SeverityName(Severity severity);  ///< "critical", ...

/// Priority of an alarm in ISA-18.2: 1 (critical) to 4 (low).
constexpr int PriorityOf(Severity severity) {
  return kSeverityCount - static_cast<int>(severity);
}
constexpr std::optional<int> PriorityOf(std::optional<Severity> severity) {
  return severity ? std::optional(PriorityOf(*severity)) : std::nullopt;
}
/// The inverse; nothing unless `priority` is in 1..4.
constexpr std::optional<Severity> SeverityOf(std::int64_t priority) {
  return priority >= 1 && priority <= kSeverityCount
             ? std::optional(static_cast<Severity>(kSeverityCount - priority))
             : std::nullopt;
}

/// The severity from |strength| `from` on, in 0..1.
struct SeverityBand {
  double from{0.0};
  Severity level{Severity::kMedium};
};
/// Ascending, the first from 0.
using SeverityBands = std::vector<SeverityBand>;

/// The bands of each fault or finding by its number, of what no known fault
/// explains by 0.
using SeverityCatalogue = std::map<int, SeverityBands>;

/// A strength and the ends of its 95 % interval, signed [-]. An interval
/// without width is not known.
struct Estimate {
  double strength{0.0};
  double lowest{0.0};
  double highest{0.0};

  bool has_interval() const { return lowest < highest; }
  bool operator==(const Estimate&) const = default;
};

/// The severity at a strength [-], whatever its sign; without bands medium. A
/// strength that is not finite counts as the smallest fault.
Severity SeverityAt(const SeverityBands& bands, double strength);

/// The severity of a fault that had `before`, from a new estimate. It changes
/// only if the whole interval says so: noise at the border of a band changes
/// nothing.
Severity SeverityNow(const SeverityBands& bands, Severity before,
                     const Estimate& estimate);

}  // namespace fdi
