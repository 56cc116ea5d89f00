#include "monitor/planner/work_list.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fdi::planner {
namespace {

constexpr double kNsPerDay = 86'400e9;
constexpr double kOtherReasons = 0.25;
constexpr double kRepetition = 0.1;
constexpr double kMostRepetition = 2.0;

double Points(cli::Severity severity) {
  return std::ldexp(1.0, static_cast<int>(severity));  // 1, 2, 4, 8
}

template <typename Reason>
void SortByWeight(std::vector<Reason>& reasons, const WorkOptions& options) {
  std::ranges::stable_sort(reasons, [&](const Reason& a, const Reason& b) {
    return WeightOf(a, options) > WeightOf(b, options);
  });
}

double ScoreOf(const ValveWork& work, const WorkOptions& options) {
  double most = 0.0;
  double sum = 0.0;
  const auto add = [&](double weight) {
    most = std::max(most, weight);
    sum += weight;
  };
  for (const FaultReason& reason : work.faults) {
    add(WeightOf(reason, options));
  }
  for (const TrendReason& reason : work.trends) {
    add(WeightOf(reason, options));
  }
  return most + kOtherReasons * (sum - most);
}

}  // namespace

double WeightOf(const FaultReason& reason, const WorkOptions& options) {
  const double confidence =
      reason.confirmed ? 1.0
                       : std::clamp(reason.factor, 0.0, 1.0) * reason.trust;
  const double days =
      reason.ended_ns
          ? std::max(0.0,
                     static_cast<double>(options.now_ns - *reason.ended_ns) /
                         kNsPerDay)
          : 0.0;
  const double repetition = std::min(
      kMostRepetition, 1.0 + kRepetition * std::max(0, reason.episodes - 1));
  return Points(reason.words.severity) * confidence *
         std::exp2(-days / options.half_life_days) * repetition;
}

double WeightOf(const TrendReason& reason, const WorkOptions& options) {
  using Answer = monitor::HealthForecast::Answer;
  const double points = Points(cli::Severity::kHigh);
  if (reason.forecast.answer == Answer::kReached) {
    return points;
  }
  if (reason.forecast.answer != Answer::kTime) {
    return 0.0;
  }
  return points *
         std::max(0.0, 1.0 - reason.forecast.time->days / options.horizon_days);
}

std::vector<WorkRow> RankWork(std::vector<ValveWork> valves,
                              const WorkOptions& options) {
  std::vector<WorkRow> rows;
  for (ValveWork& work : valves) {
    const double score = ScoreOf(work, options);
    if (score <= 0.0) {
      continue;
    }
    SortByWeight(work.faults, options);
    SortByWeight(work.trends, options);
    std::erase_if(work.trends, [&](const TrendReason& reason) {
      return WeightOf(reason, options) <= 0.0;
    });
    const std::string why = WhyText(work, options);
    rows.push_back({0, score, std::move(work), why});
  }
  std::ranges::stable_sort(rows, [](const WorkRow& a, const WorkRow& b) {
    return a.score != b.score ? a.score > b.score
                              : a.work.valve_id < b.work.valve_id;
  });
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].rank = static_cast<int>(i) + 1;
  }
  return rows;
}

}  // namespace fdi::planner
