#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "trainer/app/work_orders.h"

namespace fdi::trainer {

/// An episode that the engine would have opened.
struct PastEpisode {
  std::string valve;
  std::int64_t detected_ns{0};
  std::int64_t ended_ns{0};  ///< Of one that never ended: the last sample.
  std::vector<int> said;     ///< Last set isolated; empty: unknown.
};

/// A valve's record: when it was heard, and what would have been said.
struct PastRecord {
  std::string valve;
  std::int64_t first_ns{0};
  std::int64_t last_ns{0};
  double hours{0.0};         ///< Of samples.
  double live_hours{0.0};    ///< Of these, diagnosed.
  std::int64_t rejected{0};  ///< Samples that no observer saw.
  std::vector<PastEpisode> episodes;
};

enum class OrderOutcome {
  kExact,      ///< The fault found was named alone,
  kContained,  ///< or in a set with others.
  kWrong,      ///< Other faults were named.
  kUnknown,    ///< Something was said to be wrong, not what.
  kMissed,     ///< A fault was found and nothing said.
  kSilent,     ///< Nothing was found, nothing said.
  kFalse,      ///< Nothing was found, something said.
  kNoData,     ///< The valve was not heard before the order.
};
std::string_view OutcomeName(OrderOutcome outcome);  ///< "exact", ...

/// A work order and what was said before it.
struct JudgedOrder {
  WorkOrder order;
  OrderOutcome outcome{OrderOutcome::kNoData};
  std::vector<int> said;      ///< The best answer of these episodes, or {}.
  std::int64_t first_ns{-1};  ///< First detection; −1: none.
  double lead_s{0.0};         ///< From then to the order.
  double duration_s{0.0};     ///< Episodes were open so long before it.
};

/// Orders of one fault by outcome.
using OutcomeCounts = std::map<OrderOutcome, int>;

struct BackTest {
  std::vector<JudgedOrder> orders;
  std::vector<PastEpisode> false_episodes;  ///< No fault was found after them.
  std::vector<PastEpisode> undecided;  ///< The records end within the horizon.
  std::map<int, OutcomeCounts> by_fault;  ///< 0: nothing was found.
};

/// Lays work orders over the records. Before an order count the episodes of its
/// valve that were open within the horizon and begun after the order before. Of
/// several, the best answer counts. An episode is false if no fault was found
/// within the horizon after it; undecided if the records and orders of its
/// valve end before that and no order followed it.
BackTest JudgeHistory(const std::vector<PastRecord>& records,
                      const std::vector<WorkOrder>& orders, double horizon_s);

}  // namespace fdi::trainer
