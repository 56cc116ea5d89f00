#include "monitor/shadow_difference.h"

#include <map>
#include <tuple>
#include <utility>

namespace fdi::monitor {
namespace {

constexpr std::size_t kMostDifferences = 100'000;

}  // namespace

std::vector<ShadowDifference> Merged(std::vector<ShadowDifference> older,
                                     std::vector<ShadowDifference> newer) {
  if (older.empty()) {
    return newer;
  }
  using Key =
      std::tuple<std::string, std::uint64_t, std::int64_t, std::uint64_t>;
  const auto key_of = [](const ShadowDifference& d) {
    return Key(d.valve_id, d.source_id, d.from_ns, d.candidate_hash);
  };
  std::map<Key, std::size_t> places;
  for (std::size_t i = 0; i < older.size(); ++i) {
    places[key_of(older[i])] = i;
  }
  for (ShadowDifference& difference : newer) {
    const auto place = places.find(key_of(difference));
    if (place != places.end()) {
      older[place->second] = std::move(difference);
    } else if (older.size() < kMostDifferences) {
      older.push_back(std::move(difference));
    }
  }
  return older;
}

}  // namespace fdi::monitor
