#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <fastdds/dds/log/Log.hpp>

#include "base/mutex.h"
#include "idl/participant_impl.h"

namespace fdi::idl {
namespace {

using eprosima::fastdds::dds::Log;
using Clock = std::chrono::steady_clock;
constexpr auto kQuietTime = std::chrono::seconds(10);

// Process-wide, like the library's log.
struct Registry {
  Mutex mutex;
  bool installed GUARDED_BY(mutex){false};
  std::vector<const LogSink*> sinks GUARDED_BY(mutex);
};

// Never destroyed: the library's log thread outlives our statics.
Registry& GlobalRegistry() {
  static Registry& registry = *new Registry;
  return registry;
}

LogLevel LevelOf(Log::Kind kind) {
  return kind == Log::Kind::Error     ? LogLevel::kError
         : kind == Log::Kind::Warning ? LogLevel::kWarning
                                      : LogLevel::kDebug;
}

// Called by the library's log thread.
class Throttle : public eprosima::fastdds::dds::LogConsumer {
 public:
  void Consume(const Log::Entry& entry) override {
    const auto place = std::make_pair(
        std::string(entry.context.filename ? entry.context.filename : ""),
        entry.context.line);
    Place& seen = places_[place];
    const Clock::time_point now = Clock::now();
    if (seen.count > 0 && now - seen.last < kQuietTime) {
      ++seen.suppressed;
      return;
    }
    std::string text = entry.message;
    std::ranges::replace(text, '\n', ' ');
    std::ranges::replace(text, '"', '\'');
    std::string line =
        "dds_library category=" + std::string(entry.context.category) +
        " text=\"" + text + "\"";
    if (seen.suppressed > 0) {
      line += " suppressed=" + std::to_string(seen.suppressed);
    }
    seen = {now, seen.count + 1, 0};
    Registry& registry = GlobalRegistry();
    const MutexLock lock(registry.mutex);
    if (!registry.sinks.empty() && *registry.sinks.back()) {
      (*registry.sinks.back())(LevelOf(entry.kind), line);
    }
  }

 private:
  struct Place {
    Clock::time_point last{};
    std::uint64_t count{0};
    std::uint64_t suppressed{0};
  };
  std::map<std::pair<std::string, int>, Place> places_;
};

}  // namespace

LibraryLog::LibraryLog(LogSink sink) : sink_(std::move(sink)) {
  Registry& registry = GlobalRegistry();
  const MutexLock lock(registry.mutex);
  if (!registry.installed) {
    Log::ClearConsumers();
    Log::RegisterConsumer(std::make_unique<Throttle>());
    registry.installed = true;
  }
  registry.sinks.push_back(&sink_);
}

LibraryLog::~LibraryLog() {
  Registry& registry = GlobalRegistry();
  const MutexLock lock(registry.mutex);
  std::erase(registry.sinks, &sink_);
}

}  // namespace fdi::idl
