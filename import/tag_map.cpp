#include "import/tag_map.h"

#include <algorithm>
#include <cmath>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/toml_reader.h"

// A tag map says which column is which signal, and in what unit
// (docs/import.md, "The map"). Raw counts, span and unit of a column become one
// straight line, reading = offset + scale · cell.
namespace fdi::importer {
namespace {

constexpr double kAtmosphereKpa = 101.325;

/// Kinds of quantity; signals of one kind have the same units.
enum class Quantity { kPercent, kPressure, kTemperature, kFlow, kNumber, kOwn };

Quantity QuantityOf(Signal signal) {
  switch (signal) {
    case Signal::kCv:
    case Signal::kX:
    case Signal::kSp:
      return Quantity::kPercent;
    case Signal::kP1:
    case Signal::kP2:
    case Signal::kPs:
    case Signal::kPz:
      return Quantity::kPressure;
    case Signal::kT1:
      return Quantity::kTemperature;
    case Signal::kF:
      return Quantity::kFlow;
    case Signal::kCvi:
      return Quantity::kNumber;
    case Signal::kPv:
      return Quantity::kOwn;
  }
  return Quantity::kNumber;
}

struct UnitEntry {
  std::string_view name;
  Quantity quantity;
  UnitConversion conversion;
};

constexpr FlowUnit kVolume = FlowUnit::kM3PerHour;
constexpr FlowUnit kMass = FlowUnit::kTPerHour;
// To %, kPa, degC, and m3/h or t/h, with scale and offset. The unit of a flow
// also says whether it is one of volume or of mass.
constexpr UnitEntry kSignalUnits[] = {
    {"%", Quantity::kPercent, {1.0, 0.0, kVolume}},
    {"1", Quantity::kPercent, {100.0, 0.0, kVolume}},
    {"kPa", Quantity::kPressure, {1.0, 0.0, kVolume}},
    {"Pa", Quantity::kPressure, {1e-3, 0.0, kVolume}},
    {"mbar", Quantity::kPressure, {0.1, 0.0, kVolume}},
    {"bar", Quantity::kPressure, {100.0, 0.0, kVolume}},
    {"MPa", Quantity::kPressure, {1000.0, 0.0, kVolume}},
    {"psi", Quantity::kPressure, {6.894757293168, 0.0, kVolume}},
    {"hPa", Quantity::kPressure, {0.1, 0.0, kVolume}},
    {"kg/cm2", Quantity::kPressure, {98.0665, 0.0, kVolume}},
    {"degC", Quantity::kTemperature, {1.0, 0.0, kVolume}},
    {"degF", Quantity::kTemperature, {5.0 / 9.0, -160.0 / 9.0, kVolume}},
    {"K", Quantity::kTemperature, {1.0, -273.15, kVolume}},
    {"m3/h", Quantity::kFlow, {1.0, 0.0, kVolume}},
    {"m3/s", Quantity::kFlow, {3600.0, 0.0, kVolume}},
    {"l/min", Quantity::kFlow, {0.06, 0.0, kVolume}},
    {"l/s", Quantity::kFlow, {3.6, 0.0, kVolume}},
    {"l/h", Quantity::kFlow, {1e-3, 0.0, kVolume}},
    {"gpm", Quantity::kFlow, {0.22712470704, 0.0, kVolume}},  // US gallons
    {"m3/min", Quantity::kFlow, {60.0, 0.0, kVolume}},
    {"m3/d", Quantity::kFlow, {1.0 / 24.0, 0.0, kVolume}},
    {"t/h", Quantity::kFlow, {1.0, 0.0, kMass}},
    {"kg/h", Quantity::kFlow, {1e-3, 0.0, kMass}},
    {"kg/s", Quantity::kFlow, {3.6, 0.0, kMass}},
    {"kg/min", Quantity::kFlow, {0.06, 0.0, kMass}},
    {"t/d", Quantity::kFlow, {1.0 / 24.0, 0.0, kMass}},
    {"lb/h", Quantity::kFlow, {0.45359237e-3, 0.0, kMass}},
    {"klb/h", Quantity::kFlow, {0.45359237, 0.0, kMass}},
    {"lb/min", Quantity::kFlow, {60.0 * 0.45359237e-3, 0.0, kMass}},
    {"bbl/d", Quantity::kFlow, {0.158987294928 / 24.0, 0.0, kVolume}},
    {"1", Quantity::kNumber, {1.0, 0.0, kVolume}},
};

// Flows of gas in m3/h at 0 degC and 101.325 kPa. Sm3 are those at 15 degC,
// cubic feet those at 60 degF and 14.696 psi, as is usual for each.
constexpr double kNormalPerSm3 = 273.15 / 288.15;
constexpr double kNormalPerScf =
    0.028316846592 * 273.15 / (273.15 + 140.0 / 9.0);
constexpr std::pair<std::string_view, double> kGasUnits[] = {
    {"nm3/h", 1.0},
    {"nm3/min", 60.0},
    {"nm3/s", 3600.0},
    {"nm3/d", 1.0 / 24.0},
    {"knm3/h", 1000.0},
    {"sm3/h", kNormalPerSm3},
    {"nl/min", 0.06},
    {"nl/h", 1e-3},
    {"sl/min", 0.06},
    {"slpm", 0.06},
    {"scfm", 60.0 * kNormalPerScf},
    {"scfh", kNormalPerScf},
    {"mscfh", 1e3 * kNormalPerScf},
    {"mmscfd", 1e6 / 24.0 * kNormalPerScf}};

// Normalises a unit: "bar (g)" to "barg", "m³/h" to "m3/h", "°C" to "degC".
std::string Plain(std::string_view name) {
  std::string plain;
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (name.substr(i).starts_with("³")) {
      plain += '3';
      ++i;
    } else if (name.substr(i).starts_with("ü")) {
      plain += 'u';
      ++i;
    } else if (name.substr(i).starts_with("°")) {
      plain += "deg";
      ++i;
    } else if (std::string_view(" ()[]_").find(name[i]) ==
               std::string_view::npos) {
      plain += name[i];
    }
  }
  if (SameName(plain, "c") || SameName(plain, "f")) {
    plain = "deg" + plain;
  }
  for (const std::string_view percent :
       {"pct", "percent", "prozent", "%open", "%opening", "%auf"}) {
    plain = SameName(plain, percent) ? "%" : plain;
  }
  static constexpr std::pair<std::string_view, std::string_view> kSpellings[] =
      {{"tph", "t/h"},   {"to/h", "t/h"},    {"te/h", "t/h"},
       {"kgph", "kg/h"}, {"pph", "lb/h"},    {"kpph", "klb/h"},
       {"lpm", "l/min"}, {"lps", "l/s"},     {"lph", "l/h"},
       {"m3ph", "m3/h"}, {"cmh", "m3/h"},    {"cbm/h", "m3/h"},
       {"usgpm", "gpm"}, {"celsius", "degC"}};
  for (const auto& [spelling, unit] : kSpellings) {
    plain = SameName(plain, spelling) ? unit : plain;
  }
  return plain;
}

// Factor of a unit of gas at standard conditions, to m3/h at 0 degC.
std::optional<double> NormalVolume(std::string_view name) {
  const std::string plain = PlainText(Plain(name));
  for (const auto& [unit, normal] : kGasUnits) {
    if (unit == plain) {
      return normal;
    }
  }
  return std::nullopt;
}

// W = M Q0 / V0 with the volume V0 of a kmol at 0 degC and 101.325 kPa, to t/h.
UnitConversion GasConversion(TomlReader& table, const std::string& name,
                             ColumnMap& map) {
  constexpr double kMolarVolume = 22.413970;  // m3/kmol
  const auto molar_mass = table.Number("molar_mass", 1.0, 500.0);
  if (!molar_mass) {
    table.Refuse("unit",
                 "'" + name +
                     "' is a flow of gas at standard conditions, which becomes "
                     "t/h by the molar mass: molar_mass = 28.96 (air), 18.02 "
                     "(steam), 44.01 (CO2) kg/kmol. For a liquid the unit is "
                     "another one; likeliest is m3/h");
  }
  map.gas_flow = GasFlow{name, *molar_mass};
  return {*NormalVolume(name) * *molar_mass / kMolarVolume * 1e-3, 0.0, kMass};
}

// A card shows a broken wire or a short circuit by counts beyond its range: 3.6
// and 21 mA, 32767. A tenth of the range is left to overrange.
void LimitCounts(const std::vector<double>& raw, ColumnMapping& mapping) {
  const double margin = 0.1 * std::abs(raw[1] - raw[0]);
  mapping.lowest = std::min(raw[0], raw[1]) - margin;
  mapping.highest = std::max(raw[0], raw[1]) + margin;
}

// True if a command is half of a split range, beyond which the valve is at its
// end.
bool IsHalfOfARange(Signal signal, const std::string& unit,
                    const std::vector<double>& raw, double scale) {
  if (signal != Signal::kCv && signal != Signal::kSp) {
    return false;
  }
  if (raw.empty()) {
    return unit == "%" && scale > 1.0;
  }
  const double most = raw.size() == 2 ? std::max(raw[0], raw[1]) : 0.0;
  return unit != "mA" && most <= 100.0 && most > 25.0;
}

void ReadUnit(TomlReader& table, Signal signal, ColumnMap& map,
              ColumnMapping& mapping) {
  const bool flow = signal == Signal::kF;
  const bool percent = QuantityOf(signal) == Quantity::kPercent;
  // A flow is measured as volume or mass; only the file's author knows which.
  const std::string name = table.Text("unit").value_or(
      flow                     ? ""
      : signal == Signal::kCvi ? "1"
                               : std::string(SignalUnit(signal)));
  const auto unit =
      flow && IsGasUnit(name)
          ? std::optional(GasConversion(table, name, map))
          : FindUnit(signal, name == "mA" && percent ? "%" : name);
  if (!unit) {
    table.Refuse("unit", "unknown unit '" + name + "'; accepted are" +
                             UnitNames(signal));
  }
  // raw and span are two points of a line, reading = offset + scale · cell:
  //
  //     scale = (span₁ − span₀)/(raw₁ − raw₀),   offset = span₀ − scale · raw₀.
  //
  // By default a current in mA is 4 to 20, and a percentage is 0 to 100 % over
  // `raw`. Other signals have to state both.
  std::vector<double> raw = table.Numbers("raw");
  std::vector<double> span = table.Numbers("span");
  const bool counts = !raw.empty() || name == "mA";
  if (name == "mA" && raw.empty()) {
    raw = {4.0, 20.0};
  }
  if (!raw.empty() && span.empty() && percent) {
    span = {0.0, 100.0};
  }
  double scale = table.Number("scale").value_or(1.0);
  double offset = table.Number("offset").value_or(0.0);
  if (!raw.empty() || !span.empty()) {
    if (raw.size() != 2 || span.size() != 2 || raw[0] == raw[1] ||
        table.Has("scale") || table.Has("offset")) {
      table.Refuse(raw.empty() ? "span" : "raw",
                   "raw = [4, 20] and span = [LOW, HIGH] belong together, each "
                   "with two numbers, and without scale and offset");
    }
    scale = (span[1] - span[0]) / (raw[1] - raw[0]);
    offset = span[0] - scale * raw[0];
  }
  if (table.Boolean("root").value_or(false)) {
    if (!flow || raw.size() != 2) {
      table.Refuse(
          "root",
          "is of a flow whose cells are a pressure difference: raw = "
          "[0, 100] and span = [LOW, HIGH] state its range and that of "
          "the flow");
    }
    mapping.root = std::pair(raw[0], raw[1]);
  }
  // The linear map of the user is applied first, then the unit: value = u₀ + u₁
  // (offset + scale · cell).
  mapping.scale = unit->scale * scale;
  mapping.offset = unit->offset + unit->scale * offset;
  mapping.unit = name;
  if (IsHalfOfARange(signal, name, raw, scale)) {
    mapping.clamped = true;
  } else if (counts && raw.size() == 2) {
    LimitCounts(raw, mapping);
  }
  mapping.quality = table.Text("quality").value_or("");
  if (flow) {
    map.flow_unit = unit->flow_unit;
  }
}

void ReadSignal(Signal signal, TomlReader table, ColumnMap& map) {
  ColumnMapping mapping;
  mapping.signal = signal;
  const auto column = table.Text("column");
  if (!column) {
    table.Refuse("column",
                 "is missing: the name in the header of the table, or the tag");
  }
  mapping.column = *column;
  ReadUnit(table, signal, map, mapping);
  const std::string sense = table.Text("sense").value_or("closing");
  if (sense != "closing" && sense != "opening") {
    table.Refuse("sense", "'" + sense + "' is neither closing nor opening");
  }
  mapping.sense = sense == "opening" ? Sense::kOpening : Sense::kClosing;
  if (QuantityOf(signal) != Quantity::kPercent &&
      mapping.sense == Sense::kOpening) {
    table.Refuse("sense", "only CV, X and SP count in % of closing or opening");
  }
  map.columns.push_back(mapping);
}

DateOrder ParseDateOrder(const std::string& text) {
  if (text != "d/m/y" && text != "m/d/y" && text != "y/m/d") {
    throw ConfigError("date '" + text + "' is none of d/m/y, m/d/y, y/m/d");
  }
  return text == "d/m/y"   ? DateOrder::kDayFirst
         : text == "m/d/y" ? DateOrder::kMonthFirst
                           : DateOrder::kYearFirst;
}

void ReadTime(TomlReader table, ColumnMap& map) {
  map.time_column = table.Text("column").value_or("");
  map.clock_column = table.Text("clock").value_or("");
  map.ms_column = table.Text("ms").value_or("");
  map.zone = table.Text("zone").value_or("");
  const std::string unit = table.Text("unit").value_or("auto");
  const auto form = FindTimeUnit(unit);
  if (!form) {
    table.Refuse("unit", "'" + unit + "' is none of " + TimeUnitNames());
  }
  map.time_unit = *form;
  if (const auto date = table.Text("date")) {
    try {
      map.date_order = ParseDateOrder(*date);
    } catch (const ConfigError& error) {
      table.Refuse("date", error.what());
    }
  }
}

// One of the `accepted` characters; NUL if the key is absent.
char ReadSign(TomlReader& table, std::string_view key,
              std::string_view accepted) {
  const std::string text = table.Text(key).value_or("");
  if (text == "tab") {
    return '\t';
  }
  if (text.size() > 1 ||
      (!text.empty() && accepted.find(text) == std::string_view::npos)) {
    table.Refuse(key, "'" + text + "' is none of the signs " +
                          std::string(accepted) +
                          (accepted.size() > 2 ? "blank and tab" : ""));
  }
  return text.empty() ? '\0' : text.front();
}

void ReadFile(TomlReader table, ColumnMap& map) {
  map.separator = ReadSign(table, "separator", ",;|\t ");
  map.decimal = ReadSign(table, "decimal", ".,");
  map.thousands = ReadSign(table, "thousands", ".,");
  map.skip = static_cast<int>(table.Number("skip", 0.0, 1e6).value_or(0.0));
  map.header_rows =
      static_cast<int>(table.Number("header", 1.0, 20.0).value_or(0.0));
  map.no_reading = table.Texts("missing");
  if (const auto resample = table.Text("resample")) {
    try {
      map.resampling = ParseResampling(*resample);
    } catch (const ConfigError& error) {
      table.Refuse("resample", error.what());
    }
  }
}

}  // namespace

std::optional<UnitConversion> FindUnit(Signal signal, std::string_view name) {
  if (QuantityOf(signal) == Quantity::kOwn) {
    return UnitConversion{};  // Whatever it is, it stays.
  }
  std::string plain = Plain(name);
  const auto find = [&]() -> std::optional<UnitConversion> {
    for (const UnitEntry& unit : kSignalUnits) {
      // mPa is not MPa.
      if (unit.quantity == QuantityOf(signal) &&
          (unit.name == plain ||
           (unit.name != "MPa" && SameName(unit.name, plain)))) {
        return unit.conversion;
      }
    }
    return std::nullopt;
  };
  // The whole name comes first, because "Pa" and "kPa" end with the a of
  // "absolute".
  auto found = find();
  // In gauge pressures, "bar(u)" stands for the German "bar(ü)".
  for (const std::string_view suffix :
       {"gauge", "abs", "uberdruck", "rel", "eff", "g", "u", "a"}) {
    if (!found && QuantityOf(signal) == Quantity::kPressure &&
        plain.size() > suffix.size() &&
        SameName(std::string_view(plain).substr(plain.size() - suffix.size()),
                 suffix)) {
      plain.resize(plain.size() - suffix.size());
      found = find();
      if (found && suffix.front() != 'a') {
        found->offset += kAtmosphereKpa;
      }
    }
  }
  return found;
}

// The digits end before the first character that no number has; the blanks that
// group thousands have several bytes, whose first ones others share.
std::pair<std::string_view, std::string_view> SplitUnit(std::string_view cell) {
  const std::size_t other =
      cell.find_first_not_of("+-0123456789.,' \xC2\xA0\xE2\x80\xAF");
  const std::size_t last = cell.find_last_of("0123456789", other);
  if (last == std::string_view::npos) {
    return {{}, cell};
  }
  const std::string_view unit = cell.substr(last + 1);
  return {cell.substr(0, last + 1),
          unit.substr(std::min(unit.size(), unit.find_first_not_of(' ')))};
}

bool IsUnit(std::string_view name) {
  if (SameName(name, "mA")) {
    return true;  // For any signal, over a span.
  }
  for (std::size_t i = 0; i < kModelSignalCount; ++i) {
    if (FindUnit(static_cast<Signal>(i), name)) {
      return true;
    }
  }
  return false;
}

bool IsGasUnit(std::string_view name) {
  return NormalVolume(name).has_value();
}

void CheckGasFlow(const ColumnMap& map, double molar_mass_kg_kmol) {
  if (!map.gas_flow) {
    return;
  }
  const GasFlow& gas = *map.gas_flow;
  if (molar_mass_kg_kmol == 0.0) {
    throw ConfigError(
        "F is mapped in " + gas.unit +
        ", a flow of gas at standard conditions, and the valve's medium is a "
        "liquid. Likeliest: the unit is m3/h, or the valve needs the --type of "
        "its gas or steam (fdi-store types; docs/model.md)");
  }
  constexpr double kAlike = 0.02;
  if (std::abs(gas.molar_mass_kg_kmol / molar_mass_kg_kmol - 1.0) > kAlike) {
    throw ConfigError(
        "F is mapped in " + gas.unit + " with molar_mass = " +
        NumberText(gas.molar_mass_kg_kmol) + ", and the valve's medium has " +
        NumberText(molar_mass_kg_kmol) + " kg/kmol: state the same in both");
  }
}

std::string UnitNames(Signal signal) {
  std::string names;
  for (const UnitEntry& unit : kSignalUnits) {
    if (unit.quantity == QuantityOf(signal)) {
      names += " " + std::string(unit.name);
    }
  }
  switch (QuantityOf(signal)) {
    case Quantity::kPressure:
      return names + " and these with g for gauge (barg)";
    case Quantity::kPercent:
      return names + " mA";
    default:
      return names;
  }
}

//     resampling = period [":" ("hold" / "linear") [":" age]]
Resampling ParseResampling(const std::string& text) {
  const auto parts = CLI::detail::split(text, ':');
  try {
    Resampling how;
    how.period_s = static_cast<double>(ParseDuration(parts.at(0))) / 1e9;
    how.limit_s = parts.size() > 2
                      ? static_cast<double>(ParseDuration(parts[2])) / 1e9
                      : 10.0 * how.period_s;
    const std::string filling = parts.size() > 1 ? parts[1] : "hold";
    how.linear = filling == "linear";
    if ((how.linear || filling == "hold") && parts.size() <= 3 &&
        how.period_s >= 1e-3) {
      return how;
    }
  } catch (const ConfigError&) {
  }
  throw ConfigError("--resample '" + text +
                    "': accepted are 1s, 1s:hold, 1s:linear and these with a "
                    "limit on age, 1s:linear:2min");
}

namespace {

ColumnMap MapOf(TomlReader file) {
  ColumnMap map;
  if (auto table = file.Table("file")) {
    ReadFile(std::move(*table), map);
  }
  if (auto time = file.Table("time")) {
    ReadTime(std::move(*time), map);
  }
  if (auto table = file.Table("mode")) {
    map.mode_column = table->Text("column").value_or("");
    for (const auto& [key, mode] : {std::pair("auto", ValveMode::kAuto),
                                    std::pair("manual", ValveMode::kManual)}) {
      for (const std::string& word : table->Texts(key)) {
        map.mode_words[word] = mode;
      }
    }
  }
  if (auto table = file.Table("long")) {
    LongTable& tall = map.long_table.emplace();
    tall.tag = table->Text("tag").value_or(tall.tag);
    tall.value = table->Text("value").value_or(tall.value);
    tall.quality = table->Text("quality").value_or("");
    map.quality.good = table->Texts("good");
  }
  if (auto table = file.Table("quality")) {
    for (std::string& good : table->Texts("good")) {
      map.quality.good.push_back(std::move(good));
    }
    map.quality.uncertain = table->Texts("uncertain");
    map.quality.bad = table->Texts("bad");
  }
  // The keys of [signal] are data, so they are not known to the reader in
  // advance: each is checked here, and Table() marks it as known for Finish().
  if (auto signals = file.Table("signal")) {
    for (const std::string& name : signals->Keys()) {
      const auto signal = ParseSignal(name);
      if (!signal) {
        signals->Refuse(name,
                        "unknown signal; there are CV P1 P2 T1 X F SP CVI Ps "
                        "Pz PV");
      }
      ReadSignal(*signal, *signals->Table(name), map);
    }
  }
  file.Finish();
  return map;
}

}  // namespace

ColumnMap ReadTagMap(const std::filesystem::path& path) {
  return MapOf(TomlReader(path));
}

ColumnMap ReadTagMapText(std::string_view text, const std::string& name) {
  return MapOf(TomlReader(text, name));
}

void TableOptions::AddTo(CLI::App& verb) {
  verb.add_option("--map", map,
                  "Names, units, spans and senses of the columns of a file "
                  "(made by fdi-store runs sniff; docs/import.md)")
      ->type_name("FILE.toml");
  verb.add_option("--zone", zone,
                  "Time zone of times in a file that name none: "
                  "Europe/Warsaw, UTC, +01:00 (default: the machine's)")
      ->type_name("ZONE");
  verb.add_option("--resample", resample,
                  "Bring a file of any timing to this period; missing values "
                  "are held or interpolated for at most AGE (default: hold, "
                  "ten periods)")
      ->type_name("1s[:hold|linear[:AGE]]");
}

// For the zone: the option, then the file, then UTC if `utc`. A zone in the
// file is part of what is known about it, so `utc` does not override it.
ColumnMap TableOptions::Read(bool utc) const {
  ColumnMap columns = map.empty() ? ColumnMap{} : ReadTagMap(map);
  if (!zone.empty()) {
    columns.zone = zone;
  } else if (utc && columns.zone.empty()) {
    columns.zone = "UTC";
  }
  if (!resample.empty()) {
    columns.resampling = ParseResampling(resample);
  }
  return columns;
}

}  // namespace fdi::importer
