#pragma once

#include <string>
#include <vector>

#include "storage/cli/svg.h"

namespace fdi::cli {

/// A series of any length as the smallest and the largest value in each of a
/// fixed number of columns, so that no peak is lost where a picture has fewer
/// pixels than the series has values. Memory and picture do not grow with it.
class Envelope {
 public:
  /// Abscissae from..to > from; those beyond count in the outermost column.
  Envelope(double from, double to, int columns);
  Envelope() : Envelope(0.0, 1.0, 1) {}

  /// A value that is not finite breaks the line there.
  void Add(double x, double y);

  /// No value so far.
  bool empty() const { return minimum_ > maximum_; }
  double minimum() const { return minimum_; }
  double maximum() const { return maximum_; }

  /// The line as data of an SVG path over `area`; values beyond the scale lie
  /// on its border.
  /// @param merged ≥ 1, so many adjacent columns are drawn as one.
  std::string PathData(const SvgArea& area, const SvgScale& y,
                       int merged = 1) const;

 private:
  struct Column {
    double first{0.0};  ///< The extremum that came first.
    double second{0.0};
    bool filled{false};
    bool broken{false};

    void Add(double value);
    void Add(const Column& next);
  };

  double from_;
  double per_column_;
  double minimum_;
  double maximum_;
  std::vector<Column> columns_;
};

}  // namespace fdi::cli
