#include "planner/live/cause_watch.h"

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "planner/live/cause_groups.h"

namespace fdi::planner {
namespace {

// An event that was published before its commit wakes nobody afterwards, and a
// step that failed is repeated.
constexpr std::chrono::milliseconds kPeriod{1000};

class Part : public monitor::ServicePart {
 public:
  explicit Part(std::vector<storage::CauseGroup> groups)
      : groups_(std::move(groups)) {}

  std::string_view name() const override { return "common_causes"; }
  void Start(const monitor::PartContext& context) override {
    context.log(LogLevel::kInfo,
                "cause_groups groups=" + std::to_string(groups_.size()));
    watch_.emplace(
        context.data.history(), groups_,
        [log = context.log,
         notify = context.notify](const storage::CauseChange& change) {
          Log(log, change);
          notify(CauseJson(change));
        },
        [guard = context.guard](const std::function<void()>& step) {
          guard("common_causes", step);
        });
    watch_->Start();
  }
  void OnCommitted(const FaultEvent& /*event*/, bool /*persisted*/) override {
    if (watch_) {
      watch_->Wake();
    }
  }
  void Stop() override { watch_.reset(); }

 private:
  static void Log(const LogSink& log, const storage::CauseChange& change) {
    log(LogLevel::kWarning,
        EventLine("common_cause",
                  {{"kind", std::string(CauseChangeName(change.kind))},
                   {"cause", change.cause.cause_id},
                   {"group", change.cause.group},
                   {"episodes", std::to_string(change.cause.members.size())}}));
  }

  const std::vector<storage::CauseGroup> groups_;
  std::optional<CauseWatch> watch_;
};

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

std::shared_ptr<monitor::ServicePart> CausePart(
    std::vector<storage::CauseGroup> groups) {
  return groups.empty() ? nullptr : std::make_shared<Part>(std::move(groups));
}

}  // namespace fdi::planner
