#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fdi::storage {

// Colours that the colour-blind can tell, after Okabe & Ito (2008), "Color
// Universal Design". Lines that are compared also differ in width or dashes.
namespace ink {
inline constexpr const char* kBlack = "#000000";
inline constexpr const char* kGrey = "#8c8c8c";
inline constexpr const char* kBlue = "#0072b2";
inline constexpr const char* kVermilion = "#d55e00";
inline constexpr const char* kGreen = "#009e73";
inline constexpr const char* kOrange = "#e69f00";
inline constexpr const char* kSky = "#56b4e9";
inline constexpr const char* kPurple = "#cc79a7";
}  // namespace ink

enum class Dash { kSolid = 1, kDashed = 2, kDotted = 3, kDashDot = 4 };

/// One line over time; NaN breaks it.
struct Curve {
  std::string title;  ///< Empty: not in the legend.
  std::string colour{ink::kBlack};
  double width{1.5};  ///< [points]
  Dash dash{Dash::kSolid};
  std::vector<double> values;  ///< One per time of the figure.
};

/// A dashed horizontal line, e.g. a threshold.
struct Level {
  double value{0.0};
  std::string title;  ///< Empty: not in the legend.
  std::string colour{ink::kPurple};
};

struct FigurePanel {
  std::string label;  ///< With its unit: "flow F [m3/h]".
  std::vector<Curve> curves;
  std::vector<Level> levels;
  bool unit_range{false};  ///< From 0 to 1, with some space.
};

/// A vertical line at a time, named above the first panel.
struct FigureMark {
  double t_s{0.0};
  std::string text;
  std::string colour{ink::kBlack};
};

/// A shaded time.
struct FigureBand {
  double from_s{0.0};
  double to_s{0.0};
  std::string text;
  std::string colour{"#dcdcdc"};
};

/// Panels above each other on one time axis, with marks and bands through all.
struct TimeFigure {
  std::string title;
  std::string subtitle;
  std::string time_label;   ///< "time from detection".
  double gap_s{1.5};        ///< A longer step in time breaks the lines.
  std::vector<double> t_s;  ///< In order.
  std::vector<FigurePanel> panels;
  std::vector<FigureMark> marks;
  std::vector<FigureBand> bands;
  std::string footnote;
};

/// The script that draws `figure` to `output`. Of what is denser than the
/// picture, the extremes stay. @throws DataError if there is nothing to draw.
std::string GnuplotScript(const TimeFigure& figure,
                          const std::filesystem::path& output);

/// @param output ends in .png or .svg.
/// @throws ConfigError for another ending; DataError if there is nothing to
///   draw or the file cannot be written; std::runtime_error if gnuplot is
///   missing or fails.
void DrawFigure(const TimeFigure& figure, const std::filesystem::path& output);

}  // namespace fdi::storage
