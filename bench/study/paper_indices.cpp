#include "bench/study/paper_indices.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/text.h"

namespace fdi::trainer::study {
namespace {

using Zone = std::span<const Indication>;

template <typename Predicate>
double Share(Zone zone, Predicate holds) {
  return static_cast<double>(std::count_if(zone.begin(), zone.end(), holds)) /
         static_cast<double>(zone.size());
}

double WrongFaults(const Indication& now) {
  const bool right =
      now.truth.fault != 0 && Contains(now.isolated, now.truth.fault);
  return static_cast<double>(now.isolated.size()) - (right ? 1.0 : 0.0);
}

// The time from the start of the zone to its first instant of that kind.
template <typename Predicate>
double FirstTime(Zone zone, Predicate holds) {
  const auto found = std::find_if(zone.begin(), zone.end(), holds);
  return found == zone.end() ? -1.0 : found->time_s - zone.front().time_s;
}

// |strength| at a time from the start of the zone.
double StrengthAt(Zone zone, double time_s) {
  for (const Indication& now : zone) {
    if (time_s >= 0.0 && now.time_s - zone.front().time_s >= time_s) {
      return std::abs(now.truth.strength);
    }
  }
  return -1.0;
}

}  // namespace

PaperIndices ComputePaperIndices(const std::vector<Indication>& indications,
                                 const RunIndices& indices, double horizon_s) {
  PaperIndices result;
  if (indications.empty()) {
    return result;
  }
  const RunZones zones = ZonesOf(indications, horizon_s);
  const Zone all(indications);
  if (zones.on < zones.from) {
    result.r_fi =
        Share(all.subspan(zones.on, zones.from - zones.on),
              [](const Indication& now) { return !now.isolated.empty(); });
  }
  if (zones.on <= zones.last) {
    const Zone judged = all.subspan(zones.on, zones.last - zones.on + 1);
    double wrong = 0.0;
    for (const Indication& now : judged) {
      wrong += WrongFaults(now);
    }
    result.r_mi = wrong / static_cast<double>(judged.size());
  }
  if (zones.from == all.size()) {
    return result;
  }
  const Zone acts = all.subspan(zones.from, zones.last - zones.from + 1);
  const auto is_isolated = [&](const Indication& now) {
    return Contains(now.isolated, indices.fault);
  };
  result.r_td = Share(acts, [](const Indication& now) { return now.detected; });
  result.r_ti = Share(acts, is_isolated);
  // An edge: a fault that was named before it acted was not isolated then.
  const bool stood = zones.from > 0 && is_isolated(all[zones.from - 1]);
  const auto begin =
      stood ? std::find_if_not(acts.begin(), acts.end(), is_isolated)
            : acts.begin();
  const auto edge = std::find_if(begin, acts.end(), is_isolated);
  result.t_it_first =
      edge == acts.end() ? -1.0 : edge->time_s - acts.front().time_s;
  result.t_exact = FirstTime(acts, [&](const Indication& now) {
    return now.isolated == std::vector<int>{indices.fault};
  });
  result.fs_d = StrengthAt(acts, indices.t_dt);
  result.fs_i = StrengthAt(acts, indices.t_it);
  return result;
}

}  // namespace fdi::trainer::study
