#include "storage/plot/figure_data.h"

#include <algorithm>
#include <cmath>

#include "storage/plot/gnuplot.h"

namespace fdi::storage {
namespace {

constexpr std::size_t kGroups = 1600;

class PointWriter {
 public:
  PointWriter(const TimeFigure& figure, const std::vector<double>& values,
              double unit_s, std::ostream& out)
      : t_s_(figure.t_s),
        gap_s_(figure.gap_s),
        values_(values),
        unit_s_(unit_s),
        out_(out) {}

  void Write() {
    const std::size_t step = std::max<std::size_t>(1, t_s_.size() / kGroups);
    for (std::size_t i = 0; i < t_s_.size(); i += step) {
      const std::size_t end = std::min(i + step, t_s_.size());
      IsWhole(i, end) ? Extremes(i, end) : All(i, end);
    }
  }

 private:
  bool IsGap(std::size_t i) const {
    return i > 0 && t_s_[i] - t_s_[i - 1] > gap_s_;
  }
  bool IsWhole(std::size_t begin, std::size_t end) const {
    for (std::size_t i = begin; i < end; ++i) {
      if (IsGap(i) || !std::isfinite(values_[i])) {
        return false;
      }
    }
    return true;
  }
  void Point(std::size_t i) {
    out_ << GnuplotNumber(t_s_[i] / unit_s_) << ' ' << GnuplotNumber(values_[i])
         << '\n';
  }
  void All(std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (IsGap(i)) {
        out_ << GnuplotNumber(t_s_[i] / unit_s_) << " NaN\n";
      }
      Point(i);
    }
  }
  void Extremes(std::size_t begin, std::size_t end) {
    const auto from = values_.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto to = values_.begin() + static_cast<std::ptrdiff_t>(end);
    const auto [low, high] = std::minmax_element(from, to);
    const auto first = std::min(low, high);
    const auto second = std::max(low, high);
    Point(static_cast<std::size_t>(first - values_.begin()));
    if (first != second) {
      Point(static_cast<std::size_t>(second - values_.begin()));
    }
  }

  const std::vector<double>& t_s_;
  double gap_s_;
  const std::vector<double>& values_;
  double unit_s_;
  std::ostream& out_;
};

}  // namespace

void WritePoints(const TimeFigure& figure, const std::vector<double>& values,
                 double unit_s, std::ostream& out) {
  PointWriter(figure, values, unit_s, out).Write();
}

}  // namespace fdi::storage
