#pragma once

#include <ostream>
#include <vector>

#include "storage/plot/time_figure.h"

namespace fdi::storage {

/// Lines "t y" for gnuplot, t in units of `unit_s`; NaN where the line breaks.
/// Of more than some thousand the least and greatest of equal groups stay.
void WritePoints(const TimeFigure& figure, const std::vector<double>& values,
                 double unit_s, std::ostream& out);

}  // namespace fdi::storage
