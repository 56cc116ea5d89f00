#include "storage/history/certainty.h"

namespace fdi::storage {

Certainty CertaintyOf(const Episode& episode) {
  const bool outside =
      episode.unknown_kind == UnknownName(Unknown::kOutsideKnown);
  // What ended without a name is "unknown", whether a fault fitted or not.
  return WithLookAlikes(
      fdi::CertaintyOf(IsNamed(episode) ? *episode.fault : "",
                       ParseLayer(episode.layer.value_or("")),
                       episode.peak_factor,
                       outside ? Unknown::kOutsideKnown : Unknown::kTooEarly),
      LookAlikesOf(episode));
}

std::vector<std::string> LookAlikesOf(const Episode& episode) {
  return LookAlikesBeside(episode.fault.value_or(""),
                          ParseLayer(episode.layer.value_or("")),
                          episode.strength, episode.known);
}

std::string_view NoNameText(const Episode& episode) {
  if (IsNamed(episode) || CertaintyOf(episode) == Certainty::kNotKnown) {
    return "";
  }
  return episode.ended_ns && !episode.unconfirmed_ns
             ? "Fault that ended before it had a name"
             : "Fault without a name yet";
}

}  // namespace fdi::storage
