#include "monitor/bus/share_watch.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "base/printable.h"
#include "diagnosis/records/partitions.h"
#include "diagnosis/records/valve_glob.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

// A monitor announces its share once a second.
constexpr milliseconds kPeerTimeout{3500};
constexpr std::size_t kMaxMonitors = 64;

// True if a publisher can be in both partitions. For two patterns this is known
// only if one matches the other as text.
bool Overlap(const std::string& a, const std::string& b) {
  if (a == b) {
    return true;
  }
  const auto names = PartitionNames(b);
  return std::ranges::any_of(PartitionNames(a), [&](const std::string& x) {
    return std::ranges::any_of(names, [&](const std::string& y) {
      return GlobMatches(x, y) || GlobMatches(y, x);
    });
  });
}

bool AreCompetitors(const MonitorShare& own, const MonitorShare& other) {
  return other.monitor != own.monitor &&
         Overlap(own.partitions, other.partitions);
}

}  // namespace

ContestedValves FindContested(const MonitorShare& own,
                              const std::vector<MonitorShare>& others,
                              const std::vector<std::string>& valves) {
  std::vector<MonitorShare> rivals;
  std::ranges::copy_if(
      others, std::back_inserter(rivals),
      [&](const auto& other) { return AreCompetitors(own, other); });
  ContestedValves contested;
  if (rivals.empty()) {
    return contested;
  }
  for (const std::string& valve : valves) {
    const auto rival = std::ranges::find_if(rivals, [&](const auto& other) {
      return GlobMatches(other.valves, valve);
    });
    if (rival != rivals.end() && contested.count++ == 0) {
      contested.example = valve;
      contested.monitor = rival->monitor;
    }
  }
  return contested;
}

ShareWatch::ShareWatch(idl::Participant& participant, MonitorShare own,
                       ThrottledLog& log)
    : own_(std::move(own)), log_(log), out_(participant), in_(participant) {
  if (own_.valves.size() > idl::kMaxTextLength) {
    throw ConfigError("--valve: expected a glob of at most " +
                      std::to_string(idl::kMaxTextLength) + " characters");
  }
}

void ShareWatch::Tick(const std::function<std::vector<std::string>()>& valves) {
  out_.Write(own_);
  const Clock::time_point now = Clock::now();
  in_.Take(
      {[&](const MonitorShare& share, const auto&) {
         if (peers_.size() < kMaxMonitors || peers_.contains(share.monitor)) {
           peers_[share.monitor] = {share, now};
         }
       },
       {}},
      milliseconds(0));
  std::erase_if(peers_, [&](const auto& each) {
    return now - each.second.at > kPeerTimeout;
  });
  std::vector<MonitorShare> others;
  for (const auto& [monitor, peer] : peers_) {
    if (AreCompetitors(own_, peer.share)) {
      others.push_back(peer.share);
    }
  }
  const ContestedValves found = others.empty()
                                    ? ContestedValves{}
                                    : FindContested(own_, others, valves());
  if (found.count > 0) {
    log_.Report(
        LogId::kContested, "valves_contested",
        [&found] {
          return "valves=" + std::to_string(found.count) +
                 " first=" + LogValue(found.example) +
                 " other=" + LogValue(found.monitor);
        },
        LogLevel::kError);
  }
  const MutexLock lock(mutex_);
  contested_ = found;
}

}  // namespace fdi::monitor
