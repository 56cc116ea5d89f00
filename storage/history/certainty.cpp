#include "storage/history/certainty.h"

namespace fdi::storage {

Certainty CertaintyOf(const Episode& episode) {
  const bool outside =
      episode.unknown_kind == UnknownName(Unknown::kOutsideKnown);
  return WithLookAlikes(
      fdi::CertaintyOf(episode.fault.value_or(""),
                       ParseLayer(episode.layer.value_or("")),
                       episode.peak_factor,
                       outside ? Unknown::kOutsideKnown : Unknown::kTooEarly),
      LookAlikesOf(episode));
}

std::vector<std::string> LookAlikesOf(const Episode& episode) {
  return LookAlikesBeside(episode.fault.value_or(""),
                          ParseLayer(episode.layer.value_or("")),
                          episode.strength, episode.faults);
}

}  // namespace fdi::storage
