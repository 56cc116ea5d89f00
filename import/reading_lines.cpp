#include "import/reading_lines.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "import/quality.h"

namespace fdi::importer {
namespace {

using nlohmann::json;

// Two centuries in seconds, and in milliseconds since 1973: a number is one or
// the other.
constexpr double kMostSeconds = 6e9;
constexpr double kMostMilliseconds = 6e12;

enum ReadingColumn : std::size_t { kTime, kTag, kValue, kQuality, kSource };
constexpr std::array<std::string_view, 5> kReadingColumns = {
    "time", "tag", "value", "quality", "source"};

std::string Shortened(std::string_view text) {
  constexpr std::size_t kMostShown = 60;
  return Quoted(std::string(text.substr(0, kMostShown)));
}

}  // namespace

std::optional<std::int64_t> StampReader::Read(double number) const {
  if (!(number >= 0.0 && number < kMostMilliseconds)) {
    return std::nullopt;
  }
  return number < kMostSeconds ? std::llround(number * 1e9)
                               : std::llround(number * 1e6);
}

std::optional<std::int64_t> StampReader::Read(std::string_view text) {
  if (text == text_ && stamp_ns_) {
    return stamp_ns_;
  }
  text_ = text;
  stamp_ns_.reset();
  if (const auto number = ParseNumber(text)) {
    stamp_ns_ = Read(*number);
  } else {
    try {
      stamp_ns_ = ParseTime(text, true);
    } catch (const ConfigError&) {
    }
  }
  return stamp_ns_;
}

void SetValue(std::string_view text, TagReading& reading) {
  if (const auto number = ParseNumber(text)) {
    reading.value = number;
  } else if (IsNoReading(text)) {
    reading.quality = SignalQuality::kBad;
  } else {
    reading.word = text;
  }
}

// Numbers are those of OPC DA (192 is good), or status codes of OPC UA, but 0
// is bad in the one and good in the other, and is taken as bad.
void SetQuality(std::string_view text, TagReading& reading) {
  if (text.empty()) {
    return;
  }
  const auto number = ParseNumber(text);
  const auto quality = QualityOf(
      text, {},
      number && *number > 255.0 ? QualityCode::kOpcUa : QualityCode::kOpcDa);
  reading.quality =
      std::max(reading.quality, quality.value_or(SignalQuality::kBad));
}

const Said& ReadingLines::Take(std::string_view line) {
  said_ = {};
  word_.clear();
  // Blanks, and the byte order mark that some shells write into a pipe.
  const std::size_t first = line.find_first_not_of(" \t\r\xEF\xBB\xBF");
  if (first == std::string_view::npos) {
    return said_;
  }
  line.remove_prefix(first);
  if (!is_json_) {
    is_json_ = line.front() == '{';
  }
  if (*is_json_) {
    TakeObject(line);
  } else if (line.front() != '#' && cells_.TakeLine(line) && !cells_.blank()) {
    columns_ ? TakeRow() : TakeHeader();
  }
  return said_;
}

void ReadingLines::Refuse(std::string why) {
  said_.kind = Said::Kind::kWrong;
  said_.why = std::move(why);
}

void ReadingLines::TakeObject(std::string_view line) {
  const json object = json::parse(line, nullptr, false);
  if (!object.is_object()) {
    return Refuse("not a JSON object: " + Shortened(line));
  }
  said_.kind = Said::Kind::kReading;
  TagReading& reading = said_.reading;
  tag_.clear();
  source_.clear();
  bool has_value = false;
  const json* stamp = nullptr;
  for (const auto& [key, value] : object.items()) {
    if (key == "tag" && value.is_string()) {
      tag_ = value.get_ref<const std::string&>();
    } else if (key == "source" && value.is_string()) {
      source_ = value.get_ref<const std::string&>();
    } else if (key == "t" || key == "alive") {
      stamp = &value;
      said_.kind = key == "alive" ? Said::Kind::kAlive : said_.kind;
    } else if (key == "v" && value.is_number()) {
      reading.value = value.get<double>();
      has_value = true;
    } else if (key == "v" && !value.is_null()) {
      word_ = value.is_string() ? value.get<std::string>() : value.dump();
      SetValue(word_, reading);
      has_value = true;
    } else if (key == "q") {
      SetQuality(value.is_string() ? value.get<std::string>() : value.dump(),
                 reading);
    }
  }
  reading.tag = tag_;
  reading.source = source_;
  if (stamp != nullptr && !stamp->is_null()) {
    reading.stamp_ns =
        stamp->is_string()
            ? stamps_.Read(stamp->get_ref<const std::string&>())
            : stamps_.Read(stamp->is_number() ? stamp->get<double>() : -1.0);
    if (!reading.stamp_ns) {
      return Refuse("t is " + Shortened(stamp->dump()) +
                    "; expected 2026-01-05T10:00:00.2Z, or seconds or "
                    "milliseconds since 1970");
    }
  }
  if (said_.kind == Said::Kind::kReading && tag_.empty()) {
    return Refuse("no tag: " + Shortened(line));
  }
  if (!has_value) {
    reading.quality = SignalQuality::kBad;
  }
}

void ReadingLines::TakeHeader() {
  columns_.emplace();
  for (std::size_t i = 0; i < cells_.cells().size(); ++i) {
    for (std::size_t c = 0; c < kReadingColumns.size(); ++c) {
      if (SameName(cells_.cells()[i], kReadingColumns[c])) {
        (*columns_)[c] = i;
      }
    }
  }
  if (!(*columns_)[kTag] || !(*columns_)[kValue]) {
    columns_.reset();
    Refuse(
        "neither a JSON object nor a header with time, tag, value and "
        "quality: " +
        Shortened(JoinText(cells_.cells())));
  }
}

void ReadingLines::TakeRow() {
  const auto cell = [&](ReadingColumn column) -> std::string_view {
    const auto& at = (*columns_)[column];
    return at && *at < cells_.cells().size()
               ? std::string_view(cells_.cells()[*at])
               : std::string_view();
  };
  TagReading& reading = said_.reading;
  reading.tag = cell(kTag);
  reading.source = cell(kSource);
  said_.kind = reading.tag.empty() ? Said::Kind::kAlive : Said::Kind::kReading;
  if (!cell(kTime).empty()) {
    reading.stamp_ns = stamps_.Read(cell(kTime));
    if (!reading.stamp_ns) {
      return Refuse("time is " + Shortened(cell(kTime)) +
                    "; expected 2026-01-05T10:00:00.2Z, or seconds or "
                    "milliseconds since 1970");
    }
  }
  SetValue(cell(kValue), reading);
  SetQuality(cell(kQuality), reading);
}

}  // namespace fdi::importer
