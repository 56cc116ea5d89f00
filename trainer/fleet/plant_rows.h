#pragma once

#include "import/plant_table.h"
#include "storage/models/plant_loops.h"

namespace fdi::trainer {

/// The loop as the table lists it, before its record is read.
/// @param before states what the row leaves open of who it is; the service
///   is of the table alone.
storage::PlantLoop LoopOf(const importer::PlantRow& row,
                          const ValveIdentity& before = {});
/// The entry of its valve.
storage::ValveEntry EntryOf(const importer::PlantRow& row);

}  // namespace fdi::trainer
