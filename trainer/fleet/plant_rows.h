#pragma once

#include "import/plant_table.h"
#include "storage/models/plant_loops.h"

namespace fdi::trainer {

/// The loop as the table lists it, before its record is read.
storage::PlantLoop LoopOf(const importer::PlantRow& row);
/// The entry of its valve.
storage::ValveEntry EntryOf(const importer::PlantRow& row);

}  // namespace fdi::trainer
