// The stroke tests of fdi-store audit.
#include "programs/store/strokes.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "programs/store/verbs.h"
#include "report/stroke_rows.h"

namespace fdi::storage {
namespace {

using report::Column;
using report::Format;

Json StrokeJson(const FoundStroke& one) {
  const StrokeTest& test = one.test;
  const auto time = [&one](bool known, std::int64_t stamp_ns) {
    return TimeJson(one.dated && known ? std::optional(stamp_ns)
                                       : std::nullopt);
  };
  const bool again = test.last.has_value();
  Json json{{"loop", one.loop},
            {"source", one.source},
            {"start_utc", time(true, test.start_ns)},
            {"from_s", one.from_s},
            {"last_start_utc", time(again, test.last_ns)},
            {"last_from_s", again ? Json(one.last_from_s) : Json(nullptr)}};
  json.update(report::StrokeJson(test.stroke, test.Worse()));
  return json;
}

// The last test before `now` that it can be compared with.
const FoundStroke* LastBefore(const std::vector<FoundStroke>& found,
                              std::size_t now) {
  for (std::size_t i = now; i-- > 0 && found[i].loop == found[now].loop;) {
    if (loop::AreAlike(found[i].test.stroke, found[now].test.stroke)) {
      return &found[i];
    }
  }
  return nullptr;
}

}  // namespace

void AddStrokes(const std::string& loop, const std::string& source, bool dated,
                std::span<const SampleSeries> stretches,
                std::vector<FoundStroke>& found) {
  // A file is there as a whole anyway: no test is too long.
  StrokeWatch watch(std::numeric_limits<std::size_t>::max());
  std::vector<StrokeTest> tests;
  std::optional<std::int64_t> first_ns;
  for (const SampleSeries& series : stretches) {
    for (const LabelledSample& labelled : series.samples) {
      first_ns = first_ns.value_or(labelled.sample.stamp_ns);
      watch.Push(labelled.sample, series.period_s, tests);
    }
    watch.Finish(tests);
  }
  for (StrokeTest& test : tests) {
    const double from_s = static_cast<double>(test.start_ns - *first_ns) * 1e-9;
    found.push_back({loop, source, dated, from_s, std::move(test)});
  }
}

void ReportStrokes(std::vector<FoundStroke> found, report::Report& report) {
  std::ranges::stable_sort(found, {}, [](const FoundStroke& one) {
    return std::tie(one.loop, one.test.start_ns);
  });
  Json& rows = report.document["strokes"] = Json::array();
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (const FoundStroke* last = LastBefore(found, i)) {
      found[i].test.last = last->test.stroke;
      found[i].test.last_ns = last->test.start_ns;
      found[i].last_from_s = last->from_s;
    }
    rows.push_back(StrokeJson(found[i]));
  }
  if (rows.empty()) {
    return;
  }
  std::vector<Column> columns = report::StrokeColumns("last_from_s");
  columns.insert(columns.begin(), {"stroke test of", "loop"});
  columns.insert(columns.begin() + 2,
                 {"from [s]", "from_s", Format::kPlain, 0, 4});
  report.Line("").Table("strokes", std::move(columns));
}

}  // namespace fdi::storage
