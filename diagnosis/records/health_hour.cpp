#include "diagnosis/records/health_hour.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"

namespace fdi {

int CommandBin(double cv_percent) {
  const double bin = std::floor(cv_percent * kCommandBins / 100.0);
  return std::isfinite(bin)
             ? static_cast<int>(std::clamp(bin, 0.0, kCommandBins - 1.0))
             : 0;
}

void ResidualSums::Add(const ResidualSums& other) {
  samples += other.samples;
  residual += other.residual;
  square += other.square;
  output += other.output;
}

double HealthChannel::quantum() const {
  return std::ldexp(1.0, exponent);
}

bool HealthHour::SameKey(const HealthHour& other) const {
  return hour == other.hour && model_hash == other.model_hash &&
         epoch == other.epoch && valve_id == other.valve_id;
}

void HealthHour::Add(const HealthHour& part) {
  Require(SameKey(part) && channels == part.channels,
          "only parts of one hour with one model set can be added");
  seen_ms += part.seen_ms;
  live_ms += part.live_ms;
  alarm_ms += part.alarm_ms;
  open_ms += part.open_ms;
  shut_ms += part.shut_ms;
  live_samples += part.live_samples;
  normal_factor += part.normal_factor;
  travel += part.travel;
  reversals += part.reversals;
  share = std::max(share, part.share);
  counts.Add(part.counts);
  for (std::size_t b = 0; b < bins.size(); ++b) {
    if (bins[b].empty()) {
      bins[b] = part.bins[b];
      continue;
    }
    for (std::size_t c = 0; c < part.bins[b].size(); ++c) {
      bins[b][c].Add(part.bins[b][c]);
    }
  }
  for (const StrengthSums& sums : part.strengths) {
    AddStrength(sums.fault, sums.samples, sums.strength);
  }
}

void HealthHour::AddStrength(int fault, std::int64_t samples,
                             std::int64_t strength) {
  auto place =
      std::ranges::lower_bound(strengths, fault, {}, &StrengthSums::fault);
  if (place == strengths.end() || place->fault != fault) {
    place = strengths.insert(place, {fault, 0, 0});
  }
  place->samples += samples;
  place->strength += strength;
}

}  // namespace fdi
