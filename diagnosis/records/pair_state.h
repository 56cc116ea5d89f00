#pragma once

#include <cstdint>
#include <string>

namespace fdi {

/// State of one monitor of a pair, as published on the topic PairState.
struct PairState {
  std::string monitor;        ///< Unique name of the process, e.g. host:pid.
  std::string pair;           ///< The same for both.
  int rank{1};                ///< The lower one is preferred.
  std::uint64_t instance{0};  ///< Random, new at each start.
  bool leads{false};          ///< It publishes.
  bool leaving{false};        ///< Its last message before it stops.
  int judged{0};              ///< Valves that are not silent and have settled.
  std::uint64_t received{0};  ///< Samples since its start.
};

}  // namespace fdi
