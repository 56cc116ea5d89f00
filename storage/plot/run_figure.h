#pragma once

#include "storage/plot/time_figure.h"
#include "storage/run_types.h"

namespace fdi::storage {

/// The signals of a run, or a stretch of it, over the time from its start: CV
/// and X; flow; pressures; further signals, as far as the run has them. The
/// truth is shaded; marks stand where observers were initialised, another model
/// set took over, and where samples were refused.
TimeFigure RunFigure(const StoredRun& run);

}  // namespace fdi::storage
