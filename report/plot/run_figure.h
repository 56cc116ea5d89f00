#pragma once

#include "report/plot/figure.h"
#include "storage/runs/runs.h"

namespace fdi::plot {

/// The signals of a run, or of a part of it, over the time from its start: CV
/// and X; flow; pressures; other signals that it has. The truth is shaded;
/// marks show where observers were initialised and where the model set changed;
/// the footnote counts rejected samples.
Figure RunFigure(const storage::StoredRun& run);

}  // namespace fdi::plot
