#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/csv_cells.h"
#include "import/assembler.h"

namespace fdi::importer {

/// The content of one line or payload.
struct Said {
  enum class Kind : std::uint8_t { kNothing, kReading, kAlive, kWrong };
  Kind kind{Kind::kNothing};
  /// Its texts are valid until the next line is taken. For kAlive: source and
  /// stamp.
  TagReading reading;
  std::string why;  ///< For kWrong: what was seen and what is accepted.
};

/// UTC [ns] of a stamp as clients write it: RFC 3339, seconds or milliseconds
/// since 1970. Remembers the last text, which often comes again.
class StampReader {
 public:
  /// Nothing if it is no time.
  std::optional<std::int64_t> Read(std::string_view text);
  std::optional<std::int64_t> Read(double number) const;

 private:
  std::string text_;
  std::optional<std::int64_t> stamp_ns_;
};

/// Value, word and quality of a reading from the texts of a table or payload.
/// A word that means "no reading" makes it BAD, as does a quality that is not
/// known.
void SetValue(std::string_view text, TagReading& reading);
void SetQuality(std::string_view text, TagReading& reading);

/// Reads lines of readings. The first line that is not blank decides for all:
///
///     lines   = { object | blank }            if it begins with {
///             | header { row | blank }
///     object  = {"tag": TAG, "t": TIME, "v": VALUE, "q": QUALITY,
///                "source": NAME}
///             | {"alive": TIME, "source": NAME}
///     header  = time, tag, value, quality, source     in any order
///
/// Only tag is required; without t the stamp is that of arrival. A line without
/// v says that there is no value. A row whose tag is empty is "alive".
class ReadingLines {
 public:
  const Said& Take(std::string_view line);

 private:
  void TakeObject(std::string_view line);
  void TakeHeader();
  void TakeRow();
  void Refuse(std::string why);

  std::optional<bool> is_json_;
  CsvCells cells_;
  std::optional<std::array<std::optional<std::size_t>, 5>> columns_;
  StampReader stamps_;
  std::string tag_, source_, word_;
  Said said_;
};

}  // namespace fdi::importer
