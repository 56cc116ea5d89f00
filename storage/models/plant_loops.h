#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "diagnosis/model/valve_identity.h"
#include "storage/models/models.h"

namespace fdi::storage {

/// Way to watch a loop of the plant.
enum class LoopWatch : std::uint8_t {
  kNothing,
  kAudit,   ///< The audit of loops: no model set is needed.
  kFaults,  ///< A model set, which names faults.
};
std::string_view LoopWatchName(LoopWatch watch);  ///< "nothing", ...

/// Progress of a row of the plant's table.
enum class LoopState : std::uint8_t {
  kExpected,   ///< Listed; its record was not read yet.
  kOnboarded,  ///< Has a model set.
  kDataOnly,   ///< Its record was read; no model set is asked for or possible.
  kRefused,    ///< PlantLoop::finding says why.
};
std::string_view LoopStateName(LoopState state);  ///< "expected", ...

/// A loop that ought to be there, as the table of the plant states it.
struct PlantLoop : ValveIdentity {
  std::string name;     ///< The id of its valve.
  std::string type{};   ///< Empty: data only.
  std::string group{};  ///< Valves of one group may share a cause.
  LoopWatch watch{LoopWatch::kNothing};
  LoopState state{LoopState::kExpected};
  std::string finding{};       ///< One sentence about its record.
  std::string input_hash{};    ///< Hash of its row and record; empty: not read.
  std::int64_t checked_ns{0};  ///< UTC; set by the store.
};

/// The result for one valve, which ModelStore::Store() stores all or not at
/// all.
struct ValveResult {
  /// The entry if the valve has none yet; an existing one keeps its epoch and
  /// its model set unless `models` replaces that. Without a pattern only the
  /// set and the type are stored.
  ValveEntry entry;
  std::optional<ModelSet> models;
  BaselineRecord baseline;  ///< Epoch, set and version are those of the store.
  /// Makes the type to store from the set as it was saved.
  std::function<ValveType(const ModelSet&)> type;
  std::optional<PlantLoop> loop;
  Lineage lineage{};  ///< Lineage of `models`.
};

/// The loop of that name.
std::optional<PlantLoop> FindLoop(ModelStore& store, std::string_view name);

}  // namespace fdi::storage
