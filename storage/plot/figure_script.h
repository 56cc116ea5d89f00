#pragma once

#include <filesystem>
#include <string>

#include "storage/plot/time_figure.h"

namespace fdi::storage {

/// GnuplotScript() of a figure whose every curve has a number.
std::string FigureScript(const TimeFigure& figure,
                         const std::filesystem::path& output);

}  // namespace fdi::storage
