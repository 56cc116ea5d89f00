#pragma once

#include <iosfwd>
#include <string>

#include "storage/app/common.h"
#include "storage/models.h"

namespace fdi::storage {

/// Adds "events" and "baselines" of the valve entry `pattern` to `object`.
void AddEpochs(ModelStore& store, const std::string& pattern,
               cli::Json& object);

/// Prints the events of the valve and, side by side, the newest baseline of
/// each epoch: as found and as left. Nothing if there are none.
void PrintEpochs(std::ostream& out, ModelStore& store,
                 const std::string& pattern, const cli::Context& context);

}  // namespace fdi::storage
