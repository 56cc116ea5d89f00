#pragma once

#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/records/valve_glob.h"
#include "storage/models/models.h"

namespace fdi::storage {

/// True if what was noted for `valves`, an id or a glob, is about this valve.
inline bool IsAbout(std::string_view valves, std::string_view valve_id) {
  return valves == valve_id || GlobMatches(valves, valve_id);
}

/// Work noted of one valve, by its id or by a glob, in order of time.
inline std::vector<ValveEvent> RepairsOf(ModelStore& store,
                                         std::string_view valve_id) {
  std::vector<ValveEvent> repairs;
  for (auto& [valves, event] : store.Repairs()) {
    if (IsAbout(valves, valve_id)) {
      repairs.push_back(std::move(event));
    }
  }
  return repairs;
}

}  // namespace fdi::storage
