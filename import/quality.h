#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"

namespace fdi::importer {

/// Words and numbers of one plant, beside those that are known: [quality] of a
/// map. Numbers that `good` does not list are bad if it lists any.
struct QualityWords {
  std::vector<std::string> good;
  std::vector<std::string> uncertain;
  std::vector<std::string> bad;
};

/// Meaning of a column of quality that holds numbers or true and false.
enum class QualityCode {
  kUnknown,
  kOpcDa,       ///< 192..255 good, 64..191 uncertain, 0..63 bad.
  kOpcUa,       ///< Status codes: the upper two of 32 bits, 0 good.
  kGrades,      ///< 0 good, 1 suspect, 2 bad; 4..6 the same, but edited.
  kOneIsGood,   ///< 1 or true good, 0 or false bad: "Validity", "IsGood".
  kZeroIsGood,  ///< 0 or false good, 1 or true bad: "Questionable", "IsBad".
  kConfidence,  ///< 100 good, 0 bad, uncertain between: "Confidence".
};

/// The quality that `cell` states; nothing if that is not known.
std::optional<SignalQuality> QualityOf(std::string_view cell,
                                       const QualityWords& words,
                                       QualityCode code);

/// Whose numbers the cells of a column are, with how often each occurs, by the
/// numbers themselves and by the name of the column; kUnknown if two systems
/// may be meant.
QualityCode QualityCodeOf(std::string_view column,
                          const std::map<std::string, std::size_t>& cells);

/// True if a column holds qualities: known words, or few numbers under a name
/// such as "Status".
bool IsQualityColumn(std::string_view column,
                     const std::map<std::string, std::size_t>& cells);

/// True if a cell means "no reading": empty, NaN, Bad, #N/A, "<No Data>", only
/// signs, ..., or one of `more`.
bool IsNoReading(std::string_view cell,
                 const std::vector<std::string>& more = {});

/// True if `text` contains one of `words`, which are separated by bars.
bool HasWord(std::string_view text, std::string_view words);
/// True if `text` is one of `words`, each with a bar before and after it.
bool IsListedWord(std::string_view text, std::string_view words);

}  // namespace fdi::importer
