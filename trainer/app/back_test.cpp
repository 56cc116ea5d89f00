#include "trainer/app/back_test.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fdi::trainer {
namespace {

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();

double Seconds(std::int64_t ns) {
  return static_cast<double>(ns) / 1e9;
}

OrderOutcome OutcomeOf(int found, const std::vector<int>& said) {
  if (found == 0) {
    return OrderOutcome::kFalse;
  }
  if (said.empty()) {
    return OrderOutcome::kUnknown;
  }
  if (std::find(said.begin(), said.end(), found) == said.end()) {
    return OrderOutcome::kWrong;
  }
  return said.size() == 1 ? OrderOutcome::kExact : OrderOutcome::kContained;
}

// From the best to the worst answer to a fault that was found.
int RankOf(OrderOutcome outcome) {
  switch (outcome) {
    case OrderOutcome::kExact:
      return 0;
    case OrderOutcome::kContained:
      return 1;
    case OrderOutcome::kUnknown:
      return 2;
    default:
      return 3;
  }
}

bool Precedes(const PastEpisode& episode, const WorkOrder& order,
              std::int64_t begin_ns, std::int64_t horizon_ns) {
  return episode.detected_ns > begin_ns &&
         episode.detected_ns <= order.time_ns &&
         order.time_ns - std::min(episode.ended_ns, order.time_ns) <=
             horizon_ns;
}

JudgedOrder Judge(const WorkOrder& order, const PastRecord* record,
                  std::int64_t previous_ns, std::int64_t horizon_ns) {
  JudgedOrder judged{order, OrderOutcome::kNoData, {}, -1, 0.0, 0.0};
  const std::int64_t begin_ns =
      std::max(previous_ns, order.time_ns - horizon_ns);
  if (record == nullptr || record->first_ns > order.time_ns ||
      record->last_ns < begin_ns) {
    return judged;
  }
  judged.outcome =
      order.found == 0 ? OrderOutcome::kSilent : OrderOutcome::kMissed;
  for (const PastEpisode& episode : record->episodes) {
    if (!Precedes(episode, order, previous_ns, horizon_ns)) {
      continue;
    }
    const OrderOutcome outcome = OutcomeOf(order.found, episode.said);
    if (judged.first_ns < 0) {
      judged.first_ns = episode.detected_ns;
      judged.lead_s = Seconds(order.time_ns - episode.detected_ns);
    }
    judged.duration_s += Seconds(std::min(episode.ended_ns, order.time_ns) -
                                 episode.detected_ns);
    const bool first = judged.outcome == OrderOutcome::kMissed ||
                       judged.outcome == OrderOutcome::kSilent;
    if (first || RankOf(outcome) <= RankOf(judged.outcome)) {
      judged.outcome = outcome;
      judged.said = episode.said;
    }
  }
  return judged;
}

// Sorts an episode into those that a repair proved, false ones and undecided.
void SortEpisode(const PastEpisode& episode, const PastRecord& record,
                 const std::vector<WorkOrder>& orders, std::int64_t horizon_ns,
                 BackTest& result) {
  std::int64_t known_until_ns = record.last_ns;
  bool followed = false;
  for (const WorkOrder& order : orders) {
    if (order.valve != episode.valve) {
      continue;
    }
    known_until_ns = std::max(known_until_ns, order.time_ns);
    if (!followed && Precedes(episode, order, kNever, horizon_ns)) {
      followed = true;
      if (order.found != 0) {
        return;
      }
    }
  }
  const bool decided =
      followed || known_until_ns - episode.ended_ns >= horizon_ns;
  (decided ? result.false_episodes : result.undecided).push_back(episode);
}

}  // namespace

std::string_view OutcomeName(OrderOutcome outcome) {
  switch (outcome) {
    case OrderOutcome::kExact:
      return "exact";
    case OrderOutcome::kContained:
      return "contained";
    case OrderOutcome::kWrong:
      return "wrong";
    case OrderOutcome::kUnknown:
      return "unknown";
    case OrderOutcome::kMissed:
      return "missed";
    case OrderOutcome::kSilent:
      return "silent";
    case OrderOutcome::kFalse:
      return "false";
    case OrderOutcome::kNoData:
      return "no data";
  }
  return "no data";
}

BackTest JudgeHistory(const std::vector<PastRecord>& records,
                      const std::vector<WorkOrder>& orders, double horizon_s) {
  const std::int64_t horizon_ns = std::llround(horizon_s * 1e9);
  BackTest result;
  for (std::size_t i = 0; i < orders.size(); ++i) {
    const WorkOrder& order = orders[i];
    const auto record = std::find_if(
        records.begin(), records.end(),
        [&](const PastRecord& r) { return r.valve == order.valve; });
    const bool has_previous = i > 0 && orders[i - 1].valve == order.valve;
    result.orders.push_back(
        Judge(order, record == records.end() ? nullptr : &*record,
              has_previous ? orders[i - 1].time_ns : kNever, horizon_ns));
    ++result.by_fault[order.found][result.orders.back().outcome];
  }
  for (const PastRecord& record : records) {
    for (const PastEpisode& episode : record.episodes) {
      SortEpisode(episode, record, orders, horizon_ns, result);
    }
  }
  return result;
}

}  // namespace fdi::trainer
