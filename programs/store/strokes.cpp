// The stroke tests of fdi-store audit.
#include "programs/store/strokes.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "programs/store/verbs.h"

namespace fdi::storage {
namespace {

using report::Column;
using report::Format;
using report::Tone;

bool HasPosition(const LabelledSample& labelled) {
  return labelled.sample.Has(Signal::kCv) && labelled.sample.Has(Signal::kX);
}

loop::StrokeRecord RecordOf(std::span<const LabelledSample> samples,
                            double period_s) {
  loop::StrokeRecord record;
  record.period_s = period_s;
  const bool has_ps = std::ranges::all_of(samples, [](const auto& labelled) {
    return labelled.sample.Has(Signal::kPs);
  });
  for (const LabelledSample& labelled : samples) {
    const Sample& sample = labelled.sample;
    record.cv.push_back(sample[Signal::kCv]);
    record.x.push_back(sample[Signal::kX]);
    record.automatic.push_back(sample.mode == ValveMode::kAuto);
    if (has_ps) {
      record.ps.push_back(sample[Signal::kPs]);
    }
  }
  return record;
}

Json WayJson(const loop::StrokeWay& way) {
  return {{"moves", way.moves},
          {"unanswered", way.unanswered},
          {"delay_s", NumberJson(way.delay_s)},
          {"t63_s", NumberJson(way.t63_s)},
          {"t86_s", NumberJson(way.t86_s)},
          {"overshoot_pct", NumberJson(way.overshoot_pct)},
          {"breakaway_pct", NumberJson(way.breakaway_pct)},
          {"breakaway_kpa", NumberJson(way.breakaway_kpa)}};
}

Json SignatureJson(const std::optional<loop::Signature>& signature) {
  if (!signature) {
    return nullptr;
  }
  return {{"friction_kpa", signature->friction_kpa},
          {"spring_kpa_per_pct", signature->spring_kpa_per_pct},
          {"at_0_kpa", signature->at_0_kpa},
          {"at_100_kpa", signature->at_100_kpa}};
}

Json StartJson(const FoundStroke& one) {
  return TimeJson(one.dated ? std::optional(one.start_ns) : std::nullopt);
}

Json StrokeJson(const FoundStroke& one, const FoundStroke* last) {
  const loop::Stroke& stroke = one.stroke;
  return {
      {"loop", one.loop},
      {"source", one.source},
      {"start_utc", StartJson(one)},
      {"from_s", one.from_s},
      {"kind", stroke.full() ? "full" : "partial"},
      {"cv_low_pct", stroke.cv_low},
      {"cv_high_pct", stroke.cv_high},
      {"x_low_pct", stroke.x_low},
      {"x_high_pct", stroke.x_high},
      {"rising", WayJson(stroke.rising)},
      {"falling", WayJson(stroke.falling)},
      {"signature", SignatureJson(stroke.signature)},
      {"last_start_utc", last != nullptr ? StartJson(*last) : Json(nullptr)},
      {"last_from_s", last != nullptr ? Json(last->from_s) : Json(nullptr)},
      {"worse", last != nullptr
                    ? Json(loop::Worse(last->stroke, stroke, one.period_s))
                    : Json::array()}};
}

// The last test before `now` that it can be compared with.
const FoundStroke* LastBefore(const std::vector<FoundStroke>& found,
                              std::size_t now) {
  for (std::size_t i = now; i-- > 0 && found[i].loop == found[now].loop;) {
    if (loop::AreAlike(found[i].stroke, found[now].stroke)) {
      return &found[i];
    }
  }
  return nullptr;
}

Column BothWays(const char* heading, const char* key, int spare) {
  Column column{heading, key};
  column.spare = spare;
  column.align = report::Align::kRight;
  column.text = [key](const Json& row) {
    std::string text;
    for (const char* way : {"rising", "falling"}) {
      const Json& value = row[way][key];
      text += text.empty() ? "" : " / ";
      text +=
          value.is_null() ? "-" : report::FormatNumber(value.get<double>(), 1);
    }
    return text;
  };
  return column;
}

Column WorseColumn() {
  Column column{"against the last one", "worse"};
  column.text = [](const Json& row) -> std::string {
    if (row["last_from_s"].is_null()) {
      return "the first one with these levels";
    }
    std::string text;
    for (const Json& worse : row["worse"]) {
      text += (text.empty() ? "" : "; ") + worse.get<std::string>();
    }
    return text.empty() ? "as before" : text;
  };
  column.tone = [](const Json& row) {
    return row["worse"].empty() ? Tone::kQuiet : Tone::kWarning;
  };
  return column;
}

}  // namespace

void AddStrokes(const std::string& loop, const std::string& source, bool dated,
                std::span<const SampleSeries> stretches,
                std::vector<FoundStroke>& found) {
  std::optional<std::int64_t> first_ns;
  for (const SampleSeries& series : stretches) {
    const std::span<const LabelledSample> all(series.samples);
    for (auto from = std::ranges::find_if(all, HasPosition); from != all.end();
         from = std::find_if(from, all.end(), HasPosition)) {
      const auto to = std::find_if_not(from, all.end(), HasPosition);
      const std::span<const LabelledSample> part(from, to);
      from = to;
      first_ns = first_ns.value_or(all.front().sample.stamp_ns);
      for (loop::Stroke& stroke :
           loop::FindStrokes(RecordOf(part, series.period_s))) {
        const std::int64_t start_ns = part[stroke.begin].sample.stamp_ns;
        found.push_back({loop, source, start_ns, dated,
                         static_cast<double>(start_ns - *first_ns) * 1e-9,
                         series.period_s, std::move(stroke)});
      }
    }
  }
}

void ReportStrokes(std::vector<FoundStroke> found, report::Report& report) {
  std::ranges::stable_sort(found, {}, [](const FoundStroke& one) {
    return std::tie(one.loop, one.start_ns);
  });
  Json& rows = report.document["strokes"] = Json::array();
  for (std::size_t i = 0; i < found.size(); ++i) {
    rows.push_back(StrokeJson(found[i], LastBefore(found, i)));
  }
  if (rows.empty()) {
    return;
  }
  report.Line("").Table(
      "strokes",
      {{"stroke test of", "loop"},
       {"at", "start_utc", Format::kTime},
       {"from [s]", "from_s", Format::kPlain, 0, 4},
       {"kind", "kind"},
       {"CV from [%]", "cv_low_pct", Format::kPlain, 0, 2},
       {"to [%]", "cv_high_pct", Format::kPlain, 0, 2},
       BothWays("dead time [s]", "delay_s", 3),
       BothWays("T63 rising / falling [s]", "t63_s", 1),
       BothWays("T86 [s]", "t86_s", 0),
       {"friction [kPa]", "signature/friction_kpa", Format::kPlain, 1, 3},
       WorseColumn()});
}

}  // namespace fdi::storage
