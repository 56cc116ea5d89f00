#pragma once

#include "cli/plot/figure.h"
#include "storage/runs/runs.h"

namespace fdi::plot {

/// The signals of a run, or a stretch of it, over the time from its start: CV
/// and X; flow; pressures; further signals, as far as the run has them. The
/// truth is shaded; marks stand where observers were initialised and where
/// another model set took over; refused samples are counted in the footnote.
Figure RunFigure(const storage::StoredRun& run);

}  // namespace fdi::plot
