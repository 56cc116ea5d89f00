#include "diagnosis/records/growth.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/time_units.h"
#include "diagnosis/model/student.h"

namespace fdi {
namespace {

constexpr double kNormalQuantile = 1.96;
constexpr double kMinDeviation = 0.005;
constexpr double kScaleDeviation = 0.02;
constexpr double kSecondsPerDay = 86'400.0;

// |strength| `t` seconds after the last point.
struct Reading {
  double t;
  double strength;
  double deviation;
};

struct Line {
  double middle{0.0};
  double level{0.0};
  double rate{0.0};  // [1/s]
  double level_variance{0.0};
  double rate_variance{0.0};
  double quantile{0.0};
};

// Latest first.
std::vector<Reading> Independent(std::span<const StrengthPoint> points,
                                 const StrengthPoint& last) {
  const double sign = last.strength < 0.0 ? -1.0 : 1.0;
  std::vector<Reading> readings;
  std::int64_t before_ns = last.stamp_ns + 1;
  for (auto at = points.rbegin(); at != points.rend(); ++at) {
    const StrengthPoint& p = *at;
    if (p.fault == last.fault && p.layer == last.layer &&
        p.stamp_ns < before_ns) {
      const double length = p.highest - p.lowest;
      readings.push_back(
          {static_cast<double>(p.stamp_ns - last.stamp_ns) / kNsPerSecond,
           sign * p.strength,
           std::max(0.5 * length / kNormalQuantile, kMinDeviation)});
      before_ns = p.stamp_ns - kPointWindowNs + 1;
    }
  }
  return readings;
}

Line Fit(const std::vector<Reading>& readings) {
  constexpr double kBothSides = 0.975;
  double w = 0.0, wt = 0.0, ws = 0.0;
  for (const Reading& r : readings) {
    const double weight = 1.0 / (r.deviation * r.deviation);
    w += weight;
    wt += weight * r.t;
    ws += weight * r.strength;
  }
  Line line;
  line.middle = wt / w;
  line.level = ws / w;
  double spread = 0.0, product = 0.0;
  for (const Reading& r : readings) {
    const double weight = 1.0 / (r.deviation * r.deviation);
    const double t = r.t - line.middle;
    spread += weight * t * t;
    product += weight * t * r.strength;
  }
  line.rate = product / spread;
  double chi_squared = 0.0;
  for (const Reading& r : readings) {
    const double error =
        r.strength - line.level - line.rate * (r.t - line.middle);
    chi_squared += error * error / (r.deviation * r.deviation);
  }
  const auto freedom = static_cast<double>(readings.size()) - 2.0;
  const double inflation = std::max(1.0, chi_squared / freedom);
  line.level_variance = inflation / w;
  line.rate_variance = inflation / spread;
  line.quantile = StudentQuantile(kBothSides, freedom);
  return line;
}

// (level + rate (t − middle) − 1)² ≤ q² (V_level + V_rate (t − middle)²) + z²
// S² between the two ends, S the deviation of the scale.
std::optional<TimeToFull> FullAt(const Line& line) {
  const double gap = 1.0 - line.level + line.rate * line.middle;
  if (gap <= 0.0) {
    return std::nullopt;
  }
  const double q2 = line.quantile * line.quantile;
  const double off = line.level - 1.0;
  const double a = line.rate * line.rate - q2 * line.rate_variance;
  const double b = line.rate * off;
  const double scale = kNormalQuantile * kScaleDeviation;
  const double c = off * off - q2 * line.level_variance - scale * scale;
  const double root = std::sqrt(std::max(0.0, b * b - a * c));
  return TimeToFull{gap / line.rate,
                    std::max(0.0, line.middle + (-b - root) / a),
                    std::max(0.0, line.middle + (-b + root) / a)};
}

}  // namespace

std::optional<Growth> GrowthOf(std::span<const StrengthPoint> points,
                               int fault) {
  const auto latest = std::find_if(
      points.rbegin(), points.rend(),
      [fault](const StrengthPoint& p) { return p.fault == fault; });
  if (latest == points.rend()) {
    return std::nullopt;
  }
  Growth growth{*latest, {}, {}};
  const std::vector<Reading> readings = Independent(points, growth.last);
  if (readings.size() < kMinPoints ||
      readings.back().t * kNsPerSecond > -kMinSpanNs) {
    return growth;
  }
  const Line line = Fit(readings);
  const double half = line.quantile * std::sqrt(line.rate_variance);
  growth.rate = GrowthRate{kSecondsPerDay * line.rate,
                           kSecondsPerDay * (line.rate - half),
                           kSecondsPerDay * (line.rate + half)};
  if (growth.rate->grows()) {
    growth.full = FullAt(line);
  }
  return growth;
}

}  // namespace fdi
