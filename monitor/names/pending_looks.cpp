#include "monitor/names/pending_looks.h"

#include <chrono>

namespace fdi::monitor {

// The rows, up to 27 kB, go only to the worker.
void PendingLooks::Request(std::vector<LookTask> due,
                           const LookWorker::Physics& physics) {
  for (LookTask& task : due) {
    auto rows = std::exchange(task.window.rows, {});
    Pending pending{task, {}};
    task.window.rows = std::move(rows);
    pending.answer = worker_->Submit(valve_id_, physics, std::move(task));
    pending_.push_back(std::move(pending));
  }
}

// The worker takes the looks at an episode in their order, but a routine look
// that was asked for before them may come after them. wait_for(0) only asks.
std::vector<std::pair<LookTask, LookAnswer>> PendingLooks::Collect() {
  using std::future_status;
  static constexpr std::chrono::seconds kNow{0};
  std::vector<std::pair<LookTask, LookAnswer>> answers;
  std::erase_if(pending_, [&](Pending& look) {
    if (look.answer.wait_for(kNow) != future_status::ready) {
      return false;
    }
    if (LookWorker::Answer answer = look.answer.get()) {
      answers.emplace_back(std::move(look.task), std::move(*answer));
    }
    return true;
  });
  return answers;
}

}  // namespace fdi::monitor
