#include "import/quality.h"

#include <algorithm>
#include <cctype>
#include <cstdint>

#include "base/csv_cells.h"
#include "base/text.h"

namespace fdi::importer {
namespace {

// Whole cells, in plain text (PlainText()); a bar before and behind each.
constexpr std::string_view kConfidenceWords = "confid|konfid|confianza";
constexpr std::string_view kGoodWords =
    "|g|ok|okay|raw|valid|normal|gut|bon|bueno|dobry|0x00000000|alarm|"
    "unackedalarm|alarm,unackedalarm|";
constexpr std::string_view kUncertainWords =
    "|u|questionable|substituted|interpolated|suspect|estimated|doubtful|fair|"
    "poor|overridden|fraglich|unsicher|ersatzwert|douteux|dudoso|dubbio|"
    "niepewny|";
constexpr std::string_view kBadWords =
    "|b|failed|failure|not connected|not good|stale|out of service|down|"
    "disabled|"
    "schlecht|ungultig|gestort|mauvais|invalide|malo|cattivo|zly|";
// Words of historians, OPC clients and spreadsheets for a missing value.
// The words are complete cells, as Bare() leaves them, so no reading is lost.
constexpr std::string_view kNoReading =
    "|nan|-nan|nan(ind)|-nan(ind)|"
    "n/a|na|#n/a|#na|#value!|#ref!|#div/0!|#name?|#num!|#null!|n/v|nv|"
    "null|none|nil|nat|\\n|bad|i/o timeout|io timeout|timeout|no data|nodata|"
    "no value|no sample|not connect|no result|no reading|empty|unknown|"
    "pt created|shutdown|comm fail|comm error|comm loss|configure|scan off|"
    "scan timeout|calc failed|under range|over range|underrange|overrange|"
    "intf shut|offline|invalid|invalid float|error|err|fault|missing|undef|"
    "1.#qnan|-1.#qnan|1.#ind|-1.#ind|inp outrange|inpoutrange|"
    "out of range|outofrange|set to bad|calc off|calc timeout|trace off|"
    "digital set|digital state|arc off-line|intf shutdown|not available|"
    "unavailable|disconnected|device failure|sensor failure|equip fail|"
    "access denied|no good data|no good data for calculation|snap|"
    "coercion failed|undefined|n.a.|k.a.|kein wert|keine daten|storung|fehler|"
    "pas de donnees|erreur|defaut|sin datos|fallo|nessun dato|errore|guasto|"
    "brak|brak danych|blad|awaria|";

// The words of a cell: "No Data" of "<No_Data>", "No Good Data" of
// "[-11059] No Good Data".
std::string Bare(std::string_view cell) {
  std::string plain = PlainText(cell);
  std::ranges::replace(plain, '_', ' ');
  if (plain.starts_with('[') && plain.find(']') + 1 < plain.size()) {
    plain.erase(0, plain.find(']') + 1);
  }
  constexpr std::string_view kAround = "<>[]{}\"' ";
  const std::size_t begin = plain.find_first_not_of(kAround);
  if (begin == std::string::npos) {
    return {};
  }
  plain = plain.substr(begin, plain.find_last_not_of(kAround) + 1 - begin);
  return plain.size() > 2 && plain.front() == '(' && plain.back() == ')'
             ? plain.substr(1, plain.size() - 2)
             : plain;
}

bool IsListed(std::string_view cell, const std::vector<std::string>& words) {
  return std::ranges::any_of(
      words, [&](const std::string& word) { return SameName(word, cell); });
}

// 0, 192, 192.0, 0x80000000; nothing for other text.
std::optional<std::uint32_t> CodeOf(std::string_view cell) {
  if (const std::size_t point = cell.find('.');
      point != std::string_view::npos && point + 1 < cell.size() &&
      cell.find_first_not_of('0', point + 1) == std::string_view::npos) {
    cell = cell.substr(0, point);
  }
  const bool hex = cell.starts_with("0x") || cell.starts_with("0X");
  cell.remove_prefix(hex ? 2 : 0);
  return ParseWhole<std::uint32_t>(cell, hex ? 16 : 10);
}

}  // namespace

// A text with a bar of its own could match across two words.
bool IsListedWord(std::string_view text, std::string_view words) {
  return !text.empty() && text.find('|') == std::string_view::npos &&
         words.find('|' + std::string(text) + '|') != std::string_view::npos;
}

bool HasWord(std::string_view text, std::string_view words) {
  while (!words.empty()) {
    const std::size_t end = std::min(words.find('|'), words.size());
    if (end > 0 && text.find(words.substr(0, end)) != std::string_view::npos) {
      return true;
    }
    words.remove_prefix(std::min(end + 1, words.size()));
  }
  return false;
}

bool IsNoReading(std::string_view cell, const std::vector<std::string>& more) {
  if (cell.empty() || IsListed(cell, more)) {
    return true;
  }
  const std::string bare = Bare(cell);
  // "---", "*****", "--.-"; not "%", which may be a unit below a name.
  const bool signs =
      cell.find_first_not_of("-*?.#_=~!") == std::string_view::npos;
  return signs || IsListedWord(bare, kNoReading) ||
         IsListedWord(bare, kUncertainWords) || IsListedWord(bare, kBadWords) ||
         (bare.starts_with("bad") && bare.size() > 3 &&
          std::isalpha(static_cast<unsigned char>(bare[3])) == 0) ||
         bare.starts_with("bad input");
}

// Words of the map come first. "Good, Non-specific", "GoodNonCascade" and
// "BadSensorFailure" begin with the word that counts.
std::optional<SignalQuality> QualityOf(std::string_view cell,
                                       const QualityWords& words,
                                       QualityCode code) {
  if (IsListed(cell, words.good)) {
    return SignalQuality::kGood;
  }
  if (IsListed(cell, words.uncertain)) {
    return SignalQuality::kUncertain;
  }
  if (IsListed(cell, words.bad)) {
    return SignalQuality::kBad;
  }
  // Niagara writes its words in braces: "{ok}".
  const std::string plain =
      cell.starts_with('{') ? Bare(cell) : PlainText(cell);
  if (plain.starts_with("good") || IsListedWord(plain, kGoodWords)) {
    return SignalQuality::kGood;
  }
  if (plain.starts_with("uncertain") || IsListedWord(plain, kUncertainWords)) {
    return SignalQuality::kUncertain;
  }
  if (plain.starts_with("bad") || IsListedWord(plain, kBadWords) ||
      (!cell.empty() && IsListedWord(Bare(cell), kNoReading))) {
    return SignalQuality::kBad;
  }
  auto number = CodeOf(cell);
  if (plain == "true" || plain == "false") {
    number = plain == "true" ? 1U : 0U;
    if (code != QualityCode::kOneIsGood && code != QualityCode::kZeroIsGood) {
      return std::nullopt;
    }
  }
  if (!number) {
    return std::nullopt;
  }
  if (!words.good.empty()) {
    return SignalQuality::kBad;
  }
  // Grades from good to bad.
  static constexpr SignalQuality kGrade[] = {
      SignalQuality::kGood, SignalQuality::kUncertain, SignalQuality::kBad};
  switch (code) {
    case QualityCode::kUnknown:
      return std::nullopt;
    case QualityCode::kOpcDa: {
      // Above the first byte are those of the vendor, and of OPC HDA whether
      // the reading is raw or interpolated.
      const std::uint32_t status = *number & 0xFFU;
      return status >= 192  ? SignalQuality::kGood
             : status >= 64 ? SignalQuality::kUncertain
                            : SignalQuality::kBad;
    }
    case QualityCode::kOpcUa:
      return kGrade[std::min(*number >> 30U, 2U)];
    case QualityCode::kConfidence:
      return *number > 100    ? std::nullopt
             : *number == 100 ? std::optional(SignalQuality::kGood)
             : *number > 0    ? std::optional(SignalQuality::kUncertain)
                              : std::optional(SignalQuality::kBad);
    case QualityCode::kGrades:
      return *number % 4 < 3 && *number < 7 ? std::optional(kGrade[*number % 4])
                                            : std::nullopt;
    case QualityCode::kOneIsGood:
    case QualityCode::kZeroIsGood:
      return *number > 1 ? std::nullopt
             : (*number == 1) == (code == QualityCode::kOneIsGood)
                 ? std::optional(SignalQuality::kGood)
                 : std::optional(SignalQuality::kBad);
  }
  return std::nullopt;
}

// 0 is good in OPC UA and among grades, and bad in OPC DA; 1 is good for
// "Validity" and suspect among grades. A number beyond those decides, else the
// name of the column, else nothing does.
QualityCode QualityCodeOf(std::string_view column,
                          const std::map<std::string, std::size_t>& cells) {
  const std::string plain = PlainText(column);
  const bool ill = HasWord(
      plain, "quest|bad|invalid|ungultig|subst|err|fail|fault|suspect|stale");
  const bool well = !ill && HasWord(plain, "valid|good|ok|gultig|gut");
  if (HasWord(plain, kConfidenceWords)) {
    return QualityCode::kConfidence;
  }
  bool all_grades = true;
  bool beyond_one = false;
  std::uint32_t highest = 0;
  for (const auto& [cell, count] : cells) {
    if (const auto code = CodeOf(cell)) {
      highest = std::max(highest, *code);
      all_grades = all_grades && *code < 7 && *code % 4 < 3;
      beyond_one = beyond_one || *code > 1;
    }
  }
  if (highest >= (1U << 30U)) {
    return QualityCode::kOpcUa;
  }
  if (highest >= 64) {
    return QualityCode::kOpcDa;
  }
  if (well || ill) {
    return well ? QualityCode::kOneIsGood : QualityCode::kZeroIsGood;
  }
  return beyond_one && all_grades ? QualityCode::kGrades
                                  : QualityCode::kUnknown;
}

bool IsQualityColumn(std::string_view column,
                     const std::map<std::string, std::size_t>& cells) {
  std::size_t words = 0;
  std::size_t codes = 0;
  std::size_t unknown = 0;
  std::size_t filled = 0;
  for (const auto& [cell, count] : cells) {
    const std::string plain = PlainText(cell);
    if (CodeOf(cell) || plain == "true" || plain == "false") {
      ++codes;
    } else if (QualityOf(cell, {}, QualityCode::kUnknown)) {
      // A word that may also stand for a value tells nothing by itself.
      words += !IsNoReading(cell) || plain.starts_with("bad") ? 1U : 0U;
    } else if (!cell.empty()) {
      unknown += count;
    }
    filled += cell.empty() ? 0 : count;
  }
  // A rare word that is not known is refused later, by its name.
  const std::string plain = PlainText(column);
  if (unknown > 0) {
    return HasWord(plain, "qual|validity") ||
           (words > 0 && 10 * unknown <= filled);
  }
  const bool named =
      HasWord(
          plain,
          "qual|status|valid|good|quest|subst|isbad|gultig|jakosc|calidad") ||
      HasWord(plain, kConfidenceWords) || plain.ends_with(".st") ||
      plain.ends_with("_st") || plain.ends_with(" st");
  return words > 0
             ? codes == 0 || named
             : codes > 0 && named &&
                   (cells.size() <= 16 || HasWord(plain, kConfidenceWords));
}

}  // namespace fdi::importer
