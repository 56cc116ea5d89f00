#include "storage/plot/time_figure.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/error.h"
#include "storage/plot/figure_script.h"
#include "storage/plot/gnuplot.h"

namespace fdi::storage {
namespace {

bool HasNumber(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(),
                     [](double value) { return std::isfinite(value); });
}

// Without curves and panels that have no number, which gnuplot cannot draw.
TimeFigure Drawable(TimeFigure figure) {
  for (FigurePanel& panel : figure.panels) {
    std::erase_if(panel.curves,
                  [](const Curve& c) { return !HasNumber(c.values); });
  }
  std::erase_if(figure.panels,
                [](const FigurePanel& panel) { return panel.curves.empty(); });
  return figure;
}

}  // namespace

std::string GnuplotScript(const TimeFigure& figure,
                          const std::filesystem::path& output) {
  const TimeFigure drawable = Drawable(figure);
  if (drawable.t_s.empty() || drawable.panels.empty()) {
    throw DataError(figure.title + ": there is nothing to draw in that time");
  }
  return FigureScript(drawable, output);
}

void DrawFigure(const TimeFigure& figure, const std::filesystem::path& output) {
  const std::string ending = output.extension().string();
  if (ending != ".png" && ending != ".svg") {
    throw ConfigError("cannot draw " + output.string() +
                      "; accepted endings are .png and .svg");
  }
  const std::filesystem::path folder = output.parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder)) {
    throw DataError("cannot draw " + output.string() + ": no folder " +
                    folder.string());
  }
  RunGnuplot(GnuplotScript(figure, output));
}

}  // namespace fdi::storage
