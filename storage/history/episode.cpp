#include "storage/history/episode.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <utility>

#include "base/error.h"
#include "base/suggestion.h"
#include "base/text.h"

namespace fdi::storage {
namespace {

constexpr std::array<std::pair<std::string_view, EpisodeState>, 12> kStates = {{
    {"any", EpisodeState::kAny},
    {"open", EpisodeState::kOpen},
    {"detected", EpisodeState::kDetected},
    {"isolated", EpisodeState::kIsolated},
    {"closed", EpisodeState::kClosed},
    {"unacked", EpisodeState::kUnacked},
    {"unack", EpisodeState::kAlarmUnacked},
    {"acked", EpisodeState::kAlarmAcked},
    {"rtn_unack", EpisodeState::kAlarmReturnedUnacked},
    {"normal", EpisodeState::kAlarmNormal},
    {"shelved", EpisodeState::kAlarmShelved},
    {"notice", EpisodeState::kAlarmNotice},
}};

}  // namespace

bool IsNamed(const Episode& episode) {
  return episode.fault && *episode.fault != "unknown";
}

std::string EpisodeIdText(std::uint64_t episode_id) {
  return Hex16(episode_id);
}

std::optional<std::uint64_t> ParseEpisodeId(std::string_view text) {
  std::uint64_t id = 0;
  std::from_chars(text.data(), text.data() + text.size(), id, 16);
  return EpisodeIdText(id) == text ? std::optional(id) : std::nullopt;
}

std::vector<std::string> EpisodeStateNames() {
  std::vector<std::string> names;
  for (const auto& [name, state] : kStates) {
    names.emplace_back(name);
  }
  return names;
}

EpisodeState ParseEpisodeState(std::string_view name) {
  const auto* found = std::ranges::find(kStates, Lower(name),
                                        &decltype(kStates)::value_type::first);
  if (found == kStates.end()) {
    std::string message = "unknown state '" + std::string(name) + "'";
    if (const auto meant = Suggest(std::string(name), EpisodeStateNames())) {
      message += " (did you mean '" + *meant + "'?)";
    }
    throw ConfigError(message + "; there are " + JoinText(EpisodeStateNames()));
  }
  return found->second;
}

}  // namespace fdi::storage
