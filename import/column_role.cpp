#include "import/column_role.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cstdint>
#include <sstream>

#include "base/csv_cells.h"
#include "import/quality.h"
#include "import/tag_map.h"

// A name is evidence in four ways: by words anywhere in it, by pairs of words
// that say one thing together, by whole parts of it, and by the letters of a
// tag. Each way is a table below, and a new word, unit or code is a row of one.
namespace fdi::importer {
namespace {

using Parts = std::vector<std::string>;

// Clues that are no roles follow the roles; a clue is a bit of a set.
constexpr unsigned Bit(Role role) {
  return 1U << static_cast<unsigned>(role);
}
constexpr unsigned kWanted = 1U << 16U;
constexpr unsigned kActual = 1U << 17U;
constexpr unsigned kInlet = 1U << 18U;
constexpr unsigned kOutlet = 1U << 19U;
constexpr unsigned kFlowValve = 1U << 20U;
constexpr unsigned kValveTag = 1U << 21U;
constexpr unsigned kTemperatureFirst = 1U << 22U;
constexpr unsigned kPressureFirst = 1U << 23U;

struct RoleWords {
  unsigned clue;
  std::string_view words;  ///< Anywhere in the plain name and the text below.
  std::string_view parts;  ///< Whole parts of the name.
};

constexpr std::string_view kSetpointWords =
    "setpoint|set point|sollwert|consigne|consigna|zadan|fuhrungsgr";

// English, German, French, Spanish, Italian, Polish. The order settles names
// with several words: a "flow setpoint" is a setpoint, a "position output" a
// command, a "supply pressure" no P1.
constexpr RoleWords kRoleWords[] = {
    {Bit(Role::kOther),
     "differential|delta p|differenzdruck|druckdifferenz|perte de charge|"
     "roznica cisn|speed|drehzahl|predkosc|obroty|vibrat|schwing|torque|"
     "drehmoment|totali|counter|zahlerstand|licznik|alarm|deviation|abweichung|"
     "density|dichte|viscos|conductiv|leitfahigkeit|motorstrom|motor current|"
     "leistung",
     "|dp|pdt|pdi|pdic|dpt|st|si|sic|jt|vt|power|dev|err|hi|hh|lo|ll|hihi|lolo|"
     "hlim|llim|alm|"},
    {Bit(Role::kMode), "", "|mode|"},
    {Bit(Role::kMeasured), "", "|pv|meas|"},
    {Bit(Role::kSetpoint), kSetpointWords, "|sp|spt|sv|w|lsp|rsp|"},
    {Bit(Role::kPosition), "realiment|retroaliment|retroazion", ""},
    {Bit(Role::kSupply),
     "supply|instrument air|zuluft|steuerluft|air comprim|aria strument|"
     "alimentation|alimentacion|alimentazion|zasilan",
     "|air|"},
    {Bit(Role::kCommand),
     "command|demand|output|stellgr|stellwert|stellsig|stellbefehl|ansteuer|"
     "reglerausgang|sortie|salida|uscita|mando|sterow|sterujac|wyjsci|setpos|"
     "manipul|writevalue",
     "|op|out|co|cv|mv|cmd|dem|ao|lmn|mn|yout|ysoll|wyj|y|u|"},
    {Bit(Role::kPosition),
     "position|posizion|travel|stem|opening|offnung|oeffnung|stellung|"
     "ruckmeld|rueckmeld|ruckfuhr|rueckfuehr|feedback|readback|readvalue|"
     "recopie|ouverture|posicion|apertura|corsa|carrera|polozen|pozycj|"
     "otwarci|hub|lift|skok|course|posn",
     "|x|pos|zt|zi|zit|gt|gi|zso|zsc|fb|fbk|rb|rbv|lmnr|vp|yist|xist|"},
    {Bit(Role::kLevel), "level|fullstand|niveau|nivel|livello|poziom",
     "|lt|li|lit|"},
    {Bit(Role::kTemperature), "temp", "|t1|"},
    {Bit(Role::kUpstream),
     "upstream|inlet|vordruck|eingangsdruck|vor ventil|amont|monte|"
     "aguas arriba|przed zaw",
     "|p1|"},
    {Bit(Role::kDownstream),
     "downstream|outlet|nachdruck|hinterdruck|ausgangsdruck|nach ventil|aval|"
     "valle|aguas abajo|za zaw",
     "|p2|"},
    {Bit(Role::kPressure), "press|druck|presion|cisnien", ""},
    {Bit(Role::kFlow),
     "flow|durchfl|menge|strom|debit|caudal|flujo|portata|przeplyw|natezeni|"
     "strumien",
     "|q|qist|"},
};

// Clues that mean something beside another one.
constexpr RoleWords kOtherWords[] = {
    {Bit(Role::kValve), "valve|ventil|armatur|vanne|valvula|valvola|zawor", ""},
    {kFlowValve,
     "flow valve|flow control valve|flow ctrl valve|durchflussregel|"
     "durchflussventil|mengenregel|vanne de debit|vanne debit|"
     "valvula de caudal|valvola di portata|zawor przeplyw|regulacji przeplyw",
     ""},
    {kWanted, kSetpointWords, "|soll|sp|ref|req|target|"},
    {kActual, "istwert|actual|rzeczywist|mierzon|reelle|reale",
     "|ist|act|actual|"},
    {kInlet, "entree|entrada|ingresso|wlot|eingang", ""},
    {kOutlet, "sortie|salida|uscita|wylot|ausgang", ""},
};

constexpr unsigned kMeasurements = Bit(Role::kFlow) | Bit(Role::kPressure) |
                                   Bit(Role::kTemperature) | Bit(Role::kLevel);
constexpr unsigned kOfValve = Bit(Role::kValve) | kValveTag;

/// A role that two clues give together.
struct Pair {
  Role role;
  unsigned first;   ///< One of these,
  unsigned second;  ///< and one of these,
  unsigned none;    ///< and none of these.
};
// The set point of a position or of a valve is the command, the actual value of
// a valve its position, and "pression sortie", which begins with what is
// measured, is no output.
constexpr Pair kPairs[] = {
    {Role::kCommand, kWanted, Bit(Role::kPosition), 0},
    {Role::kCommand, kWanted, kOfValve, kMeasurements},
    {Role::kPosition, kActual, kOfValve, kMeasurements | Bit(Role::kCommand)},
    {Role::kTemperature, kTemperatureFirst, ~0U, Bit(Role::kSupply)},
    {Role::kUpstream, kPressureFirst, kInlet,
     Bit(Role::kSupply) | Bit(Role::kOther)},
    {Role::kDownstream, kPressureFirst, kOutlet,
     Bit(Role::kSupply) | Bit(Role::kOther)},
};

/// Units that say what a column is, whatever its name says.
constexpr std::pair<Signal, Role> kRolesOfUnits[] = {
    {Signal::kF, Role::kFlow},
    {Signal::kP1, Role::kPressure},
    {Signal::kT1, Role::kTemperature}};

/// Units of quantities that no signal has.
constexpr std::string_view kOtherUnits =
    "|rpm|1/min|u/min|kw|mw|w|a|v|hz|ph|mm|cm|m|mm/s|us/cm|ms/cm|ntu|ppm|mg/l|"
    "g/l|kg/m3|m3|t|kg|kwh|mwh|s|min|h|nm|kn|kj/kg|mv|ohm|";

// Equipment by KKS (VGB-B 105: 10LAB30AA101 is a valve, CF a flow) or by the
// older AKZ (RL30S101, RL30F001): `a` is a letter, 0 a digit, and the kind
// stands for itself.
struct PlantCode {
  std::string_view form;
  Role role;
};
constexpr PlantCode kPlantCodes[] = {
    {"aaa00AA000", Role::kValve},    {"aaa00CF000", Role::kFlow},
    {"aaa00CP000", Role::kPressure}, {"aaa00CT000", Role::kTemperature},
    {"aaa00CL000", Role::kLevel},    {"aaa00CG000", Role::kPosition},
    {"aaa00AP000", Role::kOther},    {"aaa00AN000", Role::kOther},
    {"aaa00AC000", Role::kOther},    {"aaa00AE000", Role::kOther},
    {"aaa00CQ000", Role::kOther},    {"aaa00CS000", Role::kOther},
    {"aaa00CD000", Role::kOther},    {"aaa00CE000", Role::kOther},
    {"aa00S000", Role::kValve},      {"aa00F000", Role::kFlow},
    {"aa00P000", Role::kPressure},   {"aa00T000", Role::kTemperature},
    {"aa00L000", Role::kLevel}};

// First letters of a tag by ISA 5.1 (Z position) and DIN 19227 (G position).
constexpr std::pair<char, Role> kFirstLetters[] = {
    {'f', Role::kFlow},  {'p', Role::kPressure}, {'t', Role::kTemperature},
    {'l', Role::kLevel}, {'z', Role::kPosition}, {'g', Role::kPosition}};

bool IsLetter(char c) {
  return std::isalpha(static_cast<unsigned char>(c)) != 0;
}
bool IsDigit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}

// Parts between all that is no letter or digit: "17fc", "op" of "17FC.OP".
Parts PartsOf(std::string_view plain) {
  Parts parts{""};
  for (const char c : plain) {
    if (IsLetter(c) || IsDigit(c)) {
      parts.back() += c;
    } else if (!parts.back().empty()) {
      parts.emplace_back();
    }
  }
  if (parts.back().empty()) {
    parts.pop_back();
  }
  return parts;
}

// The first letters in a row: "fv" of "fv17a", "cv" of "03cv".
std::string Letters(const std::string& part) {
  const auto begin = std::ranges::find_if(part, IsLetter);
  return {begin, std::find_if_not(begin, part.end(), IsLetter)};
}

bool HasDigit(const std::string& part) {
  return std::ranges::any_of(part, IsDigit);
}

bool HasPart(const Parts& parts, std::string_view any) {
  return std::ranges::any_of(
      parts, [&](const std::string& part) { return IsListedWord(part, any); });
}

bool IsUnitOfName(const std::string& unit, bool in_brackets) {
  const std::string plain = PlainText(unit);
  // "1" is a unit of percentages, but at the end of a name it is a number of a
  // loop, and "F" and "C" are letters of a tag there.
  return plain == "ma" || IsGasUnit(unit) ||
         (in_brackets && IsListedWord(plain, kOtherUnits)) ||
         (plain != "1" && (in_brackets || plain.size() > 1 || plain == "%") &&
          IsUnit(unit));
}

struct NamedUnit {
  std::string rest;  ///< The name without it.
  std::string unit;
};

// A unit in a name: "bar g" of "PT101 [bar g]", "t/h" of "F_t_h", "gpm" of
// "FLOW 17 GPM", "kPa" of "p1/kPa" (DIN 1313), "%" of "OUT%"; else empty.
NamedUnit UnitIn(const std::string& name) {
  for (const std::string_view cuts : {"[(", " _", "/"}) {
    const bool brackets = cuts == "[(";
    for (std::size_t at = name.find_first_of(cuts); at != std::string::npos;
         at = name.find_first_of(cuts, at + 1)) {
      const std::size_t close =
          brackets ? name.find_first_of("])", at) : name.size();
      if (close == std::string::npos || (!brackets && at == 0)) {
        continue;
      }
      std::string unit = name.substr(at + 1, close - at - 1);
      // Not "1]" of "[page 1]".
      const bool cut = !brackets &&
                       unit.find_first_of("[(") == std::string::npos &&
                       unit.find_first_of("])") != std::string::npos;
      if (cuts == " _") {
        std::ranges::replace(unit, '_', '/');
      }
      if (!cut && IsUnitOfName(unit, brackets)) {
        return {name.substr(0, at) + (brackets ? name.substr(close + 1) : ""),
                unit};
      }
    }
  }
  return name.size() > 1 && name.ends_with('%')
             ? NamedUnit{name.substr(0, name.size() - 1), "%"}
             : NamedUnit{name, {}};
}

// "Value" of "Value (2)", the second of this name (layout.h).
std::string WithoutNumber(const std::string& name) {
  const std::size_t open = name.rfind(" (");
  const bool numbered =
      name.ends_with(')') && open != std::string::npos &&
      name.find_first_not_of("0123456789", open + 2) == name.size() - 1;
  return numbered ? name.substr(0, open) : name;
}

bool HasForm(std::string_view text, std::string_view form) {
  if (text.size() < form.size()) {
    return false;
  }
  for (std::size_t k = 0; k < form.size(); ++k) {
    const char c = text[k];
    if (form[k] == 'a'   ? !IsLetter(c)
        : form[k] == '0' ? !IsDigit(c)
                         : c != static_cast<char>(std::tolower(form[k]))) {
      return false;
    }
  }
  return true;
}

// The code after that of a valve tells which signal it is: XQ01 is read from
// the valve, YQ01 is written to it.
std::optional<Role> RoleOfPlantCode(const Parts& parts) {
  std::string joined;
  for (const std::string& part : parts) {
    joined += part;
  }
  for (std::size_t at = 0; at < joined.size(); ++at) {
    if (at > 0 && IsLetter(joined[at - 1])) {
      continue;
    }
    const std::string_view rest = std::string_view(joined).substr(at);
    for (const PlantCode& code : kPlantCodes) {
      if (HasForm(rest, code.form)) {
        const char behind =
            rest.size() > code.form.size() ? rest[code.form.size()] : ' ';
        return code.role != Role::kValve ? code.role
               : behind == 'y'           ? Role::kCommand
               : behind == 'x'           ? Role::kPosition
                                         : Role::kValve;
      }
    }
  }
  return std::nullopt;
}

std::optional<Role> RoleOfLetters(const std::string& letters) {
  if (letters.ends_with('v') || letters == "ven") {
    return Role::kValve;
  }
  // The position of a valve in a loop of flow: FZT.
  if (letters.size() > 1 && letters[1] == 'z') {
    return Role::kPosition;
  }
  // A relay or converter.
  if (letters.ends_with('y') &&
      std::string_view("fptl").find(letters.front()) !=
          std::string_view::npos) {
    return Role::kCommand;
  }
  // Functions of ISA 5.1: "tag" and "pump" are no tags.
  if (letters.find_first_not_of("cdefghikqrstvxyz", 1) != std::string::npos) {
    return std::nullopt;
  }
  if (letters.starts_with("pd")) {
    return Role::kOther;
  }
  const auto* const found = std::ranges::find(kFirstLetters, letters.front(),
                                              &std::pair<char, Role>::first);
  return found == std::end(kFirstLetters) ? std::nullopt
                                          : std::optional(found->second);
}

// The role of a tag, from its last part to its first: "fic" of "20.FIC101.PV",
// "fv" of "AO_FV17". The part with the number of the loop comes first.
std::optional<Role> RoleOfTag(const Parts& parts) {
  if (const auto role = RoleOfPlantCode(parts)) {
    return role;
  }
  for (const bool numbered : {true, false}) {
    for (std::size_t i = parts.size(); i-- > 0;) {
      const std::string letters = Letters(parts[i]);
      // "pv" without a number is the process value of the tag before it or of
      // an unknown one, and "pid1" a block of it.
      if (HasDigit(parts[i]) != numbered || letters.empty() ||
          letters.size() > 4 || letters.starts_with("pid") ||
          IsListedWord(letters,
                       "|ai|ao|di|do|fb|daca|daci|pct|plc|feed|test|zeit|") ||
          (letters == parts[i] &&
           (IsListedWord(letters, "|pv|sv|") ||
            (parts.size() > 1 &&
             IsListedWord(letters, "|iv|val|value|i|a|b|no|st|db|"))))) {
        continue;
      }
      if (const auto role = RoleOfLetters(letters)) {
        return role;
      }
    }
  }
  return std::nullopt;
}

// The clues of words anywhere in a name. The name of a flow valve is no clue to
// a flow.
unsigned CluesOf(const std::string& plain, const Parts& parts) {
  unsigned clues = 0;
  for (const RoleWords& row : kOtherWords) {
    clues |=
        HasWord(plain, row.words) || HasPart(parts, row.parts) ? row.clue : 0U;
  }
  for (const RoleWords& row : kRoleWords) {
    clues |= HasWord(plain, row.words) ? row.clue : 0U;
    if (!parts.empty() && HasWord(parts.front(), row.words)) {
      clues |= row.clue == Bit(Role::kTemperature) ? kTemperatureFirst
               : row.clue == Bit(Role::kPressure)  ? kPressureFirst
                                                   : 0U;
    }
  }
  return (clues & kFlowValve) != 0 ? clues & ~Bit(Role::kFlow) : clues;
}

// The output of a transmitter ("FT17.OUT") or of a block that takes a reading
// in ("FIC-17/AI1/OUT") is what it measures.
bool IsOutputOfReading(const Parts& parts, std::size_t at, Role tag) {
  return (parts[at] == "out" || parts[at] == "ao") &&
         ((kMeasurements | Bit(Role::kPosition)) & Bit(tag)) != 0 &&
         std::ranges::any_of(parts, [&](const std::string& part) {
           const std::string code = Letters(part);
           return part != parts[at] &&
                  ((code.size() > 1 && code.ends_with('t')) || code == "ai");
         });
}

Role RoleOfBit(unsigned bit) {
  return static_cast<Role>(std::countr_zero(bit));
}

// The attribute behind a tag (".OP"), from the last part to the first.
std::optional<Role> RoleOfPart(const Parts& parts, std::optional<Role> tag,
                               bool& by_tag) {
  for (std::size_t i = parts.size(); i-- > 0;) {
    const std::string letters = Letters(parts[i]);
    // "MV101" and "CV7" are valves, "51_03CV" is an attribute. So are "Y1" and
    // "U2" units of a plant, and "Y" is the command.
    const bool numbered =
        parts[i].size() > letters.size() && IsLetter(parts[i].front()) &&
        (letters.ends_with('v') || (letters.size() == 1 && letters != "x"));
    for (const RoleWords& row : kRoleWords) {
      // "PV" is what its tag measures, which the letters of that tell.
      if (row.clue == Bit(Role::kMeasured) ||
          (!IsListedWord(parts[i], row.parts) &&
           (numbered || !IsListedWord(letters, row.parts)))) {
        continue;
      }
      by_tag = row.clue == Bit(Role::kCommand) && tag &&
               IsOutputOfReading(parts, i, *tag);
      return by_tag ? tag : std::optional(RoleOfBit(row.clue));
    }
  }
  return std::nullopt;
}

// Pairs of words first, then words, the attribute behind a tag, its letters,
// and last the word valve by itself.
void TakeName(const std::string& name, const std::string& about,
              RoleGuess& guess) {
  const std::string plain = PlainText(name + ' ' + about);
  const Parts parts = PartsOf(PlainText(name));
  const auto tag = RoleOfTag(parts);
  const unsigned clues =
      CluesOf(plain, parts) | (tag == Role::kValve ? kValveTag : 0U);
  guess.of_measurement = ((clues | (tag ? Bit(*tag) : 0U)) & kMeasurements &
                          ~Bit(Role::kLevel)) != 0;
  guess.by_word = true;
  const unsigned seen =
      (clues & kFlowValve) != 0 ? clues & ~kMeasurements : clues;
  for (const Pair& pair : kPairs) {
    if ((clues & pair.first) != 0 && (clues & pair.second) != 0 &&
        (seen & pair.none) == 0) {
      guess.role = pair.role;
      return;
    }
  }
  for (const RoleWords& row : kRoleWords) {
    if (HasWord(plain, row.words) && (clues & row.clue) != 0) {
      guess.role = RoleOfBit(row.clue);
      return;
    }
  }
  bool by_tag = false;
  guess.role = RoleOfPart(parts, tag, by_tag);
  guess.by_word = guess.role && !by_tag;
  if (guess.role) {
    return;
  }
  // An input card reads the position of a valve.
  const bool read = std::ranges::any_of(
      parts, [](const std::string& part) { return Letters(part) == "ai"; });
  guess.role = tag == Role::kValve && read ? Role::kPosition
               : !tag && (clues & Bit(Role::kValve)) != 0
                   ? std::optional(Role::kValve)
                   : tag;
}

// Takes a flow, a pressure or a temperature by its unit, even if the name
// says otherwise.
void TakeUnit(RoleGuess& guess) {
  if (SameName(guess.unit, "mA")) {
    // The current to a positioner; a transmitter with its current in mA.
    guess.role = guess.role == Role::kValve ? Role::kCommand : guess.role;
    return;
  }
  for (const auto& [signal, role] : kRolesOfUnits) {
    const auto named = guess.role ? SignalOf(*guess.role) : std::nullopt;
    if (!guess.unit.empty() && guess.role != Role::kOther &&
        FindUnit(signal, guess.unit) &&
        !(named && FindUnit(*named, guess.unit))) {
      guess.role = role;
    }
  }
  if (IsListedWord(PlainText(guess.unit), kOtherUnits)) {
    guess.role.reset();
  }
}

}  // namespace

RoleGuess RoleOf(const std::string& name, const std::string& about,
                 const std::string& part) {
  RoleGuess guess;
  guess.unit = UnitIn(WithoutNumber(name)).unit;
  std::istringstream lines(about);
  for (std::string line; guess.unit.empty() && std::getline(lines, line);) {
    guess.unit = UnitIn('[' + line + ']').unit;
  }
  const std::string rest = UnitIn(part).rest;
  TakeName(rest, about, guess);
  TakeUnit(guess);
  std::string whole = UnitIn(WithoutNumber(name)).rest;
  whole.resize(whole.find_last_not_of(' ') + 1);
  guess.tag = whole.substr(0, whole.find_last_of("./: ") + 1);
  const Parts tags = PartsOf(PlainText(whole));
  guess.of_tag = RoleOfTag(tags);
  guess.of_controller = std::ranges::any_of(tags, [](const std::string& each) {
    return HasDigit(each) && IsListedWord(Letters(each), "|fc|fic|ffc|frc|");
  });
  const Parts parts = PartsOf(PlainText(rest));
  for (const RoleWords& row : kRoleWords) {
    if (!guess.attribute && !parts.empty() &&
        IsListedWord(parts.back(), row.parts)) {
      guess.attribute = RoleOfBit(row.clue);
    }
  }
  return guess;
}

std::optional<Signal> SignalOf(Role role) {
  static constexpr std::pair<Role, Signal> kSignals[] = {
      {Role::kCommand, Signal::kCv},    {Role::kPosition, Signal::kX},
      {Role::kValve, Signal::kX},       {Role::kFlow, Signal::kF},
      {Role::kUpstream, Signal::kP1},   {Role::kPressure, Signal::kP1},
      {Role::kDownstream, Signal::kP2}, {Role::kTemperature, Signal::kT1},
      {Role::kSupply, Signal::kPz},     {Role::kSetpoint, Signal::kSp}};
  const auto* const found =
      std::ranges::find(kSignals, role, &std::pair<Role, Signal>::first);
  return found == std::end(kSignals) ? std::nullopt
                                     : std::optional(found->second);
}

std::vector<std::string> DistinctParts(const std::vector<std::string>& names,
                                       const std::vector<std::string>& abouts) {
  std::vector<std::string> parts;
  for (std::size_t i = 0; i < names.size(); ++i) {
    // "Value (2)" is told apart by what is above it.
    const bool numbered = WithoutNumber(names[i]) != names[i];
    const std::size_t line = abouts[i].find_first_not_of('\n');
    parts.push_back(
        numbered && line != std::string::npos
            ? abouts[i].substr(line, abouts[i].find('\n', line) - line)
            : names[i]);
  }
  constexpr std::string_view kCuts = "./\\:";
  const auto common = [&](const auto& part) {
    return parts.size() > 1 && !part(parts.front()).empty() &&
           std::ranges::all_of(parts, [&](const std::string& name) {
             return part(name) == part(parts.front()) &&
                    part(name).size() < name.size();
           });
  };
  const auto ending = [&](const std::string& name) {
    const std::size_t at = name.find_last_of(kCuts);
    const bool none = at == std::string::npos || at == 0;
    // The output of a function block carries the name of the block.
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
    for (std::string& name : parts) {
      name.resize(name.size() - ending(name).size());
    }
  }
  // "PV" and "SP" are told by the tag in front of them.
  if (common(beginning)) {
    for (std::string& name : parts) {
      const std::string tag = beginning(name);
      if (!IsListedWord(PlainText(name.substr(tag.size())), "|pv|sp|sv|") ||
          !RoleOfTag(PartsOf(PlainText(tag)))) {
        name.erase(0, tag.size());
      }
    }
  }
  return parts;
}

}  // namespace fdi::importer
