#pragma once

#include "import/plant_table.h"
#include "storage/models/plant_loops.h"

namespace fdi::trainer {

/// The loop as the table lists it, before its record is read.
/// @param before states the identity where the row leaves it open; the service
///   is always that of the table.
storage::PlantLoop LoopOf(const importer::PlantRow& row,
                          const ValveIdentity& before = {});
/// The entry of its valve.
storage::ValveEntry EntryOf(const importer::PlantRow& row);

}  // namespace fdi::trainer
