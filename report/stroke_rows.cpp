#include "report/stroke_rows.h"

#include <cmath>
#include <optional>

#include "report/text_table.h"

namespace fdi::report {
namespace {

Json ValueOrNull(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}

Json WayJson(const loop::StrokeWay& way) {
  return {{"moves", way.moves},
          {"unanswered", way.unanswered},
          {"delay_s", ValueOrNull(way.delay_s)},
          {"t63_s", ValueOrNull(way.t63_s)},
          {"t86_s", ValueOrNull(way.t86_s)},
          {"overshoot_pct", ValueOrNull(way.overshoot_pct)},
          {"breakaway_pct", ValueOrNull(way.breakaway_pct)},
          {"breakaway_kpa", ValueOrNull(way.breakaway_kpa)}};
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

Column BothWays(const char* heading, const char* key, int spare) {
  Column column{heading, key};
  column.spare = spare;
  column.align = Align::kRight;
  column.text = [key](const Json& row) {
    std::string text;
    for (const char* way : {"rising", "falling"}) {
      const Json& value = row[way][key];
      text += text.empty() ? "" : " / ";
      text += value.is_null() ? "-" : FormatNumber(value.get<double>(), 1);
    }
    return text;
  };
  return column;
}

Column WorseColumn(const char* last_key) {
  Column column{"against the last one", "worse"};
  column.text = [last_key](const Json& row) -> std::string {
    if (row[last_key].is_null()) {
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

Json StrokeJson(const loop::Stroke& stroke,
                const std::vector<std::string>& worse) {
  return {{"kind", stroke.full() ? "full" : "partial"},
          {"cv_low_pct", stroke.cv_low},
          {"cv_high_pct", stroke.cv_high},
          {"x_low_pct", stroke.x_low},
          {"x_high_pct", stroke.x_high},
          {"rising", WayJson(stroke.rising)},
          {"falling", WayJson(stroke.falling)},
          {"signature", SignatureJson(stroke.signature)},
          {"worse", worse}};
}

std::vector<Column> StrokeColumns(const char* last_key) {
  return {{"at", "start_utc", Format::kTime},
          {"kind", "kind"},
          {"CV from [%]", "cv_low_pct", Format::kPlain, 0, 2},
          {"to [%]", "cv_high_pct", Format::kPlain, 0, 2},
          BothWays("dead time [s]", "delay_s", 3),
          BothWays("T63 rising / falling [s]", "t63_s", 1),
          BothWays("T86 [s]", "t86_s", 0),
          {"friction [kPa]", "signature/friction_kpa", Format::kPlain, 1, 3},
          WorseColumn(last_key)};
}

}  // namespace fdi::report
