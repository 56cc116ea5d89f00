#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/decision/alarm_budget.h"

namespace fdi::monitor {

/// A budget of four valves, V0 to V3, with 300 hours each that exceed z with
/// exp(-(z - 0.4)/0.1). @param others episodes beyond no limit, of each.
inline std::shared_ptr<const AlarmBudget> Budget(
    double between_hours, std::uint64_t model_hash = 0x1234,
    std::uint32_t epoch = 0, int others = 0) {
  std::vector<HealthyHours> fleet(4);
  for (std::size_t v = 0; v < fleet.size(); ++v) {
    fleet[v].valve_id = "V" + std::to_string(v);
    fleet[v].model_hash = model_hash;
    fleet[v].epoch = epoch;
    fleet[v].days = 30;
    fleet[v].others = others;
    for (int i = 0; i < 300; ++i) {
      // 7 of the highest 60 follow one another.
      const int rank = 53 * i % 300;
      fleet[v].hours.push_back({i, 0.4 - 0.1 * std::log((rank + 0.5) / 300.0)});
    }
  }
  return std::make_shared<const AlarmBudget>(between_hours, fleet);
}

}  // namespace fdi::monitor
