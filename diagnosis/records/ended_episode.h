#pragma once

#include <cstdint>
#include <string>

namespace fdi {

/// An episode that is over.
struct EndedEpisode {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t episode_id{0};
  std::int64_t ended_ns{0};  ///< Stamp of the end.
};

}  // namespace fdi
