#pragma once

#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "report/plot/gnuplot.h"

/// Figures: panels above each other on one horizontal axis, drawn by gnuplot as
/// PNG or SVG. A caller fills a Figure and calls DrawFigure().
namespace fdi::plot {

// Colours that are distinguishable with colour blindness, after Okabe & Ito
// (2008), "Color Universal Design". Lines to be compared also differ in width
// or dashes.
namespace ink {
inline constexpr const char* kBlack = "#000000";
inline constexpr const char* kGrey = "#8c8c8c";
inline constexpr const char* kPale = "#c8c8c8";
inline constexpr const char* kBlue = "#0072b2";
inline constexpr const char* kVermilion = "#d55e00";
inline constexpr const char* kGreen = "#009e73";
inline constexpr const char* kOrange = "#e69f00";
inline constexpr const char* kSky = "#56b4e9";
inline constexpr const char* kPurple = "#cc79a7";
}  // namespace ink

/// A missing value of a series: a gap in its line.
inline constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

enum class Dash { kSolid = 1, kDashed = 2, kDashDot = 4 };

/// Way to draw the points of a series.
enum class Shape {
  kLine,
  kSteps,   ///< Each value holds until the next abscissa.
  kPoints,  ///< Dots, not joined.
  kBars,    ///< Bars from 0 that fill the space between abscissae.
};

/// The interval from `from` to `to` on an axis.
struct Range {
  double from{0.0};
  double to{1.0};
};

/// One value per abscissa; NaN breaks the line.
struct Series {
  std::string title{};  ///< Empty: not in the legend.
  std::string colour{ink::kBlack};
  double width{1.5};  ///< [points]
  Dash dash{Dash::kSolid};
  std::vector<double> y;
  std::vector<double> x{};  ///< Ascending. Empty: those of the figure.
  Shape shape{Shape::kLine};
};

/// A dashed horizontal line through a panel, e.g. a threshold.
struct Limit {
  double value{0.0};
  std::string title;  ///< Empty: not in the legend.
  std::string colour{ink::kPurple};
};

/// A shaded interval of the horizontal axis.
struct Band {
  double from{0.0};
  double to{0.0};
  std::string text;  ///< Omitted if there is no room.
  std::string colour{"#dcdcdc"};
};

/// A vertical line through all panels, named above the first one.
struct Mark {
  double x{0.0};
  std::string text;
  std::string colour{ink::kBlack};
};

/// One pair of axes. A panel with only bands is a strip without values.
struct Panel {
  std::string label;  ///< Vertical axis, with unit: "flow F [m3/h]".
  std::vector<Series> series{};
  std::vector<Limit> limits{};
  std::optional<Range> range{};      ///< Range of the values; empty: automatic.
  std::vector<Band> bands{};         ///< In this panel only.
  std::vector<std::string> notes{};  ///< Lines of text below the legend.
  double height{200.0};              ///< [px]
  /// A horizontal axis of its own, for the last panel: one variable over
  /// another. Its series have their own x, in any order.
  std::optional<Range> own_axis{};
  std::string own_label{};  ///< Label of that axis, with unit.
};

/// Panels above each other on one horizontal axis, but see Panel::own_axis.
struct Figure {
  std::string title;
  std::string subtitle{};
  std::string footnote{};
  std::string x_label{};
  /// The abscissae are seconds: the axis is scaled to s, min, h or d as
  /// suitable, and the unit is added to its label.
  bool is_time{false};
  /// The second of the day that abscissa 0 stands for: the axis, which has to
  /// be shorter than a day, shows the clock.
  std::optional<double> clock_s{};
  double gap{1e300};        ///< Longer steps between abscissae break lines.
  std::vector<double> x{};  ///< Ascending.
  std::optional<Range> x_range{};  ///< Empty: from the first to the last x.
  std::vector<Panel> panels{};
  std::vector<Mark> marks{};
  std::vector<Band> bands{};   ///< Through all panels.
  double width{1400.0};        ///< [px]
  double legend_width{250.0};  ///< Right of the panels [px].
  /// If there are more points, only the extremes of this many groups are drawn,
  /// so that no peak is lost and the picture's size is bounded.
  std::size_t groups{1600};
};

enum class Format { kPng, kSvg };

/// Format by file extension, .png or .svg. @throws ConfigError
Format FormatOf(const std::filesystem::path& file);

/// The script with which gnuplot draws `figure` to `output`.
/// @throws DataError if there is nothing to draw.
std::string GnuplotScript(const Figure& figure, Format format,
                          const std::filesystem::path& output);

/// The bytes of the picture.
/// @throws DataError if there is nothing to draw; std::runtime_error if gnuplot
///   is missing or fails.
std::string DrawFigure(const Figure& figure, Format format,
                       const GnuplotLimits& limits = {});

/// Draws to the file `output`, whose extension gives the format. The file is
/// created only if drawing succeeds.
/// @throws as above; ConfigError for another extension; DataError if the file
///   cannot be written.
void DrawFigure(const Figure& figure, const std::filesystem::path& output);

}  // namespace fdi::plot
