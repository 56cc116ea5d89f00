#include "planner/live/cause_watch.h"

#include <chrono>
#include <memory>
#include <string>
#include <utility>

#include "base/log.h"
#include "planner/live/cause_groups.h"

namespace fdi::planner {
namespace {

// An event that was published before its commit wakes nobody afterwards, and a
// step that failed is repeated.
constexpr std::chrono::milliseconds kPeriod{1000};

}  // namespace

CauseWatch::CauseWatch(
    const std::filesystem::path& history,
    std::vector<storage::CauseGroup> groups,
    std::function<void(const storage::CauseChange&)> on_change, Guard guard)
    : database_(history, storage::HistorySchema(),
                storage::Access::kOccasionalWriter),
      book_(database_, std::move(groups)),
      on_change_(std::move(on_change)),
      guard_(std::move(guard)) {}

void CauseWatch::Start() {
  worker_.Start([this] { Run(); });
}

void CauseWatch::Wake() {
  const MutexLock lock(mutex_);
  woken_ = true;
  changed_.notify_one();
}

void CauseWatch::Stop() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    changed_.notify_one();
  }
  worker_.Join();
}

void CauseWatch::Run() {
  bool last = false;
  while (!last) {
    {
      MutexLock lock(mutex_);
      changed_.wait_for(lock, kPeriod, [this]() REQUIRES(mutex_) {
        return woken_ || stopping_;
      });
      woken_ = false;
      last = stopping_;
    }
    guard_([this] { ReadAll(); });
  }
}

void CauseWatch::ReadAll() {
  do {
    for (const storage::CauseChange& change : book_.Read()) {
      on_change_(change);
    }
  } while (!book_.at_end());
}

monitor::MakeFollower CauseFollower(std::vector<storage::CauseGroup> groups) {
  if (groups.empty()) {
    return {};
  }
  return [groups = std::move(groups)](const monitor::FollowerContext& service)
             -> std::unique_ptr<monitor::HistoryFollower> {
    service.log(LogLevel::kInfo,
                "cause_groups groups=" + std::to_string(groups.size()));
    const auto tell = [service](const storage::CauseChange& change) {
      service.log(
          LogLevel::kWarning,
          EventLine(
              "common_cause",
              {{"kind", std::string(CauseChangeName(change.kind))},
               {"cause", change.cause.cause_id},
               {"group", change.cause.group},
               {"episodes", std::to_string(change.cause.members.size())}}));
      service.notify(CauseJson(change));
    };
    return std::make_unique<CauseWatch>(
        service.history, groups, tell,
        [guard = service.guard](const std::function<void()>& step) {
          guard("common_causes", step);
        });
  };
}

}  // namespace fdi::planner
