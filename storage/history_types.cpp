#include "storage/history_types.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/suggestion.h"

namespace fdi::storage {
namespace {

constexpr std::array<std::pair<std::string_view, EpisodeState>, 11> kStates = {{
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
}};

}  // namespace

std::string EpisodeIdText(std::uint64_t episode_id) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx",
                static_cast<unsigned long long>(episode_id));
  return text;
}

TraceInstant MakeTraceInstant(const StoredSample& sample,
                              const Verdict& verdict, const ModelSet& models) {
  TraceInstant instant;
  instant.received = sample;
  instant.quality = verdict.quality;
  instant.state = verdict.state;
  instant.isolated = verdict.isolated;
  instant.normal_factor = verdict.normal_factor;
  instant.residuals.assign(
      verdict.residuals.begin(),
      verdict.residuals.begin() +
          static_cast<std::ptrdiff_t>(models.channels.size()));
  instant.fault_factors.assign(
      verdict.fault_factors.begin(),
      verdict.fault_factors.begin() +
          static_cast<std::ptrdiff_t>(models.faults.size()));
  return instant;
}

std::uint64_t EpisodeIdOf(const NewEvent& event) {
  return event.resumed_episode.value_or(EpisodeId(
      event.valve_id, event.source_id, event.transition.detection_stamp_ns));
}

std::vector<std::string> EpisodeStateNames() {
  std::vector<std::string> names;
  for (const auto& [name, state] : kStates) {
    names.emplace_back(name);
  }
  return names;
}

EpisodeState ParseEpisodeState(std::string_view name) {
  const auto* found =
      std::find_if(kStates.begin(), kStates.end(), [name](const auto& state) {
        return std::equal(
            name.begin(), name.end(), state.first.begin(), state.first.end(),
            [](char a, char b) {
              return std::tolower(static_cast<unsigned char>(a)) == b;
            });
      });
  if (found == kStates.end()) {
    std::string message = "unknown state '" + std::string(name) + "'";
    if (const auto meant = Suggest(std::string(name), EpisodeStateNames())) {
      message += " (did you mean '" + *meant + "'?)";
    }
    message += "; there are";
    for (const auto& state : kStates) {
      message += (&state == kStates.begin() ? " " : ", ");
      message += state.first;
    }
    throw ConfigError(message);
  }
  return found->second;
}

}  // namespace fdi::storage
