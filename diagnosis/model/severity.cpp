#include "diagnosis/model/severity.h"

#include <array>

namespace fdi {

std::string_view SeverityName(Severity severity) {
  constexpr std::array<std::string_view, kSeverityCount> kNames{
      "low", "medium", "high", "critical"};
  return kNames[static_cast<std::size_t>(severity)];
}

Severity SeverityAt(const SeverityBands& bands, double strength) {
  const double size = std::isfinite(strength) ? std::abs(strength) : 0.0;
  Severity level = bands.empty() ? Severity::kMedium : bands.front().level;
  for (const SeverityBand& band : bands) {
    if (size >= band.from) {
      level = band.level;
    }
  }
  return level;
}

Severity SeverityNow(const SeverityBands& bands, Severity before,
                     const Estimate& estimate) {
  const double low = std::abs(estimate.lowest);
  const double high = std::abs(estimate.highest);
  const bool both_signs = estimate.lowest < 0.0 && estimate.highest > 0.0;
  const Severity at_least =
      SeverityAt(bands, both_signs ? 0.0 : std::min(low, high));
  const Severity at_most = SeverityAt(bands, std::max(low, high));
  return std::clamp(before, std::min(at_least, at_most),
                    std::max(at_least, at_most));
}

}  // namespace fdi
