#include "import/sniff.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <sstream>
#include <utility>

#include "base/correlation.h"
#include "base/error.h"
#include "base/local_sense.h"
#include "base/text.h"
#include "base/usual_period.h"
#include "import/layout.h"
#include "import/tag_map.h"

namespace fdi::importer {
namespace {

/// What a name may stand for. Both pressures are kPressure until words or sizes
/// tell them apart; kValve is the tag of a valve, command or position.
enum class Role {
  kCommand,
  kPosition,
  kFlow,
  kUpstream,
  kDownstream,
  kPressure,
  kSupply,
  kTemperature,
  kSetpoint,
  kLevel,
  kValve,
  kOther,  ///< No signal: a pressure difference, a speed, a limit of an alarm.
};

struct RoleWords {
  Role role;
  std::string_view words;   ///< Anywhere in the plain name.
  std::string_view tokens;  ///< Whole parts of it, with or without the number.
};

// English, German, French, Spanish, Italian, Polish. The order settles names
// with several words: a "flow setpoint" is a setpoint, a "position output" a
// command, a "supply pressure" no P1.
constexpr RoleWords kRoleWords[] = {
    {Role::kOther,
     "differential|delta p|differenzdruck|druckdifferenz|perte de charge|"
     "roznica cisn|speed|drehzahl|predkosc|obroty|vibrat|schwing|torque|"
     "drehmoment|totali|counter|zahlerstand|licznik|alarm|deviation|abweichung|"
     "density|dichte|viscos|conductiv|leitfahigkeit|motorstrom|motor current|"
     "leistung",
     "|dp|pdt|pdi|pdic|dpt|st|si|sic|jt|vt|power|dev|err|hi|hh|lo|ll|hihi|lolo|"
     "hlim|llim|alm|"},
    {Role::kSetpoint,
     "setpoint|set point|sollwert|consigne|consigna|zadan|fuhrungsgr",
     "|sp|spt|sv|w|lsp|rsp|"},
    {Role::kPosition, "realiment|retroaliment|retroazion", ""},
    {Role::kSupply,
     "supply|instrument air|zuluft|steuerluft|air comprim|aria strument|"
     "alimentation|alimentacion|alimentazion|zasilan",
     "|air|"},
    {Role::kCommand,
     "command|demand|output|stellgr|stellwert|stellsig|stellbefehl|ansteuer|"
     "reglerausgang|sortie|salida|uscita|mando|sterow|sterujac|wyjsci|setpos|"
     "manipul|writevalue",
     "|op|out|co|cv|mv|cmd|dem|ao|lmn|mn|yout|ysoll|wyj|y|u|"},
    {Role::kPosition,
     "position|posizion|travel|stem|opening|offnung|oeffnung|stellung|"
     "ruckmeld|rueckmeld|ruckfuhr|rueckfuehr|feedback|readback|readvalue|"
     "recopie|ouverture|posicion|apertura|corsa|carrera|polozen|pozycj|"
     "otwarci|hub|lift|skok|course|posn",
     "|x|pos|zt|zi|zit|gt|gi|zso|zsc|fb|fbk|rb|rbv|lmnr|vp|yist|xist|"},
    {Role::kLevel, "level|fullstand|niveau|nivel|livello|poziom",
     "|lt|li|lit|"},
    {Role::kTemperature, "temp", "|t1|"},
    {Role::kUpstream,
     "upstream|inlet|vordruck|eingangsdruck|vor ventil|amont|monte|"
     "aguas arriba|przed zaw",
     "|p1|"},
    {Role::kDownstream,
     "downstream|outlet|nachdruck|hinterdruck|ausgangsdruck|nach ventil|aval|"
     "valle|aguas abajo|za zaw",
     "|p2|"},
    {Role::kPressure, "press|druck|presion|cisnien", ""},
    {Role::kFlow,
     "flow|durchfl|menge|strom|debit|caudal|flujo|portata|przeplyw|natezeni|"
     "strumien",
     "|q|qist|"},
};
/// What a valve is called, and a valve that flow has given its name to.
constexpr std::string_view kValveWords =
    "valve|ventil|armatur|vanne|valvula|valvola|zawor";
constexpr std::string_view kFlowValves =
    "flow valve|flow control valve|flow ctrl valve|durchflussregel|"
    "durchflussventil|mengenregel|vanne de debit|vanne debit|"
    "valvula de caudal|valvola di portata|zawor przeplyw|regulacji przeplyw";

/// Units of quantities that no signal has.
constexpr std::string_view kOtherUnits =
    "|rpm|1/min|u/min|kw|mw|w|a|v|hz|ph|mm|cm|m|mm/s|us/cm|ms/cm|ntu|ppm|mg/l|"
    "g/l|kg/m3|m3|t|kg|kwh|mwh|s|min|h|nm|kn|kj/kg|mv|ohm|";

bool IsPercent(Signal signal) {
  return signal == Signal::kCv || signal == Signal::kX || signal == Signal::kSp;
}

// Parts between all that is no letter or digit: "17fc", "op" of "17FC.OP".
std::vector<std::string> Tokens(std::string_view plain) {
  std::vector<std::string> tokens{""};
  for (const char c : plain) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) {
      tokens.back() += c;
    } else if (!tokens.back().empty()) {
      tokens.emplace_back();
    }
  }
  if (tokens.back().empty()) {
    tokens.pop_back();
  }
  return tokens;
}

// The first letters in a row: "fv" of "fv17a", "cv" of "03cv".
std::string Letters(const std::string& token) {
  const auto is_letter = [](unsigned char c) { return std::isalpha(c) != 0; };
  const auto begin = std::ranges::find_if(token, is_letter);
  return {begin, std::find_if_not(begin, token.end(), is_letter)};
}

bool IsToken(const std::string& token, std::string_view tokens) {
  return !token.empty() &&
         tokens.find('|' + token + '|') != std::string_view::npos;
}

struct NamedUnit {
  std::string rest;  ///< The name without it.
  std::string unit;
};

// A unit in a name: "bar g" of "PT101 [bar g]", "t/h" of "F_t_h", "gpm" of
// "FLOW 17 GPM", "Nm3/h"; else empty. All signals are asked; "1" is a unit of
// percentages, but at the end of a name it is a number of a loop, and "F" and
// "C" are letters of a tag there.
NamedUnit UnitIn(const std::string& name) {
  const auto known = [](const std::string& unit, bool in_brackets) {
    const std::string plain = PlainText(unit);
    return plain == "ma" || IsGasUnit(unit) ||
           (in_brackets && IsToken(plain, kOtherUnits)) ||
           (plain != "1" && (in_brackets || plain.size() > 1 || plain == "%") &&
            IsUnit(unit));
  };
  for (std::size_t open = name.find_first_of("[("); open != std::string::npos;
       open = name.find_first_of("[(", open + 1)) {
    const std::size_t close = name.find_first_of("])", open);
    if (close == std::string::npos) {
      break;
    }
    const std::string unit = name.substr(open + 1, close - open - 1);
    if (known(unit, true)) {
      return {name.substr(0, open) + name.substr(close + 1), unit};
    }
  }
  for (std::size_t at = name.find_first_of(" _"); at != std::string::npos;
       at = name.find_first_of(" _", at + 1)) {
    std::string unit = name.substr(at + 1);
    std::ranges::replace(unit, '_', '/');
    // Not "1]" of "[page 1]".
    const bool cut = unit.find_first_of("[(") == std::string::npos &&
                     unit.find_first_of("])") != std::string::npos;
    if (!cut && known(unit, false)) {
      return {name.substr(0, at), unit};
    }
  }
  // "Y/%", "p1/kPa" (DIN 1313), "OUT%"
  for (std::size_t at = name.find('/'); at != std::string::npos && at > 0;
       at = name.find('/', at + 1)) {
    if (known(name.substr(at + 1), false)) {
      return {name.substr(0, at), name.substr(at + 1)};
    }
  }
  if (name.size() > 1 && name.ends_with('%')) {
    return {name.substr(0, name.size() - 1), "%"};
  }
  return {name, {}};
}

bool HasDigit(const std::string& token) {
  return std::ranges::any_of(
      token, [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool HasForm(std::string_view text, std::string_view form) {
  for (std::size_t k = 0; k < form.size(); ++k) {
    const auto c = static_cast<unsigned char>(k < text.size() ? text[k] : '\0');
    if (form[k] == 'a' ? std::isalpha(c) == 0 : std::isdigit(c) == 0) {
      return false;
    }
  }
  return true;
}

// Of an equipment by KKS (VGB-B 105: 10LAB30AA101 is a valve, CF a flow) or by
// the older AKZ (RL30S101, RL30F001). What comes behind a valve says which of
// its signals it is: XQ01 is read from it, YQ01 written to it.
std::optional<Role> RoleOfPlantCode(const std::vector<std::string>& tokens) {
  struct Code {
    std::string_view form;
    std::size_t kind_at;
    std::string_view kinds;
    Role role;
  };
  static constexpr Code kCodes[] = {
      {"aaa00aa000", 5, "|aa|", Role::kValve},
      {"aaa00aa000", 5, "|cf|", Role::kFlow},
      {"aaa00aa000", 5, "|cp|", Role::kPressure},
      {"aaa00aa000", 5, "|ct|", Role::kTemperature},
      {"aaa00aa000", 5, "|cl|", Role::kLevel},
      {"aaa00aa000", 5, "|cg|", Role::kPosition},
      {"aaa00aa000", 5, "|ap|an|ac|ae|cq|cs|cd|ce|", Role::kOther},
      {"aa00a000", 4, "|s|", Role::kValve},
      {"aa00a000", 4, "|f|", Role::kFlow},
      {"aa00a000", 4, "|p|", Role::kPressure},
      {"aa00a000", 4, "|t|", Role::kTemperature},
      {"aa00a000", 4, "|l|", Role::kLevel}};
  std::string joined;
  for (const std::string& token : tokens) {
    joined += token;
  }
  for (std::size_t at = 0; at < joined.size(); ++at) {
    const std::string rest = joined.substr(at);
    if (at > 0 &&
        std::isalpha(static_cast<unsigned char>(joined[at - 1])) != 0) {
      continue;
    }
    for (const Code& code : kCodes) {
      const std::size_t letters = code.kind_at == 5 ? 2 : 1;
      if (!HasForm(rest, code.form) ||
          !IsToken(rest.substr(code.kind_at, letters), code.kinds)) {
        continue;
      }
      const char behind = rest[std::min(code.form.size(), rest.size())];
      return code.role != Role::kValve ? code.role
             : behind == 'y'           ? Role::kCommand
             : behind == 'x'           ? Role::kPosition
                                       : Role::kValve;
    }
  }
  return std::nullopt;
}

// The role of the letters of a tag by ISA 5.1 (Z position; Y relay or
// converter) and DIN 19227 (G position).
std::optional<Role> RoleOfLetters(const std::string& letters) {
  if (letters.ends_with('v') || letters == "ven" || letters == "rv") {
    return Role::kValve;
  }
  // The position of a valve in a loop of flow: FZT.
  if (letters.size() > 1 && letters[1] == 'z') {
    return Role::kPosition;
  }
  if (letters.ends_with('y') &&
      std::string_view("fptl").find(letters.front()) !=
          std::string_view::npos) {
    return Role::kCommand;
  }
  // Functions of ISA 5.1: "tag" and "pump" are no tags.
  if (letters.find_first_not_of("cdefghikqrstvxyz", 1) != std::string::npos) {
    return std::nullopt;
  }
  switch (letters.front()) {
    case 'f':
      return Role::kFlow;
    case 'p':
      return letters.starts_with("pd") ? Role::kOther : Role::kPressure;
    case 't':
      return Role::kTemperature;
    case 'l':
      return Role::kLevel;
    case 'z':
    case 'g':
      return Role::kPosition;
    default:
      return std::nullopt;
  }
}

// Of a tag, from its last part to its first: "fic" of "20.FIC101.PV", "fv" of
// "AO_FV17". The part with the number of the loop comes first.
std::optional<Role> RoleOfTag(const std::vector<std::string>& tokens) {
  if (const auto role = RoleOfPlantCode(tokens)) {
    return role;
  }
  for (const bool numbered : {true, false}) {
    for (std::size_t i = tokens.size(); i-- > 0;) {
      const std::string letters = Letters(tokens[i]);
      // "pv" without a number is the process value of the tag before it or of
      // an unknown one, and "pid1" a block of it.
      if (HasDigit(tokens[i]) != numbered || letters.empty() ||
          letters.size() > 4 || letters.starts_with("pid") ||
          IsToken(letters,
                  "|ai|ao|di|do|fb|daca|daci|pct|plc|feed|test|zeit|") ||
          (letters == tokens[i] &&
           (IsToken(letters, "|pv|sv|") ||
            (tokens.size() > 1 &&
             IsToken(letters, "|iv|val|value|i|a|b|no|st|db|"))))) {
        continue;
      }
      if (const auto role = RoleOfLetters(letters)) {
        return role;
      }
    }
  }
  return std::nullopt;
}

struct NameGuess {
  std::optional<Role> role;
  bool by_word{false};
};

bool HasWordOf(const std::string& plain, Role role) {
  return std::ranges::any_of(kRoleWords, [&](const RoleWords& known) {
    return known.role == role && HasWord(plain, known.words);
  });
}

bool HasToken(const std::vector<std::string>& tokens, std::string_view any) {
  return std::ranges::any_of(
      tokens, [&](const std::string& token) { return IsToken(token, any); });
}

// Two words that say one thing: the set point of a position or of a valve is
// the command, and "pression sortie", which begins with what is measured, no
// output.
std::optional<Role> RoleOfTwoWords(const std::string& plain,
                                   const std::vector<std::string>& tokens) {
  const bool wanted = HasWordOf(plain, Role::kSetpoint) ||
                      HasToken(tokens, "|soll|sp|ref|req|target|");
  const auto tag = RoleOfTag(tokens);
  const bool measured =
      !HasWord(plain, kFlowValves) &&
      (HasWordOf(plain, Role::kFlow) || HasWordOf(plain, Role::kPressure) ||
       HasWordOf(plain, Role::kTemperature) || HasWordOf(plain, Role::kLevel));
  const bool valve =
      !measured && (tag == Role::kValve || HasWord(plain, kValveWords));
  if (wanted && (HasWordOf(plain, Role::kPosition) || valve)) {
    return Role::kCommand;
  }
  if (valve && !HasWordOf(plain, Role::kCommand) &&
      (HasWord(plain, "istwert|actual|rzeczywist|mierzon|reelle|reale") ||
       HasToken(tokens, "|ist|act|actual|"))) {
    return Role::kPosition;
  }
  if (tokens.empty() || HasWordOf(plain, Role::kSupply)) {
    return std::nullopt;
  }
  if (HasWordOf(tokens.front(), Role::kTemperature)) {
    return Role::kTemperature;
  }
  if (HasWordOf(tokens.front(), Role::kPressure) &&
      !HasWordOf(plain, Role::kOther)) {
    if (HasWord(plain, "entree|entrada|ingresso|wlot|eingang")) {
      return Role::kUpstream;
    }
    if (HasWord(plain, "sortie|salida|uscita|wylot|ausgang")) {
      return Role::kDownstream;
    }
  }
  return std::nullopt;
}

// The output of a transmitter ("FT17.OUT") or of a block that takes a reading
// in ("FIC-17/AI1/OUT") is what it measures.
bool IsOutputOfReading(const std::vector<std::string>& tokens, std::size_t at,
                       Role tag) {
  return (tokens[at] == "out" || tokens[at] == "ao") &&
         (tag == Role::kFlow || tag == Role::kPressure ||
          tag == Role::kTemperature || tag == Role::kLevel ||
          tag == Role::kPosition) &&
         std::ranges::any_of(tokens, [&](const std::string& part) {
           const std::string code = Letters(part);
           return part != tokens[at] &&
                  ((code.size() > 1 && code.ends_with('t')) || code == "ai");
         });
}

// Words first, then the attribute behind a tag (".OP"), then its letters, and
// last the word valve alone.
NameGuess RoleOf(const std::string& name, const std::string& about) {
  const std::string plain = PlainText(name + ' ' + about);
  const std::vector<std::string> tokens = Tokens(PlainText(name));
  const auto tag = RoleOfTag(tokens);
  if (const auto role = RoleOfTwoWords(plain, tokens)) {
    return {role, true};
  }
  for (const RoleWords& known : kRoleWords) {
    if (HasWord(plain, known.words) &&
        !(known.role == Role::kFlow && HasWord(plain, kFlowValves))) {
      return {known.role, true};
    }
  }
  for (std::size_t i = tokens.size(); i-- > 0;) {
    const std::string& token = tokens[i];
    const std::string letters = Letters(token);
    // "MV101" and "CV7" are valves, "51_03CV" is an attribute.
    // So are "Y1" and "U2" units of a plant, and "Y" is the command.
    const bool numbered =
        token.size() > letters.size() &&
        std::isalpha(static_cast<unsigned char>(token.front())) != 0 &&
        (letters.ends_with('v') || (letters.size() == 1 && letters != "x"));
    for (const RoleWords& known : kRoleWords) {
      if (!IsToken(token, known.tokens) &&
          (numbered || !IsToken(letters, known.tokens))) {
        continue;
      }
      if (known.role == Role::kCommand && tag &&
          IsOutputOfReading(tokens, i, *tag)) {
        return {tag, false};
      }
      return {known.role, true};
    }
  }
  if (!tag && HasWord(plain, kValveWords)) {
    return {Role::kValve, false};
  }
  // What a card reads of a valve.
  if (tag == Role::kValve &&
      std::ranges::any_of(tokens, [](const std::string& token) {
        return Letters(token) == "ai";
      })) {
    return {Role::kPosition, false};
  }
  return {tag, false};
}

std::optional<Signal> SignalOf(Role role) {
  switch (role) {
    case Role::kCommand:
      return Signal::kCv;
    case Role::kPosition:
    case Role::kValve:
      return Signal::kX;
    case Role::kFlow:
      return Signal::kF;
    case Role::kUpstream:
    case Role::kPressure:
      return Signal::kP1;
    case Role::kDownstream:
      return Signal::kP2;
    case Role::kSupply:
      return Signal::kPz;
    case Role::kTemperature:
      return Signal::kT1;
    case Role::kSetpoint:
      return Signal::kSp;
    case Role::kLevel:
    case Role::kOther:
      return std::nullopt;
  }
  return std::nullopt;
}

// "Value" of "Value (2)", the second of this name (layout.h).
std::string WithoutNumber(const std::string& name) {
  const std::size_t open = name.rfind(" (");
  const bool numbered =
      name.ends_with(')') && open != std::string::npos &&
      name.find_first_not_of("0123456789", open + 2) == name.size() - 1;
  return numbered ? name.substr(0, open) : name;
}

// The unit in the name of a column, or in the rows below it.
std::string StatedUnit(const SniffedColumn& column) {
  std::string unit = UnitIn(WithoutNumber(column.name)).unit;
  std::istringstream about(column.about);
  for (std::string cell; unit.empty() && std::getline(about, cell);) {
    unit = UnitIn('[' + cell + ']').unit;
  }
  return unit;
}

// A flow, a pressure or a temperature by its unit alone, also where the name
// says otherwise.
std::optional<Role> RoleByUnit(std::optional<Role> role,
                               const std::string& unit) {
  if (SameName(unit, "mA")) {
    // The current to a positioner; a transmitter with its current in mA.
    return role == Role::kValve ? Role::kCommand : role;
  }
  static constexpr std::pair<Signal, Role> kByUnit[] = {
      {Signal::kF, Role::kFlow},
      {Signal::kP1, Role::kPressure},
      {Signal::kT1, Role::kTemperature}};
  for (const auto& [signal, by_unit] : kByUnit) {
    const auto named = role ? SignalOf(*role) : std::nullopt;
    if (!unit.empty() && role != Role::kOther && FindUnit(signal, unit) &&
        !(named && FindUnit(*named, unit))) {
      role = by_unit;
    }
  }
  return role;
}

// What all names end with ("F_CV" of "FT.F_CV") or begin with tells them not
// apart, so it is no evidence.
std::vector<std::string> DistinctParts(
    const std::vector<SniffedColumn*>& columns) {
  std::vector<std::string> names;
  for (const SniffedColumn* column : columns) {
    // "Value (2)" is told apart by what is above it.
    const bool numbered = WithoutNumber(column->name) != column->name;
    const std::size_t line = column->about.find_first_not_of('\n');
    names.push_back(
        numbered && line != std::string::npos
            ? column->about.substr(line, column->about.find('\n', line) - line)
            : column->name);
  }
  constexpr std::string_view kCuts = "./\\:";
  const auto common = [&](const auto& part) {
    return names.size() > 1 && !part(names.front()).empty() &&
           std::ranges::all_of(names, [&](const std::string& name) {
             return part(name) == part(names.front()) &&
                    part(name).size() < name.size();
           });
  };
  const auto ending = [&](const std::string& name) {
    const std::size_t at = name.find_last_of(kCuts);
    const bool none = at == std::string::npos || at == 0;
    // Of a block, which tells what comes out.
    return none || SameName(name.substr(at + 1), "out") ? std::string()
                                                        : name.substr(at);
  };
  const auto beginning = [&](const std::string& name) {
    const std::size_t at = name.find_first_of(kCuts);
    return at == std::string::npos || at + 1 == name.size()
               ? std::string()
               : name.substr(0, at + 1);
  };
  while (common(ending)) {
    for (std::string& name : names) {
      name.resize(name.size() - ending(name).size());
    }
  }
  // "PV" and "SP" are told by the tag in front of them.
  if (common(beginning)) {
    for (std::string& name : names) {
      const std::string tag = beginning(name);
      if (!IsToken(PlainText(name.substr(tag.size())), "|pv|sp|sv|") ||
          !RoleOfTag(Tokens(PlainText(tag)))) {
        name.erase(0, tag.size());
      }
    }
  }
  return names;
}

void Say(SniffedColumn& column, const std::string& what) {
  column.guessed += (column.guessed.empty() ? "" : "; ") + what;
}

/// Outliers that decide nothing, and readings that may be codes of a state.
constexpr double kMaxOutliers = 0.05;
constexpr double kMaxCoded = 0.2;
constexpr std::size_t kMaxCodes = 4;
constexpr std::size_t kMinRepeats = 3;

// Whether the readings lie in [low, high], but for a few outliers and a few
// numbers that repeat, such as -9999 or 32767: codes of a state. Readings that
// vary less than what lies beyond are no readings beside codes.
bool IsWithin(const SniffedColumn& column, double low, double high) {
  std::map<double, std::size_t> within;
  std::map<double, std::size_t> beyond;
  for (const double value : column.values) {
    ++(value >= low && value <= high ? within : beyond)[value];
  }
  std::size_t coded = 0;
  std::size_t outliers = 0;
  std::size_t codes = 0;
  for (const auto& [value, count] : beyond) {
    const bool code = count >= kMinRepeats;
    codes += code ? 1U : 0U;
    (code ? coded : outliers) += count;
  }
  const auto total = static_cast<double>(column.values.size());
  return within.size() > codes && codes <= kMaxCodes &&
         static_cast<double>(outliers) <= kMaxOutliers * total &&
         static_cast<double>(coded) <= kMaxCoded * total;
}

// The range of a percentage in the numbers of the file.
std::pair<double, double> PercentRange(const std::string& unit) {
  const auto conversion = FindUnit(Signal::kX, unit);
  const double scale = conversion ? conversion->scale : 1.0;
  return {-15.0 / scale, 115.0 / scale};
}

// Whether most values fit a percentage in a unit, or without one; sets the unit
// where none is stated.
bool FitsPercent(SniffedColumn& column) {
  if (SameName(column.unit, "mA")) {
    return IsWithin(column, 3.0, 21.0);
  }
  if (column.unit.empty()) {
    // What may be a percentage is no code beside shares.
    const auto count = [&](double low, double high) {
      return std::ranges::count_if(
          column.values, [&](double v) { return v >= low && v <= high; });
    };
    const bool share = IsWithin(column, -0.1, 1.1) &&
                       20 * count(-0.1, 1.1) >= 19 * count(-15.0, 115.0);
    column.unit = share ? "1" : "%";
    Say(column, share ? "0 to 1 by size" : "% by size");
  }
  const auto [low, high] = PercentRange(column.unit);
  return IsWithin(column, low, high);
}

// What cards and registers have at 100 %: tenths and hundredths of a per cent,
// 12, 15 and 16 bits, and the 27648 of Siemens.
constexpr double kFullScales[] = {1000.0,  4095.0,  10000.0,
                                  27648.0, 32767.0, 65535.0};

// The counts at 100 % of an analog card: the smallest usual ones that the
// readings fit; nothing if the numbers are no counts.
std::optional<double> FullScale(const SniffedColumn& column) {
  if (!std::ranges::all_of(column.values,
                           [](double v) { return v == std::floor(v); }) ||
      IsWithin(column, -15.0, 115.0)) {
    return std::nullopt;
  }
  for (const double full : kFullScales) {
    if (IsWithin(column, -0.1 * full, 1.1 * full)) {
      return full;
    }
  }
  return std::nullopt;
}

// Whether most values fit a signal in a unit, or without one; sets unit, raw
// and span. Most, because a few states and outliers are in every export.
//
// @param full the counts at 100 %, if the table has counts; else 0.
bool FitsSignal(SniffedColumn& column, Signal signal, const std::string& unit,
                double full) {
  const double median = std::abs(column.Quantile(0.5));
  column.unit = unit;
  column.raw.clear();
  column.span.clear();
  const bool current = SameName(unit, "mA");
  if (!unit.empty() && !current && !FindUnit(signal, unit)) {
    return false;
  }
  const bool counts = full > 0.0 && unit.empty() && FullScale(column);
  if (IsPercent(signal) && !counts) {
    return FitsPercent(column);
  }
  if (current || counts) {
    column.raw = current ? std::vector{4.0, 20.0} : std::vector{0.0, full};
    if (IsPercent(signal)) {
      column.unit = "%";
      Say(column, "counts of an analog card; " + NumberText(full) +
                      " at 100 % is the smallest usual range that they fit");
      return true;
    }
    column.span = {0.0, 100.0};
    Say(column, "span is open: state the range of the transmitter");
    column.unit = signal == Signal::kF    ? "t/h"
                  : signal == Signal::kT1 ? "degC"
                                          : "bar";
    return true;
  }
  if (unit.empty()) {
    const bool pressure =
        signal != Signal::kF && signal != Signal::kT1 && signal != Signal::kCvi;
    column.unit = signal == Signal::kF ? (median > 2e3 ? "kg/h" : "m3/h")
                  : signal == Signal::kT1
                      ? (median > 250.0 && median < 450.0 ? "K" : "degC")
                  : pressure ? (median > 2e4     ? "Pa"
                                : median > 100.0 ? "kPa"
                                                 : "bar")
                             : "1";
    Say(column, signal == Signal::kF ? "the unit is open: no size tells it"
                                     : "unit by size");
  }
  return true;
}

// The range beyond which readings are outliers or codes: of a percentage that
// of its unit; else three quartile distances from the quartiles, or, where that
// would leave out more than a few, the middle 90 % and as much on either side.
std::pair<double, double> UsualRange(const SniffedColumn& column) {
  if (column.signal && IsPercent(*column.signal) && !column.given) {
    if (!column.raw.empty()) {
      const double margin = 0.15 * (column.raw[1] - column.raw[0]);
      return {column.raw[0] - margin, column.raw[1] + margin};
    }
    return SameName(column.unit, "mA") ? std::pair(3.0, 21.0)
                                       : PercentRange(column.unit);
  }
  const double lower = column.Quantile(0.25);
  const double upper = column.Quantile(0.75);
  const double reach = 3.0 * (upper - lower);
  if (IsWithin(column, lower - reach, upper + reach)) {
    return {lower - reach, upper + reach};
  }
  const double low = column.Quantile(0.05);
  const double high = column.Quantile(0.95);
  return {2.0 * low - high, 2.0 * high - low};
}

// Correlation of b with a delayed by 0, 1 or 2 periods, the strongest. The
// delays allow for the lag of the rod behind the command, and of the flow
// behind the rod. The sign is kept, because the sense follows from it.
double Correlation(const SniffedColumn& a, const SniffedColumn& b) {
  const auto [low_a, high_a] = UsualRange(a);
  const auto [low_b, high_b] = UsualRange(b);
  std::map<double, double> at;
  for (std::size_t k = 0; k < a.values.size(); ++k) {
    if (a.values[k] >= low_a && a.values[k] <= high_a) {
      at[a.times_s[k]] = a.values[k];
    }
  }
  double strongest = 0.0;
  for (int lag = 0; lag <= 2; ++lag) {
    LocalSense sums;
    for (std::size_t k = static_cast<std::size_t>(lag); k < b.values.size();
         ++k) {
      // In a compressed table, the last reading remains valid.
      const auto after =
          at.upper_bound(b.times_s[k - static_cast<std::size_t>(lag)]);
      if (after != at.begin() && b.values[k] >= low_b &&
          b.values[k] <= high_b) {
        sums.Add(std::prev(after)->second, b.values[k]);
      }
    }
    const double r = sums.Value();
    strongest = std::abs(r) > std::abs(strongest) ? r : strongest;
  }
  return strongest;
}

// Whether the readings are those of a counter: a flow falls now and then.
bool IsTotal(const SniffedColumn& column) {
  constexpr std::size_t kEnough = 60;
  return column.values.size() >= kEnough &&
         std::ranges::is_sorted(column.values) &&
         column.values.front() < column.values.back();
}

// Whether a set point is that of a flow, a pressure or a temperature, whose
// unit is not per cent.
bool IsOfOtherLoop(const std::string& name) {
  const std::string plain = PlainText(name);
  const auto tag = RoleOfTag(Tokens(plain));
  const auto is = [&](Role role) {
    return tag == role || HasWordOf(plain, role);
  };
  return is(Role::kFlow) || is(Role::kPressure) || is(Role::kTemperature);
}

bool IsSwitch(const SniffedColumn& column) {
  return std::set<double>(column.values.begin(), column.values.end()).size() <=
         2;
}

// "FC101", which may be all that a controller has.
bool IsController(const std::string& name) {
  return std::ranges::any_of(
      Tokens(PlainText(name)), [](const std::string& token) {
        return HasDigit(token) && IsToken(Letters(token), "|fc|fic|ffc|frc|");
      });
}

// Whether b follows a rather than a b: what moves first is the command. 0 if
// neither is seen.
double Lead(const SniffedColumn& a, const SniffedColumn& b) {
  const auto follows = [](const SniffedColumn& first,
                          const SniffedColumn& second) {
    std::map<double, double> at;
    for (std::size_t k = 0; k < first.values.size(); ++k) {
      at[first.times_s[k]] = first.values[k];
    }
    CorrelationSums sums;
    for (std::size_t k = 1; k < second.values.size(); ++k) {
      const auto then = at.find(second.times_s[k - 1]);
      if (then != at.end() && then != at.begin()) {
        sums.Add(then->second - std::prev(then)->second,
                 second.values[k] - second.values[k - 1]);
      }
    }
    return std::abs(sums.Correlation());
  };
  return follows(a, b) - follows(b, a);
}

class SignalGuess {
 public:
  explicit SignalGuess(Sniffed& found) : found_(found) {}

  void Guess() {
    GuessNames();
    SettleControllers();
    SettleValves();
    SettlePressures();
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      KeepFirst(static_cast<Signal>(i));
    }
    GuessSenses();
    NoteMissing();
  }

 private:
  std::vector<SniffedColumn*> Of(Signal signal) {
    std::vector<SniffedColumn*> columns;
    for (SniffedColumn& column : found_.columns) {
      if (column.signal == signal) {
        columns.push_back(&column);
      }
    }
    return columns;
  }
  void GuessNames();
  void GuessName(SniffedColumn& column, const std::string& part);
  void FindCounts(const std::vector<SniffedColumn*>& numbers,
                  const std::vector<std::string>& parts);
  void SettleControllers();
  bool TakeKnown(SniffedColumn& column, const std::string& unit);
  void SettleValves();
  void SettlePressures();
  void KeepFirst(Signal signal);
  void GuessSenses();
  void NoteMissing();

  Sniffed& found_;
  std::vector<SniffedColumn*> valves_;  // Command or position.
  std::vector<SniffedColumn*> sure_;    // By a word or the contract.
  std::vector<SniffedColumn*> sides_;   // In front of the valve, by a word.
  double full_{0.0};                    // Counts at 100 %; 0: no counts.
};

void SignalGuess::GuessNames() {
  std::vector<SniffedColumn*> numbers;
  for (SniffedColumn& column : found_.columns) {
    // A column that is mostly words is no reading, whatever its name says.
    if (!column.values.empty() &&
        2 * (column.values.size() + column.missing) >= column.cells) {
      numbers.push_back(&column);
    }
  }
  const std::vector<std::string> parts = DistinctParts(numbers);
  FindCounts(numbers, parts);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    GuessName(*numbers[i], parts[i]);
  }
}

// Command and position come over one kind of card: a flow of whole numbers
// beside percentages is no count.
void SignalGuess::FindCounts(const std::vector<SniffedColumn*>& numbers,
                             const std::vector<std::string>& parts) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto role = RoleOf(UnitIn(parts[i]).rest, numbers[i]->about).role;
    const auto signal = role ? SignalOf(*role) : std::nullopt;
    if ((signal == Signal::kCv || signal == Signal::kX) &&
        StatedUnit(*numbers[i]).empty()) {
      full_ = std::max(full_, FullScale(*numbers[i]).value_or(0.0));
    }
  }
}

// A name of the contract, or a column of the caller's map.
bool SignalGuess::TakeKnown(SniffedColumn& column, const std::string& unit) {
  // PV and SP are names of the contract in a table that has others of it.
  const bool is_contract = std::ranges::any_of(
      found_.columns,
      [](const SniffedColumn& each) { return SameName(each.name, "CV_pct"); });
  for (const SignalColumn& known : kSignalColumns) {
    if (SameName(known.name, column.name) &&
        (is_contract || (known.signal != Signal::kPv && !NeedsPv(known)))) {
      column.signal = known.signal;
      const bool by_name = !unit.empty() && FindUnit(known.signal, unit);
      column.unit = by_name ? unit
                    : known.signal == Signal::kCvi
                        ? "1"
                        : std::string(SignalUnit(known.signal));
      sure_.push_back(&column);
      sides_.push_back(&column);
      return true;
    }
  }
  if (column.given) {
    const ColumnMapping& given = *column.given;
    column.signal = given.signal;
    column.unit = given.unit;
    column.opening = given.sense == Sense::kOpening;
    Say(column, "given");
    sure_.push_back(&column);
    sides_.push_back(&column);
  }
  return column.given.has_value();
}

void SignalGuess::GuessName(SniffedColumn& column, const std::string& part) {
  const std::string unit = StatedUnit(column);
  if (TakeKnown(column, unit)) {
    return;
  }
  if (IsGasUnit(unit)) {
    Say(column, "a flow of gas at standard conditions, which needs molar_mass");
    column.unit = unit;
    found_.findings.push_back(
        column.name +
        " is a flow of gas at standard conditions, which becomes t/h by the "
        "molar mass: state [signal.F] with column, unit and molar_mass = 28.96 "
        "(air; kg/kmol; the map that sniff writes has these lines, to be "
        "uncommented), and onboard with a --type of that gas. Without it F "
        "is left out; CV and X still show what the rod does");
    return;
  }
  const NameGuess guess = RoleOf(UnitIn(part).rest, column.about);
  const std::optional<Role> role = RoleByUnit(guess.role, unit);
  if (!role || IsToken(PlainText(unit), kOtherUnits)) {
    return;
  }
  if (role == Role::kLevel || role == Role::kOther) {
    Say(column, role == Role::kLevel ? "a level" : "no signal of a valve");
    return;
  }
  if (role == Role::kFlow && IsTotal(column)) {
    Say(column, "a total: it only rises");
    return;
  }
  if (role == Role::kSetpoint && unit.empty() && IsOfOtherLoop(part)) {
    Say(column, "a set point in the unit of its loop");
    return;
  }
  const Signal signal = *SignalOf(*role);
  if (!FitsSignal(column, signal, unit, full_)) {
    column.unit.clear();
    column.raw.clear();
    column.guessed = std::string(SignalName(signal)) +
                     "? Its unit or its range does not fit";
    return;
  }
  column.signal = signal;
  if (role == Role::kUpstream) {
    sides_.push_back(&column);
  }
  if (role == Role::kValve) {
    valves_.push_back(&column);
  } else if (guess.by_word) {
    sure_.push_back(&column);
  }
}

// "FC7" beside "FI7" is the output of the controller, where there is no other.
void SignalGuess::SettleControllers() {
  const auto flows = Of(Signal::kF);
  if (!Of(Signal::kCv).empty() || !valves_.empty() || flows.size() != 2) {
    return;
  }
  for (SniffedColumn* column : flows) {
    SniffedColumn output = *column;
    if (IsController(column->name) && StatedUnit(*column).empty() &&
        !HasToken(Tokens(PlainText(column->name)), "|pv|") &&
        FitsSignal(output, Signal::kCv, "", full_)) {
      *column = std::move(output);
      column->signal = Signal::kCv;
      column->guessed = "a controller beside its flow: likely its output";
      return;
    }
  }
}

// The tag of a valve is its command or its position, whichever is not there
// yet; alone it is the command, without which nothing can be judged. Of two,
// the command moves first.
void SignalGuess::SettleValves() {
  constexpr double kClear = 0.1;
  if (valves_.size() == 2 && Of(Signal::kCv).empty() &&
      Of(Signal::kX).size() == 2) {
    const double lead = Lead(*valves_[0], *valves_[1]);
    if (lead < 0.0) {
      std::swap(valves_[0], valves_[1]);
    }
    Say(*valves_[0], std::abs(lead) > kClear
                         ? "moves before " + valves_[1]->name
                         : "neither of the two moves first: check which is the "
                           "command");
  }
  for (SniffedColumn* valve : valves_) {
    const bool has_command = !Of(Signal::kCv).empty();
    const bool has_position = Of(Signal::kX).size() > 1;
    if (!has_command) {
      valve->signal = Signal::kCv;
    } else if (has_position &&
               std::ranges::any_of(Of(Signal::kX), [&](SniffedColumn* x) {
                 return std::ranges::find(valves_, x) == valves_.end();
               })) {
      valve->signal.reset();
    }
    Say(*valve, "a valve: command or position");
  }
}

// The pressure falls in the direction of flow. A column named P2 stays P2.
void SignalGuess::SettlePressures() {
  const std::vector<SniffedColumn*> pressures = Of(Signal::kP1);
  if (pressures.size() == 1 && Of(Signal::kP2).empty() &&
      std::ranges::find(sides_, pressures[0]) == sides_.end()) {
    Say(*pressures[0], "P1 or P2: no name says on which side of the valve");
  }
  if (pressures.size() != 2 || !Of(Signal::kP2).empty()) {
    return;
  }
  SniffedColumn* low = pressures[0]->Quantile(0.5) < pressures[1]->Quantile(0.5)
                           ? pressures[0]
                           : pressures[1];
  low->signal = Signal::kP2;
  for (SniffedColumn* column : pressures) {
    Say(*column, "P1 is the higher pressure");
  }
}

// Of several columns the one with a word for it, else the first; a switch comes
// behind what has more than two values, and a controller of flow behind a flow.
void SignalGuess::KeepFirst(Signal signal) {
  std::vector<SniffedColumn*> columns = Of(signal);
  const auto comes_first = [&](const SniffedColumn* column) {
    return !IsSwitch(*column) &&
           !(signal == Signal::kF && IsController(column->name));
  };
  // Not that of std::ranges, which Clang 14 does not compile.
  std::stable_partition(columns.begin(), columns.end(), comes_first);
  const auto sure = [&](SniffedColumn* column) {
    return std::ranges::find(sure_, column) != sure_.end();
  };
  const auto best = std::ranges::find_if(columns, [&](SniffedColumn* column) {
    return sure(column) && IsSwitch(*column) == IsSwitch(*columns.front());
  });
  const SniffedColumn* kept = best != columns.end() ? *best
                              : columns.empty()     ? nullptr
                                                    : columns.front();
  for (SniffedColumn* column : columns) {
    if (column != kept) {
      column->signal.reset();
      column->guessed = "another " + std::string(SignalName(signal)) + "?";
    }
  }
}

// The flow rises with the opening, and follows the rod more closely than it
// follows the command: X, if there is one, is compared with the flow, and CV
// with X, with which it correlates more strongly. 0.3 is the limit of
// onboarding, too (docs/onboarding.md). Without a flow, plants count opening,
// and the columns of the contract closing.
void SignalGuess::GuessSenses() {
  const auto flow = Of(Signal::kF);
  std::vector<SniffedColumn*> moving = Of(Signal::kX);
  const auto cv = Of(Signal::kCv);
  moving.insert(moving.end(), cv.begin(), cv.end());
  for (SniffedColumn* column : moving) {
    if (column->given) {
      continue;
    }
    const bool led = column != moving.front();
    const bool contract =
        SameName(column->name, "CV_pct") || SameName(column->name, "X_pct");
    const double r = led            ? Correlation(*column, *moving.front())
                     : flow.empty() ? 0.0
                                    : Correlation(*column, *flow.front());
    if (led && std::abs(r) > 0.3) {
      column->opening = (r >= 0.0) == moving.front()->opening;
      Say(*column,
          std::string("moves ") + (r >= 0.0 ? "with" : "against") + " the rod");
    } else if (led) {
      column->opening = moving.front()->opening;
    } else if (std::abs(r) > 0.3) {
      column->opening = r > 0.0;
      Say(*column, r > 0.0 ? "opening: the flow rises with it"
                           : "closing: the flow falls with it");
    } else {
      column->opening = !contract;
      Say(*column, "the sense is open: no flow tells it");
    }
  }
  for (SniffedColumn* column : Of(Signal::kSp)) {
    column->opening = !moving.empty() && moving.front()->opening;
  }
}

void SignalGuess::NoteMissing() {
  std::string level;
  for (const SniffedColumn& column : found_.columns) {
    if (column.guessed == "a level") {
      level = column.name;
    }
  }
  if (Of(Signal::kCv).empty()) {
    found_.findings.push_back(
        "no command (CV) found: nothing can be judged without it. State its "
        "column under [signal.CV]");
  }
  if (Of(Signal::kX).empty() && Of(Signal::kF).empty() &&
      Of(Signal::kPv).empty()) {
    found_.findings.push_back(
        (level.empty()
             ? std::string()
             : level + " is a level, which is neither the position nor "
                       "the flow of the valve. ") +
        "No position (X) and no flow (F) found: the command alone shows "
        "nothing about the valve. Export the position transmitter or the flow "
        "behind the valve, and state it under [signal.X] or [signal.F]");
  }
}

void AddCell(const std::string& whole, double t_s, const ColumnMap& map,
             SniffedColumn& column) {
  const auto unflagged = Unflagged(whole);
  const std::string& cell = unflagged ? *unflagged : whole;
  ++column.cells;
  auto value = ParseNumber(cell, map.decimal);
  if (!value && IsNoReading(cell, map.no_reading)) {
    ++column.missing;
    return;
  }
  if (!value) {
    const auto [number, unit] = SplitUnit(cell);
    value = ParseNumber(
        Ungrouped(number, map.thousands).value_or(std::string(number)),
        map.decimal);
    if (!unit.empty() && !IsUnit(unit)) {
      value.reset();
    } else if (value && column.about.empty()) {
      column.about = '\n' + std::string(unit);
    }
  }
  if (value) {
    column.times_s.push_back(t_s);
    column.values.push_back(*value);
  } else if (column.words.size() < 200 &&
             std::ranges::find(column.words, cell) == column.words.end()) {
    column.words.push_back(cell);
  }
}

// Period, jitter and gaps, and whether --resample would help.
void JudgeTiming(std::vector<double> times, Sniffed& found) {
  // All stamps together, sorted: a long table has each instant once per tag and
  // may be sorted by tag.
  std::ranges::sort(times);
  times.erase(std::unique(times.begin(), times.end()), times.end());
  found.period_s = UsualPeriod(MedianStep(times));
  std::size_t missing = 0;
  for (const SniffedColumn& column : found.columns) {
    missing += column.signal ? column.missing : 0;
    const double usual = MedianStep(column.times_s);
    std::size_t odd = 0;
    for (std::size_t k = 1; k < column.times_s.size(); ++k) {
      const double step = column.times_s[k] - column.times_s[k - 1];
      odd += std::abs(step - usual) > 0.6 * usual ? 1U : 0U;
    }
    // Readings stored by exception or swinging door come at odd steps. A tag
    // with such steps in a fifth of its readings is taken as compressed.
    found.compressed = found.compressed || (found.map.long_table &&
                                            5 * odd > column.times_s.size());
  }
  for (std::size_t k = 1; k < times.size(); ++k) {
    const double step = times[k] - times[k - 1];
    if (step > 1.6 * found.period_s) {
      ++found.gaps;
      found.longest_gap_s = std::max(found.longest_gap_s, step);
    } else {
      found.jitter_s =
          std::max(found.jitter_s, std::abs(step - found.period_s));
    }
  }
  const bool jitter = found.jitter_s > 0.01 * found.period_s;
  double period = found.period_s;
  std::string age;
  // A compressed tag may be silent for long while its value holds, hence ten
  // minutes. Slow and short data are resampled to 1 s, because a record with
  // fewer than 600 samples in a row cannot be onboarded (docs/import.md).
  if (found.compressed) {
    age = ":10min";
    period = std::max(period, 1.0);
  } else if (period > 1.0 && period <= 10.0 && times.size() < 1200) {
    period = 1.0;
    age = ":" + NumberText(3.0 * found.period_s) + "s";
  } else if (!jitter && missing == 0 && found.gaps == 0) {
    return;
  }
  found.resample = NumberText(period) + "s:linear" + age;
}

/// The qualities of a row, as the importer takes them.
class CellQuality {
 public:
  explicit CellQuality(const Layout& layout) : map_(layout.map) {
    const auto at = [&](const std::string& name) {
      return static_cast<std::size_t>(std::ranges::find(layout.names, name) -
                                      layout.names.begin());
    };
    for (const auto& [column, quality] : map_.quality_of) {
      of_[at(column)] = {at(quality), quality};
    }
    if (map_.long_table && !map_.long_table->quality.empty()) {
      of_[at(map_.long_table->value)] = {at(map_.long_table->quality),
                                         map_.long_table->quality};
    }
  }

  bool IsBad(const std::vector<std::string>& cells, std::size_t column) const {
    const auto found = of_.find(column);
    if (found == of_.end() || found->second.first >= cells.size()) {
      return false;
    }
    const auto code = map_.quality_codes.find(found->second.second);
    return QualityOf(cells[found->second.first], map_.quality,
                     code != map_.quality_codes.end()
                         ? code->second
                         : QualityCode::kUnknown) == SignalQuality::kBad;
  }

 private:
  const ColumnMap& map_;
  std::map<std::size_t, std::pair<std::size_t, std::string>> of_;
};

// Columns of a long table that hold the unit or the description of its tag.
std::vector<std::size_t> AboutColumns(const Layout& layout) {
  std::vector<std::size_t> columns;
  for (std::size_t c = 0; c < layout.names.size(); ++c) {
    const std::string plain = PlainText(layout.names[c]);
    if (HasWord(plain,
                "unit|einheit|unidad|jednostk|descr|beschreib|bezeich") ||
        IsToken(plain, "|eu|uom|")) {
      columns.push_back(c);
    }
  }
  return columns;
}

// Cells that the guesses rest on; their times and values take 16 bytes each.
constexpr std::size_t kMaxCells = 4'000'000;

// The columns of a wide table or the tags of a long one, through the reader of
// the importer.
void ReadColumns(const TextLines& lines, const Layout& layout,
                 const std::string& source,
                 const std::vector<ColumnMapping>& given, Sniffed& found) {
  CsvReader reader({.source = source, .map = layout.map, .scan = true});
  std::map<std::string, SniffedColumn> tags;
  std::vector<std::size_t> columns;
  std::vector<double> times;
  std::size_t tag = 0;
  std::size_t value = 0;
  const auto& names = layout.names;
  const auto& tall = layout.map.long_table;
  const CellQuality quality(layout);
  const std::vector<std::size_t> abouts = AboutColumns(layout);
  for (std::size_t c = 0; c < names.size(); ++c) {
    bool form = SameName(names[c], layout.map.time_column) ||
                SameName(names[c], kTimeColumn) ||
                SameName(names[c], layout.map.clock_column);
    for (const auto& of_column : layout.map.quality_of) {
      form = form || SameName(names[c], of_column.second);
    }
    tag = tall && SameName(names[c], tall->tag) ? c : tag;
    value = tall && SameName(names[c], tall->value) ? c : value;
    if (!form && !tall) {
      columns.push_back(c);
      found.columns.push_back({.name = names[c], .about = layout.about[c]});
    }
  }
  std::size_t kept = 0;
  ForEachRow(lines, reader, [&](CsvRow&& row) {
    const std::vector<std::string>& cells = reader.cells();
    ++found.rows;
    if (kept > kMaxCells) {
      return;
    }
    kept += tall ? 1 : columns.size();
    times.push_back(row.t_s);
    if (tall && !tags.contains(cells[tag]) && tags.size() >= kMaxColumns) {
      reader.Refuse("more than " + std::to_string(kMaxColumns) +
                    " tags; try to export fewer at a time");
    }
    if (tall) {
      SniffedColumn& column = tags[cells[tag]];
      for (const std::size_t c : abouts) {
        column.about += column.cells == 0 ? '\n' + cells[c] : std::string();
      }
      column.name = cells[tag];
      AddCell(quality.IsBad(cells, value) ? "" : cells[value], row.t_s,
              layout.map, column);
    }
    for (std::size_t i = 0; i < columns.size(); ++i) {
      AddCell(quality.IsBad(cells, columns[i]) ? "" : cells[columns[i]],
              row.t_s, layout.map, found.columns[i]);
    }
  });
  reader.Finish();
  for (auto& [name, column] : tags) {
    // Names of markers, such as "$RT_OFF$", are no tags.
    if (!name.empty() && name.front() != '$') {
      found.columns.push_back(std::move(column));
    }
  }
  for (SniffedColumn& column : found.columns) {
    for (const ColumnMapping& m : given) {
      if (SameName(m.column, column.name)) {
        column.given = m;
      }
    }
  }
  found.dated = reader.dated();
  found.time = reader.time_unit();
  SignalGuess(found).Guess();
  JudgeTiming(std::move(times), found);
}

std::string TomlText(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      std::array<char, 8> code{};  // A name may have several lines.
      std::snprintf(code.data(), code.size(), "\\u%04X", c);
      quoted += code.data();
    } else {
      quoted +=
          c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    }
  }
  return quoted + '"';
}

std::string TomlList(const std::vector<std::string>& texts) {
  return '[' + JoinText(texts, ", ", TomlText) + ']';
}

std::string TomlPair(const std::vector<double>& pair) {
  return '[' + NumberText(pair.at(0)) + ", " + NumberText(pair.at(1)) + ']';
}

// The end of a line that may be a choice.
std::string Choice(const Sniffed& found, const std::string& key) {
  for (const std::string& choice : found.choices) {
    if (choice.starts_with(key + ": ")) {
      return "  # choice: " + choice.substr(key.size() + 2) + "\n";
    }
  }
  return "\n";
}

std::string FileToml(const Sniffed& found) {
  const ColumnMap& map = found.map;
  const auto sign = [](char c) {
    return TomlText(c == '\t' ? "tab" : std::string(1, c));
  };
  std::string text = "\n[file]\nseparator = " + sign(map.separator) +
                     "\ndecimal = " + sign(map.decimal) +
                     Choice(found, "decimal");
  if (map.thousands != '\0') {
    text += "thousands = " + sign(map.thousands) + "\n";
  }
  if (map.skip > 0) {
    text += "skip = " + std::to_string(map.skip) + "\n";
  }
  if (map.header_rows > 1) {
    text += "header = " + std::to_string(map.header_rows) + "\n";
  }
  if (!map.no_reading.empty()) {
    text += "missing = " + TomlList(map.no_reading) + Choice(found, "missing");
  }
  if (!found.resample.empty()) {
    text += "resample = " + TomlText(found.resample) + "\n";
  }
  return text;
}

std::string TimeToml(const Sniffed& found) {
  const ColumnMap& map = found.map;
  std::string text = "\n[time]\ncolumn = " + TomlText(map.time_column) + "\n";
  if (!map.clock_column.empty()) {
    text += "clock = " + TomlText(map.clock_column) + "\n";
  }
  if (found.time.form != TimeForm::kText) {
    text += "unit = " + TomlText(std::string(TimeUnitName(found.time))) +
            Choice(found, "time");
  }
  if (map.date_order != DateOrder::kNotSaid) {
    text += std::string("date = ") +
            (map.date_order == DateOrder::kDayFirst     ? "\"d/m/y\""
             : map.date_order == DateOrder::kMonthFirst ? "\"m/d/y\""
                                                        : "\"y/m/d\"") +
            Choice(found, "date");
  }
  if (found.dated) {
    text += map.zone.empty() ? "# zone = \"Europe/Warsaw\"\n"
                             : "zone = " + TomlText(map.zone) + "\n";
  }
  return text;
}

std::string SignalToml(const ColumnMap& map, const SniffedColumn& column) {
  std::string text =
      "\n[signal." + std::string(SignalName(*column.signal)) + "]" +
      (column.guessed.empty() ? "" : "  # guessed: " + column.guessed) +
      "\ncolumn = " + TomlText(column.name) + "\nunit = " +
      TomlText(column.given && SameName(column.unit, "mA") ? "%"
                                                           : column.unit) +
      "\n";
  if (column.given) {
    // In `unit`, as the map of the caller had it.
    const auto unit =
        FindUnit(*column.signal, column.unit).value_or(UnitConversion{});
    text += "scale = " + NumberText(column.given->scale / unit.scale) +
            "\noffset = " +
            NumberText((column.given->offset - unit.offset) / unit.scale) +
            "\n";
  }
  if (!column.raw.empty()) {
    text += "raw = " + TomlPair(column.raw) + "\n";
  }
  if (!column.span.empty()) {
    text += "span = " + TomlPair(column.span) + "\n";
  }
  if (column.opening) {
    text += "sense = \"opening\"\n";
  }
  if (const auto quality = map.quality_of.find(column.name);
      quality != map.quality_of.end()) {
    text += "quality = " + TomlText(quality->second) + "\n";
  }
  return text;
}

// What the importer makes of the table with the guessed signals.
void ReadWith(const TextLines& lines, const std::string& source,
              Sniffed& found) {
  CsvOptions options{
      .source = source, .map = found.map, .required = 0, .split_gaps = true};
  for (const SniffedColumn& column : found.columns) {
    if (!column.signal) {
      continue;
    }
    if (column.given) {
      options.map.columns.push_back(*column.given);
      continue;
    }
    ColumnMapping mapping{column.name, *column.signal};
    const auto unit = FindUnit(*column.signal, column.unit);
    mapping.scale = unit ? unit->scale : 1.0;
    mapping.offset = unit ? unit->offset : 0.0;
    mapping.unit = column.unit;
    if (SameName(column.unit, "mA") || !column.raw.empty()) {
      const std::vector<double> raw =
          column.raw.empty() ? std::vector{4.0, 20.0} : column.raw;
      const std::vector<double> span =
          column.span.empty() ? std::vector{0.0, 100.0} : column.span;
      const double slope = (span[1] - span[0]) / (raw[1] - raw[0]);
      mapping.offset += mapping.scale * (span[0] - slope * raw[0]);
      mapping.scale *= slope;
      mapping.lowest = raw[0] - 0.1 * (raw[1] - raw[0]);
      mapping.highest = raw[1] + 0.1 * (raw[1] - raw[0]);
    }
    mapping.sense = column.opening ? Sense::kOpening : Sense::kClosing;
    if (column.signal == Signal::kF && unit) {
      options.map.flow_unit = unit->flow_unit;
    }
    options.map.columns.push_back(mapping);
  }
  try {
    const CsvTable table = ReadCsv(lines, options);
    for (const std::string& note : table.notes) {
      found.findings.push_back(note);
    }
    if (table.split_range) {
      for (SniffedColumn& column : found.columns) {
        if (column.signal == Signal::kCv && column.raw.empty()) {
          column.raw = {table.split_range->first, table.split_range->second};
          Say(column, "half of a split range: X moves twice as far");
        }
      }
    }
  } catch (const DataError& error) {
    found.findings.push_back(std::string("refused as it is: ") + error.what());
  }
}

}  // namespace

double SniffedColumn::Quantile(double share) const {
  std::vector<double> sorted = values;
  const auto at =
      sorted.begin() + static_cast<std::ptrdiff_t>(
                           share * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), at, sorted.end());
  return *at;
}

Sniffed Sniff(std::string_view text, const std::string& source, ColumnMap map) {
  return Sniff(TextLines(text, source), source, std::move(map));
}

Sniffed Sniff(const TextLines& lines, const std::string& source,
              ColumnMap map) {
  const std::vector<ColumnMapping> given = map.columns;
  Layout layout = FindLayout(lines, std::move(map), source, true);
  layout.map.columns.clear();
  Sniffed found;
  found.map = layout.map;
  for (const auto& [key, reason] : layout.choices) {
    found.choices.push_back(key + ": " + reason);
  }
  ReadColumns(lines, layout, source, given, found);
  if (found.time.form == TimeForm::kElapsed &&
      !SameName(found.map.time_column, kTimeColumn) &&
      found.map.time_form == TimeForm::kFindOut) {
    found.choices.push_back(
        "time: nothing but the size of its numbers tells the unit of column " +
        found.map.time_column);
  }
  std::vector<std::string> words;
  for (const SniffedColumn& column : found.columns) {
    if (column.signal) {
      words.insert(words.end(), column.words.begin(), column.words.end());
    }
  }
  std::ranges::sort(words);
  words.erase(std::unique(words.begin(), words.end()), words.end());
  if (!words.empty()) {
    found.map.no_reading.insert(found.map.no_reading.end(), words.begin(),
                                words.end());
    found.choices.push_back("missing: " + Listed(words) +
                            " stand where numbers were expected, and are taken "
                            "as no readings");
  }
  ReadWith(lines, source, found);
  return found;
}

std::string MapText(const Sniffed& found, const std::string& file) {
  std::string text =
      "# Of " + file +
      ", by fdi-store runs sniff. Check what is marked as guessed or as a "
      "choice.\n# docs/import.md explains the keys.\n";
  for (const std::string& finding : found.findings) {
    std::string line = finding;
    std::ranges::replace(line, '\n', ' ');
    text += "# - " + line + "\n";
  }
  text += FileToml(found) + TimeToml(found);
  if (const auto& tall = found.map.long_table) {
    text += "\n[long]\ntag = " + TomlText(tall->tag) +
            "\nvalue = " + TomlText(tall->value) + "\n";
    if (!tall->quality.empty()) {
      text += "quality = " + TomlText(tall->quality) + "\n";
    }
  }
  if (const auto& good = found.map.quality.good; !good.empty()) {
    text += "\n[quality]\ngood = " + TomlList(good) + Choice(found, "good");
  }
  for (const SniffedColumn& column : found.columns) {
    if (column.signal) {
      text += SignalToml(found.map, column);
    } else if (IsGasUnit(column.unit)) {
      text += "\n# [signal.F]\n# column = " + TomlText(column.name) +
              "\n# unit = " + TomlText(column.unit) +
              "\n# molar_mass = 28.96  # air [kg/kmol]; that of the gas\n";
    }
  }
  return text;
}

}  // namespace fdi::importer
