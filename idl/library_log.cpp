#include "idl/library_log.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
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
constexpr std::size_t kMaxRefusals = 64;

// Process-wide, like the library's log.
struct Registry {
  Mutex mutex;
  bool installed GUARDED_BY(mutex){false};
  std::vector<const LogSink*> sinks GUARDED_BY(mutex);
  std::uint64_t refusals GUARDED_BY(mutex){0};
  std::deque<std::string> refused_guids GUARDED_BY(mutex);  // Newest first.
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

struct Refusal {
  std::string_view of;  // participant, writer, reader
  std::string guid;
  std::string reason;
};

// The library's report on others that have a key of our authority, but not the
// right to what they do. It is only in its log: the listener of a participant
// hears of keys that are none.
std::optional<Refusal> RefusalIn(const Log::Entry& entry) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 4>
      kBegins{{{"Error checking create remote writer ", "writer"},
               {"Error checking create remote reader ", "reader"},
               {"Error validating remote permissions for ", "participant"},
               {"Error checking remote participant  ", "participant"}}};
  const std::string& text = entry.message;
  const auto found = std::ranges::find_if(kBegins, [&](const auto& begin) {
    return text.starts_with(begin.first);
  });
  // Behind it follows: GUID (REASON (FILE:LINE))
  const std::size_t reason = text.find(" (");
  if (found == kBegins.end() || reason == std::string::npos) {
    return std::nullopt;
  }
  const std::size_t end = std::min(text.find(" (", reason + 2), text.size());
  const std::size_t guid = found->first.size();
  return Refusal{found->second, text.substr(guid, reason - guid),
                 text.substr(reason + 2, end - reason - 2)};
}

// True if it is the first refusal of that GUID, which counts: the library
// repeats it for each of our participants and endpoints.
bool CountOnce(const Refusal& refusal) {
  Registry& registry = GlobalRegistry();
  const MutexLock lock(registry.mutex);
  std::deque<std::string>& known = registry.refused_guids;
  if (std::ranges::find(known, refusal.guid) != known.end()) {
    return false;
  }
  known.push_front(refusal.guid);
  if (known.size() > kMaxRefusals) {
    known.pop_back();
  }
  ++registry.refusals;
  return true;
}

std::string Quoted(std::string text) {
  std::ranges::replace(text, '\n', ' ');
  std::ranges::replace(text, '"', '\'');
  return '"' + text + '"';
}

// Called by the library's log thread.
class Throttle : public eprosima::fastdds::dds::LogConsumer {
 public:
  void Consume(const Log::Entry& entry) override {
    const std::optional<Refusal> refusal = RefusalIn(entry);
    if (refusal && !CountOnce(*refusal)) {
      return;
    }
    const auto place = std::make_pair(
        std::string(entry.context.filename ? entry.context.filename : ""),
        entry.context.line);
    Place& seen = places_[place];
    const Clock::time_point now = Clock::now();
    if (seen.count > 0 && now - seen.last < kQuietTime) {
      ++seen.suppressed;
      return;
    }
    std::string line =
        refusal
            ? "permission_refused of=" + std::string(refusal->of) +
                  " guid=" + refusal->guid +
                  " reason=" + Quoted(refusal->reason)
            : "dds_library category=" + std::string(entry.context.category) +
                  " text=" + Quoted(entry.message);
    if (seen.suppressed > 0) {
      line += " suppressed=" + std::to_string(seen.suppressed);
    }
    seen = {now, seen.count + 1, 0};
    Registry& registry = GlobalRegistry();
    const MutexLock lock(registry.mutex);
    if (!registry.sinks.empty() && *registry.sinks.back()) {
      (*registry.sinks.back())(
          refusal ? LogLevel::kWarning : LevelOf(entry.kind), line);
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

std::uint64_t RefusedPermissions() {
  Registry& registry = GlobalRegistry();
  const MutexLock lock(registry.mutex);
  return registry.refusals;
}

void CountRefusedPermission() {
  Registry& registry = GlobalRegistry();
  const MutexLock lock(registry.mutex);
  ++registry.refusals;
}

}  // namespace fdi::idl
