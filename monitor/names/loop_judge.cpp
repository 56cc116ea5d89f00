#include "monitor/names/loop_judge.h"

#include <chrono>
#include <functional>
#include <utility>

namespace fdi::monitor {

LoopJudge::LoopJudge(std::string_view valve_id, AuditWorker* worker,
                     std::shared_ptr<const SeverityCatalogue> severities)
    : watch_(std::hash<std::string_view>{}(valve_id) % LoopWatch::kHop,
             std::move(severities), loop::ServiceOf(valve_id, true)),
      worker_(worker) {}

const Verdict& LoopJudge::Step(const Sample& sample, double period_s) {
  if (answer_.valid() &&
      answer_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    watch_.Enter(answer_.get());
  }
  const Verdict& verdict = watch_.Step(sample, period_s);
  if (worker_ != nullptr && watch_.at_point() && !answer_.valid() &&
      worker_->has_room()) {
    if (auto window = watch_.TakeWindow()) {
      answer_ = worker_->Submit(std::move(*window));
    }
  }
  return verdict;
}

}  // namespace fdi::monitor
