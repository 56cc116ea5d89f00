#pragma once

#include <span>
#include <string>
#include <vector>

#include "diagnosis/loop/stroke_watch.h"
#include "diagnosis/model/sample_series.h"
#include "report/report.h"

namespace fdi::storage {

/// A stroke test, and where it was found.
struct FoundStroke {
  std::string loop;
  std::string source;
  bool dated{false};
  double from_s{0.0};  ///< From the start of the record.
  StrokeTest test;
  double last_from_s{0.0};  ///< Of test.last.
};

/// Adds the stroke tests of a record, whose stretches are in order of time.
void AddStrokes(const std::string& loop, const std::string& source, bool dated,
                std::span<const SampleSeries> stretches,
                std::vector<FoundStroke>& found);

/// Adds them to the document as `strokes`, each compared with the last one of
/// its loop with about the same levels, and as a table if there are any.
void ReportStrokes(std::vector<FoundStroke> found, report::Report& report);

}  // namespace fdi::storage
