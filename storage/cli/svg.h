#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fdi::cli {

/// Part of a picture [px]; y grows downwards.
struct SvgArea {
  double left{0.0};
  double top{0.0};
  double width{0.0};
  double height{0.0};

  double right() const { return left + width; }
  double bottom() const { return top + height; }
};

/// Values from..to mapped linearly onto pixels at_from..at_to.
struct SvgScale {
  double from{0.0};
  double to{1.0};
  double at_from{0.0};
  double at_to{1.0};

  double operator()(double value) const {
    return at_from + (value - from) / (to - from) * (at_to - at_from);
  }
};

/// Number of distinct series classes s0, s1, ...: seven colours of Okabe and
/// Ito, which the colour-blind can tell apart, then the same dashed and dotted.
inline constexpr int kSvgSeries = 21;

/// Rules for everything drawn here, light and dark by prefers-color-scheme.
/// Classes: s0..s20 lines of series; right, partly, wrong, open bands; grid,
/// frame, limit, mark lines; wide, main strokes; bar; text with end, middle or
/// head.
std::string_view SvgStyle();

/// `text` for element content and attribute values.
std::string XmlText(std::string_view text);

/// "12", "12.5", ".5": as short as pixels go, halves of one.
std::string SvgNumber(double pixels);

/// About `count` round values within [from, to].
std::vector<double> RoundTicks(double from, double to, int count);

/// "0.25", "1e-05": short, for ticks and legends.
std::string ShortNumber(double value);

/// A picture under construction. Colours come from the classes alone.
class SvgCanvas {
 public:
  /// @param title what a screen reader says.
  SvgCanvas(double width, double height, std::string_view title);

  void Line(double x1, double y1, double x2, double y2,
            std::string_view classes);
  /// @param hint shown under the pointer; may be empty.
  void Rectangle(const SvgArea& area, std::string_view classes,
                 std::string_view hint = {});
  void Text(double x, double y, std::string_view text,
            std::string_view classes = {});
  /// @param data as in the attribute d.
  void Path(std::string_view data, std::string_view classes);

  /// For a page that carries SvgStyle() once.
  std::string Element() const;
  /// For a file of its own.
  std::string Document() const;

 private:
  std::string Wrapped(std::string_view style) const;

  double width_;
  double height_;
  std::string title_;
  std::string body_;
};

/// One axis of a panel.
struct SvgAxis {
  double from{0.0};
  double to{1.0};
  std::string label;  ///< With its unit.
  int ticks{5};
  bool labelled{true};
};

/// Axes around an area, and where values fall in it.
class SvgPanel {
 public:
  /// Draws frame, grid, ticks and labels. An empty range is widened.
  SvgPanel(SvgCanvas& canvas, const SvgArea& area, const SvgAxis& horizontal,
           const SvgAxis& vertical);

  const SvgArea& area() const { return area_; }
  const SvgScale& x() const { return x_; }
  const SvgScale& y() const { return y_; }

 private:
  void DrawHorizontal(SvgCanvas& canvas, const SvgAxis& axis) const;
  void DrawVertical(SvgCanvas& canvas, const SvgAxis& axis) const;

  SvgArea area_;
  SvgScale x_;
  SvgScale y_;
};

/// "s3": the class of series `index`, from 0, round and round.
std::string SvgSeries(std::size_t index);

/// Lines of a legend, downwards: a stroke of the class and its text.
struct SvgLegendEntry {
  std::string classes;
  std::string text;
};
void DrawLegend(SvgCanvas& canvas, double left, double top,
                const std::vector<SvgLegendEntry>& entries);

}  // namespace fdi::cli
