#pragma once

#include "idl/participant.h"
#include "storage/cli/global_options.h"

namespace fdi::monitor {

/// Where on the bus a program is, as its options say.
idl::DdsOptions DdsOptionsOf(const cli::GlobalOptions& options, int max_valves);

}  // namespace fdi::monitor
