#include "storage/plot/figure_script.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "storage/plot/figure_data.h"
#include "storage/plot/gnuplot.h"

namespace fdi::storage {
namespace {

// Sizes [px].
constexpr double kWidth = 1400.0;
constexpr double kPanelHeight = 200.0;
constexpr double kPanelGap = 16.0;
constexpr double kTitleHeight = 76.0;
constexpr double kMarkRow = 20.0;
constexpr double kBottom = 96.0;
constexpr double kLeft = 110.0;
constexpr double kRight = 250.0;
constexpr double kMarkLetter = 8.5;

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

class ScriptWriter {
 public:
  ScriptWriter(const TimeFigure& figure, const std::filesystem::path& output)
      : figure_(figure),
        output_(output),
        first_s_(figure.t_s.front()),
        last_s_(std::max(figure.t_s.back(), figure.t_s.front() + 1e-3)),
        unit_(UnitOf(last_s_ - first_s_)) {}

  std::string Write() {
    PlaceMarks();
    Terminal();
    Data();
    Frame();
    Shapes();
    for (std::size_t p = 0; p < figure_.panels.size(); ++p) {
      Panel(p);
    }
    out_ << "unset multiplot\nset output\n";
    return out_.str();
  }

 private:
  double Top() const {
    return kTitleHeight + kMarkRow * static_cast<double>(mark_rows_) + 8.0;
  }
  double Height() const {
    return Top() + kBottom +
           (kPanelHeight + kPanelGap) *
               static_cast<double>(figure_.panels.size());
  }
  // Pixels from the top as gnuplot's share of the picture from the bottom.
  std::string Screen(double from_top) const {
    return GnuplotNumber(1.0 - from_top / Height());
  }
  std::string Time(double t_s) const {
    return GnuplotNumber(t_s / unit_.seconds);
  }
  double PixelOf(double t_s) const {
    return kLeft +
           (kWidth - kLeft - kRight) * (t_s - first_s_) / (last_s_ - first_s_);
  }

  // Names of marks that would overlap go into further rows.
  void PlaceMarks() {
    marks_ = figure_.marks;
    std::erase_if(marks_, [this](const FigureMark& mark) {
      return mark.t_s < first_s_ || mark.t_s > last_s_;
    });
    std::stable_sort(
        marks_.begin(), marks_.end(),
        [](const auto& a, const auto& b) { return a.t_s < b.t_s; });
    std::vector<double> ends;  // Of each row [px].
    for (const FigureMark& mark : marks_) {
      const double from = PixelOf(mark.t_s);
      std::size_t row = 0;
      while (row < ends.size() && ends[row] > from) {
        ++row;
      }
      ends.resize(std::max(ends.size(), row + 1));
      ends[row] =
          from + 16.0 + kMarkLetter * static_cast<double>(mark.text.size());
      rows_.push_back(row);
    }
    mark_rows_ = std::max<std::size_t>(1, ends.size());
  }

  void Terminal() {
    const bool png = output_.extension() == ".png";
    out_ << "set encoding utf8\nset terminal "
         << (png ? "pngcairo noenhanced font 'DejaVu Sans,11' "
                 : "svg noenhanced dynamic font 'DejaVu Sans,Verdana,"
                   "sans-serif,14' background '#ffffff' ")
         << "size " << kWidth << ',' << Height() << "\nset output "
         << GnuplotText(output_.string()) << '\n';
  }

  void Data() {
    for (std::size_t p = 0; p < figure_.panels.size(); ++p) {
      const auto& curves = figure_.panels[p].curves;
      for (std::size_t c = 0; c < curves.size(); ++c) {
        out_ << Block(p, c) << " << EOD\n";
        WritePoints(figure_, curves[c].values, unit_.seconds, out_);
        out_ << "EOD\n";
      }
    }
  }

  static std::string Block(std::size_t panel, std::size_t curve) {
    return "$p" + std::to_string(panel) + "c" + std::to_string(curve);
  }

  void Label(const std::string& text, double x_px, double y_px,
             const char* font) {
    out_ << "set label " << GnuplotText(text) << " at screen "
         << GnuplotNumber(x_px / kWidth) << ", screen " << Screen(y_px)
         << " left font '," << font << "'\n";
  }

  void Frame() {
    const bool png = output_.extension() == ".png";
    out_ << "set multiplot\nset lmargin at screen " << kLeft / kWidth
         << "\nset rmargin at screen " << 1.0 - kRight / kWidth
         << "\nset xrange [" << Time(first_s_) << ':' << Time(last_s_)
         << "]\nset grid lc rgb '#e6e6e6' lt 1 lw 0.7\n"
            "set border 3 lc rgb '#404040'\nset tics nomirror out\n"
            "set key at screen "
         << GnuplotNumber(1.0 - kRight / kWidth + 0.008)
         << ", graph 1 left top Left reverse samplen 2.2 spacing 1.15\n";
    Label(figure_.title, kLeft, 26.0, png ? "16" : "20");
    Label(figure_.subtitle, kLeft, 54.0, png ? "11" : "14");
    if (!figure_.footnote.empty()) {
      Label(figure_.footnote, kLeft, Height() - 16.0, png ? "10" : "12");
    }
  }

  void Shapes() {
    for (const FigureBand& band : figure_.bands) {
      const double from = std::max(band.from_s, first_s_);
      const double to = std::min(band.to_s, last_s_);
      if (from < to) {
        out_ << "set object rectangle from first " << Time(from)
             << ", graph 0 to first " << Time(to) << ", graph 1 fc rgb '"
             << band.colour << "' fs solid 1 noborder behind\n";
      }
    }
    for (const FigureMark& mark : marks_) {
      out_ << "set arrow from first " << Time(mark.t_s) << ", graph 0 to first "
           << Time(mark.t_s) << ", graph 1 nohead front lw 1.6 dt 2 lc rgb '"
           << mark.colour << "'\n";
    }
  }

  // Names of marks and bands stand above and in the first panel only.
  void Names() {
    for (std::size_t m = 0; m < marks_.size(); ++m) {
      out_ << "set label " << 100 + m << ' ' << GnuplotText(marks_[m].text)
           << " at first " << Time(marks_[m].t_s) << ", screen "
           << Screen(kTitleHeight +
                     kMarkRow * static_cast<double>(mark_rows_ - rows_[m]) -
                     6.0)
           << " left tc rgb '" << marks_[m].colour << "'\n"
           << "set arrow " << 1000 + m << " from first " << Time(marks_[m].t_s)
           << ", graph 1 to first " << Time(marks_[m].t_s) << ", screen "
           << Screen(kTitleHeight +
                     kMarkRow * static_cast<double>(mark_rows_ - rows_[m]))
           << " nohead lw 1.6 lc rgb '" << marks_[m].colour << "'\n";
    }
    for (std::size_t b = 0; b < figure_.bands.size(); ++b) {
      const FigureBand& band = figure_.bands[b];
      const double from = std::max(band.from_s, first_s_);
      const double to = std::min(band.to_s, last_s_);
      const double room = PixelOf(to) - PixelOf(from);
      if (room > kMarkLetter * static_cast<double>(band.text.size())) {
        out_ << "set label " << 5000 + b << ' ' << GnuplotText(band.text)
             << " at first " << Time(0.5 * (from + to))
             << ", graph 0.06 center tc rgb '#404040' front\n";
      }
    }
  }

  void Panel(std::size_t p) {
    const FigurePanel& panel = figure_.panels[p];
    const bool last = p + 1 == figure_.panels.size();
    const double top =
        Top() + (kPanelHeight + kPanelGap) * static_cast<double>(p);
    if (p == 0) {
      Names();
    } else if (p == 1) {
      out_ << "unset label\nunset for [i=1000:1099] arrow i\n";
    }
    out_ << "set tmargin at screen " << Screen(top)
         << "\nset bmargin at screen " << Screen(top + kPanelHeight)
         << "\nset ylabel " << GnuplotText(panel.label)
         << " offset 0,0\nset format x " << (last ? "'%g'" : "''") << '\n'
         << (panel.unit_range ? "set yrange [-0.05:1.05]\n"
                              : "set yrange [*:*]\nset offsets 0,0,graph "
                                "0.06,graph 0.06\n")
         << "set xlabel "
         << GnuplotText(last ? figure_.time_label + " [" + unit_.name + "]"
                             : "")
         << '\n';
    Lines(p);
    out_ << "set offsets\n";
  }

  void Lines(std::size_t p) {
    const FigurePanel& panel = figure_.panels[p];
    out_ << "plot ";
    for (std::size_t l = 0; l < panel.levels.size(); ++l) {
      const Level& level = panel.levels[l];
      out_ << (l == 0 ? "" : ", ") << GnuplotNumber(level.value)
           << " with lines lw 1.4 dt 4 lc rgb '" << level.colour << "' "
           << TitleOf(level.title);
    }
    for (std::size_t c = 0; c < panel.curves.size(); ++c) {
      const Curve& curve = panel.curves[c];
      out_ << (panel.levels.empty() && c == 0 ? "" : ", ") << Block(p, c)
           << " using 1:2 with lines lw " << curve.width << " dt "
           << static_cast<int>(curve.dash) << " lc rgb '" << curve.colour
           << "' " << TitleOf(curve.title);
    }
    out_ << '\n';
  }

  static std::string TitleOf(const std::string& title) {
    return title.empty() ? "notitle" : "title " + GnuplotText(title);
  }

  const TimeFigure& figure_;
  const std::filesystem::path& output_;
  double first_s_;
  double last_s_;
  TimeUnit unit_;
  std::vector<FigureMark> marks_;
  std::vector<std::size_t> rows_;  // Of the names of marks_, from below.
  std::size_t mark_rows_{1};
  std::ostringstream out_;
};

}  // namespace

std::string FigureScript(const TimeFigure& figure,
                         const std::filesystem::path& output) {
  return ScriptWriter(figure, output).Write();
}

}  // namespace fdi::storage
