#pragma once

#include <string>

#include "diagnosis/loop/audit.h"
#include "report/plot/figure.h"

namespace fdi::plot {

/// A window of a loop and what its audit found: OP and X, then PV and SP over
/// time, and below PV (or X) over OP with the fitted play: its two sides, one
/// band apart.
Figure LoopFigure(const std::string& name, const loop::Window& window,
                  const loop::Audit& audit);

}  // namespace fdi::plot
