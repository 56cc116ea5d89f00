#pragma once

#include "storage/cli/json_output.h"
#include "storage/run_types.h"

namespace fdi::storage {

/// One run as fdi-store shows it.
cli::Json RunJson(const RunInfo& info);

}  // namespace fdi::storage
