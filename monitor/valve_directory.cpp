#include "monitor/valve_directory.h"

#include <utility>

#include <fnmatch.h>

namespace fdi::monitor {
namespace {

constexpr std::size_t kRememberedRefusals = 65536;

}  // namespace

bool GlobMatches(const std::string& glob, std::string_view text) {
  return fnmatch(glob.c_str(), std::string(text).c_str(), FNM_NOESCAPE) == 0;
}

ValveDirectory::ValveDirectory(int max_valves, std::string glob)
    : max_valves_(static_cast<std::size_t>(max_valves)),
      glob_(std::move(glob)) {}

ValveDirectory::Answer ValveDirectory::Find(std::string_view valve_id,
                                            Entry& entry) {
  auto found = entries_.find(valve_id);
  if (found == entries_.end()) {
    if (glob_ != "*" && !GlobMatches(glob_, valve_id)) {
      return Answer::kFiltered;
    }
    if (entries_.size() >= max_valves_) {
      if (refused_.size() < kRememberedRefusals) {
        refused_.insert(std::hash<std::string_view>{}(valve_id));
      }
      return Answer::kRefused;
    }
    found = entries_
                .emplace(std::string(valve_id),
                         static_cast<std::uint32_t>(entries_.size()))
                .first;
  }
  entry = {found->second, &found->first};
  return Answer::kServed;
}

}  // namespace fdi::monitor
