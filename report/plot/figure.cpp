#include "report/plot/figure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <vector>

#include "base/error.h"
#include "report/output_folder.h"
#include "report/plot/gnuplot.h"

namespace fdi::plot {
namespace {

constexpr double kDayS = 86400.0;

// Sizes [px].
constexpr double kPanelGap = 16.0;
constexpr double kTitleHeight = 76.0;
constexpr double kMarkRow = 20.0;
constexpr double kBottom = 96.0;
constexpr double kLeft = 110.0;
constexpr double kLetter = 8.5;  // mean width

// Tags of gnuplot's labels and arrows, by which those of one panel are removed
// before the next one is drawn.
constexpr int kFirstNameTag = 100;
constexpr int kFirstStemTag = 1000;

struct TimeUnit {
  double seconds;
  const char* name;
};

TimeUnit UnitOf(double span_s) {
  return span_s <= 900.0         ? TimeUnit{1.0, "s"}
         : span_s <= 4 * 3600.0  ? TimeUnit{60.0, "min"}
         : span_s <= 4 * 86400.0 ? TimeUnit{3600.0, "h"}
                                 : TimeUnit{86400.0, "d"};
}

bool HasNumber(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(),
                     [](double value) { return std::isfinite(value); });
}

// gnuplot refuses to plot a series without any number; such series, and panels
// with nothing else, are removed.
Figure Drawable(Figure figure) {
  for (Panel& panel : figure.panels) {
    std::erase_if(panel.series,
                  [](const Series& series) { return !HasNumber(series.y); });
  }
  std::erase_if(figure.panels, [](const Panel& panel) {
    return panel.series.empty() && panel.bands.empty();
  });
  return figure;
}

// The horizontal range: as requested, else that of everything drawn.
Range RangeOf(const Figure& figure) {
  if (figure.x_range) {
    return *figure.x_range;
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Range range{kInfinity, -kInfinity};
  const auto include = [&range](const std::vector<double>& x) {
    if (!x.empty()) {
      range.from = std::min(range.from, x.front());
      range.to = std::max(range.to, x.back());
    }
  };
  include(figure.x);
  for (const Panel& panel : figure.panels) {
    for (const Series& series : panel.series) {
      if (!panel.own_axis) {
        include(series.x);
      }
    }
  }
  // gnuplot refuses an axis of no length, which a single point would give.
  return {range.from, std::max(range.to, range.from + 1e-3)};
}

// Writes the points of a series as lines "x y"; a line "x NaN" breaks the curve
// where a step in x is longer than the gap of the figure.
class PointWriter {
 public:
  PointWriter(const Figure& figure, const Series& series, double unit,
              double shift, std::ostream& out)
      : x_(series.x.empty() ? figure.x : series.x),
        y_(series.y),
        gap_(figure.gap),
        unit_(unit),
        shift_(shift),
        out_(out) {}

  // Reduces groups of equal size to their extremes, in their original order. A
  // break or a missing value ends a piece of the curve, so that it stays in
  // place, and each piece of a group has its own extremes.
  void Write(std::size_t groups) {
    const std::size_t count = std::min(x_.size(), y_.size());
    // `step` is rounded down and each piece leaves two points at most, so a
    // curve without breaks has at most about three times `groups` points.
    const std::size_t step = std::max<std::size_t>(1, count / groups);
    for (std::size_t i = 0; i < count; i += step) {
      WriteGroup(i, std::min(i + step, count));
    }
  }

 private:
  bool IsGap(std::size_t i) const { return i > 0 && x_[i] - x_[i - 1] > gap_; }
  std::string X(std::size_t i) const {
    return GnuplotNumber((x_[i] + shift_) / unit_);
  }
  void Point(std::size_t i) {
    out_ << X(i) << ' ' << GnuplotNumber(y_[i]) << '\n';
  }
  void WriteGroup(std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end;) {
      if (IsGap(i)) {
        out_ << X(i) << " NaN\n";
      }
      std::size_t next = i + 1;
      if (!std::isfinite(y_[i])) {
        Point(i);
        while (next < end && !std::isfinite(y_[next]) && !IsGap(next)) {
          ++next;
        }
      } else {
        while (next < end && std::isfinite(y_[next]) && !IsGap(next)) {
          ++next;
        }
        Extremes(i, next);
      }
      i = next;
    }
  }
  void Extremes(std::size_t begin, std::size_t end) {
    const auto from = y_.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto to = y_.begin() + static_cast<std::ptrdiff_t>(end);
    const auto [low, high] = std::minmax_element(from, to);
    const auto first = std::min(low, high);
    const auto second = std::max(low, high);
    Point(static_cast<std::size_t>(first - y_.begin()));
    if (first != second) {
      Point(static_cast<std::size_t>(second - y_.begin()));
    }
  }

  const std::vector<double>& x_;
  const std::vector<double>& y_;
  double gap_;
  double unit_;
  double shift_;
  std::ostream& out_;
};

// Writes one script: terminal, data blocks, then a multiplot with one plot per
// panel. Positions are pixels from the top left; gnuplot needs fractions of the
// picture from the bottom left.
//
//     script = terminal {block} frame {panel} "unset multiplot" "set output"
//     block  = "$pNsM << EOD" LF {x " " y LF} "EOD" LF     panel N, series M
//     panel  = shades margins axes "plot" item {"," item}
//     item   = limit / block with style / "keyentry" note
//
// Text from outside (names of valves, faults, events) enters the script through
// GnuplotText() only, because gnuplot can run commands.
class ScriptWriter {
 public:
  ScriptWriter(const Figure& figure, Format format)
      : figure_(figure),
        format_(format),
        range_(RangeOf(figure)),
        is_clock_(figure.clock_s.has_value()),
        unit_(figure.is_time && !is_clock_ ? UnitOf(range_.to - range_.from)
                                           : TimeUnit{1.0, ""}),
        // From the day before on, so that no time is negative.
        shift_(is_clock_ ? *figure.clock_s + kDayS : 0.0) {}

  std::string Write(const std::filesystem::path& output) {
    // First, because the rows of names decide the height of the picture, to
    // which all other positions refer.
    PlaceMarks();
    Terminal(output);
    Data();
    Frame();
    double top = Top();
    for (std::size_t p = 0; p < figure_.panels.size(); ++p) {
      DrawPanel(p, top);
      top += figure_.panels[p].height + GapBelow(p);
    }
    out_ << "unset multiplot\nset output\n";
    return out_.str();
  }

 private:
  double Top() const {
    return kTitleHeight + kMarkRow * static_cast<double>(mark_rows_) + 8.0;
  }
  double Height() const {
    double height = Top() + kBottom;
    for (std::size_t p = 0; p < figure_.panels.size(); ++p) {
      height += figure_.panels[p].height + GapBelow(p);
    }
    return height;
  }
  // True if the time axis ends below this panel, because an axis of its own
  // follows.
  bool IsLastOnAxis(std::size_t p) const {
    return p + 1 == figure_.panels.size() || figure_.panels[p + 1].own_axis;
  }
  double GapBelow(std::size_t p) const {
    return p + 1 < figure_.panels.size() && IsLastOnAxis(p) ? kBottom
                                                            : kPanelGap;
  }
  double Right() const { return figure_.width - figure_.legend_width; }
  std::string ScreenX(double from_left) const {
    return GnuplotNumber(from_left / figure_.width);
  }
  std::string ScreenY(double from_top) const {
    return GnuplotNumber(1.0 - from_top / Height());
  }
  std::string X(double x) const {
    return GnuplotNumber((x + shift_) / unit_.seconds);
  }
  std::string XFormat(bool last, bool own_axis) const {
    const bool clock = is_clock_ && !own_axis;
    const bool seconds = range_.to - range_.from < 600.0;
    return std::string(!last     ? "''"
                       : !clock  ? "'%g'"
                       : seconds ? "'%H:%M:%S'"
                                 : "'%H:%M'") +
           (clock ? " timedate" : " numeric");
  }
  double PixelOf(double x) const {
    return kLeft +
           (Right() - kLeft) * (x - range_.from) / (range_.to - range_.from);
  }
  const char* FontSize(const char* png, const char* svg) const {
    return format_ == Format::kPng ? png : svg;
  }

  // A name is placed to the right of its mark's stem, which reaches up to it.
  // From right to left, each name is placed above all names that its stem would
  // cross.
  void PlaceMarks() {
    marks_ = figure_.marks;
    std::erase_if(marks_, [this](const Mark& mark) {
      return mark.x < range_.from || mark.x > range_.to;
    });
    std::stable_sort(marks_.begin(), marks_.end(),
                     [](const Mark& a, const Mark& b) { return a.x < b.x; });
    rows_.assign(marks_.size(), 0);
    for (std::size_t i = marks_.size(); i-- > 0;) {
      const double end = PixelOf(marks_[i].x) + 16.0 +
                         kLetter * static_cast<double>(marks_[i].text.size());
      for (std::size_t j = i + 1;
           j < marks_.size() && PixelOf(marks_[j].x) < end; ++j) {
        rows_[i] = std::max(rows_[i], rows_[j] + 1);
      }
      mark_rows_ = std::max(mark_rows_, rows_[i] + 1);
    }
  }

  void Terminal(const std::filesystem::path& output) {
    // noenhanced: otherwise the underscores of tags would start subscripts.
    out_ << "set encoding utf8\nset terminal "
         << (format_ == Format::kPng
                 ? "pngcairo noenhanced font 'DejaVu Sans,11' "
                 : "svg noenhanced dynamic font 'DejaVu Sans,Verdana,"
                   "sans-serif,14' background '#ffffff' ")
         << "size " << figure_.width << ',' << Height() << "\nset output "
         << GnuplotText(output.string()) << '\n';
  }

  void Data() {
    for (std::size_t p = 0; p < figure_.panels.size(); ++p) {
      const auto& series = figure_.panels[p].series;
      for (std::size_t s = 0; s < series.size(); ++s) {
        out_ << Block(p, s) << " << EOD\n";
        // Bars are never thinned: gnuplot takes their width from the space
        // between them.
        const bool own = figure_.panels[p].own_axis.has_value();
        PointWriter(figure_, series[s], own ? 1.0 : unit_.seconds,
                    own ? 0.0 : shift_, out_)
            .Write(own || series[s].shape == Shape::kBars
                       ? std::numeric_limits<std::size_t>::max()
                       : figure_.groups);
        out_ << "EOD\n";
      }
    }
  }

  static std::string Block(std::size_t panel, std::size_t series) {
    return "$p" + std::to_string(panel) + "s" + std::to_string(series);
  }

  void Label(const std::string& text, double y_px, const char* font) {
    if (!text.empty()) {
      out_ << "set label " << GnuplotText(text) << " at screen "
           << ScreenX(kLeft) << ", screen " << ScreenY(y_px) << " left font ',"
           << font << "'\n";
    }
  }

  void Frame() {
    out_ << "set multiplot\nset lmargin at screen " << ScreenX(kLeft)
         << "\nset rmargin at screen " << ScreenX(Right()) << "\nset xrange ["
         << X(range_.from) << ':' << X(range_.to)
         << "]\nset grid lc rgb '#e6e6e6' lt 1 lw 0.7\n"
            "set border 3 lc rgb '#404040'\nset tics nomirror out\n"
            "set style fill solid 1 noborder\nset boxwidth 0.9 relative\n";
    Label(figure_.title, 26.0, FontSize("16", "20"));
    Label(figure_.subtitle, 54.0, FontSize("11", "14"));
    Label(figure_.footnote, Height() - 16.0, FontSize("10", "12"));
    for (const Mark& mark : marks_) {
      out_ << "set arrow from first " << X(mark.x) << ", graph 0 to first "
           << X(mark.x) << ", graph 1 nohead front lw 1.6 dt 2 lc rgb '"
           << mark.colour << "'\n";
    }
  }

  // The names of the marks above the first panel, with their stems.
  void Names() {
    for (std::size_t m = 0; m < marks_.size(); ++m) {
      const double bottom =
          kTitleHeight + kMarkRow * static_cast<double>(mark_rows_ - rows_[m]);
      const std::string x = X(marks_[m].x);
      const std::string ink = " rgb '" + marks_[m].colour + "'\n";
      out_ << "set label " << kFirstNameTag + static_cast<int>(m) << ' '
           << GnuplotText(marks_[m].text) << " at first " << x << ", screen "
           << ScreenY(bottom - 6.0) << " left offset 0.4,0 tc" << ink
           << "set arrow " << kFirstStemTag + static_cast<int>(m)
           << " from first " << x << ", graph 1 to first " << x << ", screen "
           << ScreenY(bottom - 14.0) << " nohead lw 1.6 lc" << ink;
    }
  }

  void Shade(const std::vector<Band>& bands, bool named) {
    for (const Band& band : bands) {
      const double from = std::max(band.from, range_.from);
      const double to = std::min(band.to, range_.to);
      if (from >= to) {
        continue;
      }
      out_ << "set object rectangle from first " << X(from)
           << ", graph 0 to first " << X(to) << ", graph 1 fc rgb '"
           << band.colour << "' fs solid 1 noborder behind\n";
      const double room = PixelOf(to) - PixelOf(from);
      if (named && room > kLetter * static_cast<double>(band.text.size())) {
        out_ << "set label " << GnuplotText(band.text) << " at first "
             << X(0.5 * (from + to)) << ", graph 0 center offset 0,0.7 "
             << "tc rgb '#404040' front\n";
      }
    }
  }

  void DrawPanel(std::size_t p, double top) {
    const Panel& panel = figure_.panels[p];
    const bool last = IsLastOnAxis(p);
    const bool strip = panel.series.empty();
    if (p == 0) {
      Names();
    } else {
      out_ << "unset label\nunset object\nunset for [i=" << kFirstStemTag << ':'
           << kFirstStemTag + static_cast<int>(marks_.size()) << "] arrow i\n";
    }
    // Bands through all panels are labelled only in the first one.
    if (!panel.own_axis) {
      Shade(figure_.bands, p == 0);
    }
    Shade(panel.bands, true);
    out_ << "set tmargin at screen " << ScreenY(top)
         << "\nset bmargin at screen " << ScreenY(top + panel.height)
         << "\nset ylabel " << GnuplotText(panel.label)
         << (strip ? " rotate by 0 offset 2,0\nunset ytics\n"
                   : " rotate by 90 offset 0,0\nset ytics nomirror out\n")
         << "set format x " << XFormat(last, panel.own_axis.has_value())
         << '\n';
    if (strip && panel.notes.empty()) {
      out_ << "unset key\n";
    } else {
      out_ << "set key at screen " << ScreenX(Right() + 0.008 * figure_.width)
           << ", graph 1 left top Left reverse samplen 2.2 spacing 1.15\n";
    }
    if (panel.range || strip) {
      // A strip has no values that gnuplot could scale its axis to.
      const Range range = panel.range.value_or(Range{});
      out_ << "set yrange [" << GnuplotNumber(range.from) << ':'
           << GnuplotNumber(range.to) << "]\n";
    } else {
      out_ << "set yrange [*:*]\nset offsets 0,0,graph 0.06,graph 0.06\n";
    }
    if (panel.own_axis) {
      // Neither marks nor bands of the other axis belong here.
      out_ << "unset arrow\nset xrange [" << GnuplotNumber(panel.own_axis->from)
           << ':' << GnuplotNumber(panel.own_axis->to) << "]\n";
    }
    out_ << "set xlabel "
         << GnuplotText(panel.own_axis ? panel.own_label
                        : last         ? XLabel()
                                       : "")
         << '\n';
    PlotCommand(p);
    out_ << "set offsets\n";
  }

  std::string XLabel() const {
    return figure_.is_time && !is_clock_
               ? figure_.x_label + " [" + std::string(unit_.name) + "]"
               : figure_.x_label;
  }

  // plot LIMIT, ..., SERIES, ..., NOTE, ...
  void PlotCommand(std::size_t p) {
    const Panel& panel = figure_.panels[p];
    const char* separator = "plot ";
    const auto next = [&]() -> std::ostream& {
      out_ << separator;
      separator = ", ";
      return out_;
    };
    for (const Limit& limit : panel.limits) {
      next() << GnuplotNumber(limit.value) << " with lines lw 1.4 dt 4 lc rgb '"
             << limit.colour << "' " << TitleOf(limit.title);
    }
    for (std::size_t s = 0; s < panel.series.size(); ++s) {
      const Series& series = panel.series[s];
      next() << Block(p, s) << " using 1:2 " << StyleOf(series) << " lc rgb '"
             << series.colour << "' " << TitleOf(series.title);
    }
    // Without a plot command gnuplot would draw neither the axes nor the bands.
    if (panel.series.empty()) {
      next() << "NaN notitle";  // Axes only.
    }
    for (const std::string& note : panel.notes) {
      next() << "keyentry " << TitleOf(note);
    }
    out_ << '\n';
  }

  static std::string StyleOf(const Series& series) {
    switch (series.shape) {
      case Shape::kPoints:
        return "with points pt 7 ps " + GnuplotNumber(0.3 * series.width);
      case Shape::kBars:
        return "with boxes";
      case Shape::kLine:
      case Shape::kSteps:
        break;
    }
    return std::string(series.shape == Shape::kSteps ? "with steps"
                                                     : "with lines") +
           " lw " + GnuplotNumber(series.width) + " dt " +
           std::to_string(static_cast<int>(series.dash));
  }

  static std::string TitleOf(const std::string& title) {
    return title.empty() ? "notitle" : "title " + GnuplotText(title);
  }

  const Figure& figure_;
  Format format_;
  Range range_;
  bool is_clock_;
  TimeUnit unit_;
  double shift_;                   // [s]
  std::vector<Mark> marks_;        // Marks in range, ordered by x.
  std::vector<std::size_t> rows_;  // Rows of their names, from below.
  std::size_t mark_rows_{1};
  std::ostringstream out_;
};

}  // namespace

Format FormatOf(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending != ".png" && ending != ".svg") {
    throw ConfigError("cannot draw " + file.string() +
                      "; accepted endings are .png and .svg");
  }
  return ending == ".png" ? Format::kPng : Format::kSvg;
}

std::string GnuplotScript(const Figure& figure, Format format,
                          const std::filesystem::path& output) {
  const Figure drawable = Drawable(figure);
  const bool empty_axis =
      drawable.x.empty() && !drawable.x_range &&
      std::ranges::all_of(drawable.panels, [](const Panel& panel) {
        return std::ranges::all_of(panel.series, [](const Series& series) {
          return series.x.empty();
        });
      });
  if (empty_axis || drawable.panels.empty()) {
    throw DataError(figure.title + ": there is nothing to draw in that time");
  }
  return ScriptWriter(drawable, format).Write(output);
}

std::string DrawFigure(const Figure& figure, Format format,
                       const GnuplotLimits& limits) {
  return RunGnuplot(
      [&](const std::filesystem::path& output) {
        return GnuplotScript(figure, format, output);
      },
      limits);
}

void DrawFigure(const Figure& figure, const std::filesystem::path& output) {
  const Format format = FormatOf(output);
  const std::filesystem::path folder = output.parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder)) {
    throw DataError("cannot draw " + output.string() + ": no folder " +
                    folder.string());
  }
  report::WriteFile(output, DrawFigure(figure, format));
}

}  // namespace fdi::plot
