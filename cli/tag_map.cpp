#include "cli/tag_map.h"

#include <string>
#include <string_view>

#include "cli/toml_reader.h"
#include "diagnosis/error.h"

namespace fdi::cli {
namespace {

/// Quantities that share their units.
enum class Quantity { kPercent, kPressure, kTemperature, kFlow, kNumber };

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
  }
  return Quantity::kNumber;
}

/// value = offset + scale · reading in the unit
struct UnitEntry {
  std::string_view name;
  Quantity quantity;
  double scale;
  double offset;
  FlowUnit flow_unit;
};

constexpr FlowUnit kVolume = FlowUnit::kM3PerHour;
constexpr FlowUnit kMass = FlowUnit::kTPerHour;
constexpr UnitEntry kUnits[] = {
    {"%", Quantity::kPercent, 1.0, 0.0, kVolume},
    {"1", Quantity::kPercent, 100.0, 0.0, kVolume},
    {"kPa", Quantity::kPressure, 1.0, 0.0, kVolume},
    {"Pa", Quantity::kPressure, 1e-3, 0.0, kVolume},
    {"bar", Quantity::kPressure, 100.0, 0.0, kVolume},
    {"MPa", Quantity::kPressure, 1000.0, 0.0, kVolume},
    {"degC", Quantity::kTemperature, 1.0, 0.0, kVolume},
    {"K", Quantity::kTemperature, 1.0, -273.15, kVolume},
    {"m3/h", Quantity::kFlow, 1.0, 0.0, kVolume},
    {"m3/s", Quantity::kFlow, 3600.0, 0.0, kVolume},
    {"l/min", Quantity::kFlow, 0.06, 0.0, kVolume},
    {"t/h", Quantity::kFlow, 1.0, 0.0, kMass},
    {"kg/h", Quantity::kFlow, 1e-3, 0.0, kMass},
    {"kg/s", Quantity::kFlow, 3.6, 0.0, kMass},
    {"1", Quantity::kNumber, 1.0, 0.0, kVolume},
};

const UnitEntry& RequireUnit(const TomlReader& table, std::string_view name,
                             Quantity quantity) {
  std::string accepted;
  for (const UnitEntry& unit : kUnits) {
    if (unit.quantity == quantity) {
      if (unit.name == name) {
        return unit;
      }
      accepted += " " + std::string(unit.name);
    }
  }
  table.Refuse("unit", "unknown unit '" + std::string(name) +
                           "'; accepted are" + accepted);
}

Sense ReadSense(TomlReader& table) {
  const std::string sense = table.Text("sense").value_or("closing");
  if (sense != "closing" && sense != "opening") {
    table.Refuse("sense", "'" + sense + "' is neither closing nor opening");
  }
  return sense == "opening" ? Sense::kOpening : Sense::kClosing;
}

void ReadSignal(Signal signal, TomlReader table, ColumnMap& map) {
  const Quantity quantity = QuantityOf(signal);
  ColumnMapping mapping;
  mapping.signal = signal;
  const auto column = table.Text("column");
  if (!column) {
    table.Refuse("column", "is missing: the name in the header of the table");
  }
  mapping.column = *column;
  // A flow is measured as volume or as mass, and only the file's author knows.
  const auto unit_name = table.Text("unit");
  const UnitEntry& unit =
      RequireUnit(table,
                  unit_name.value_or(quantity == Quantity::kFlow ? ""
                                     : quantity == Quantity::kNumber
                                         ? "1"
                                         : std::string(SignalUnit(signal))),
                  quantity);
  const double scale = table.Number("scale").value_or(1.0);
  const double offset = table.Number("offset").value_or(0.0);
  // The user's line comes first, then the unit:
  // value = u₀ + u₁ (offset + scale · cell).
  mapping.scale = unit.scale * scale;
  mapping.offset = unit.offset + unit.scale * offset;
  mapping.sense = ReadSense(table);
  if (quantity == Quantity::kFlow) {
    map.flow_unit = unit.flow_unit;
  }
  if (quantity != Quantity::kPercent && mapping.sense == Sense::kOpening) {
    table.Refuse("sense", "only CV, X and SP count in % of closing or opening");
  }
  map.columns.push_back(mapping);
}

void ReadTime(TomlReader table, ColumnMap& map) {
  map.time_column = table.Text("column").value_or(map.time_column);
  const std::string unit = table.Text("unit").value_or("s");
  if (unit == "ms") {
    map.time_scale = 1e-3;
  } else if (unit == "min") {
    map.time_scale = 60.0;
  } else if (unit == "h") {
    map.time_scale = 3600.0;
  } else if (unit != "s") {
    table.Refuse("unit", "'" + unit + "' is none of s, ms, min, h");
  }
}

}  // namespace

ColumnMap ReadTagMap(const std::filesystem::path& path) {
  TomlReader file(path);
  ColumnMap map;
  if (auto time = file.Table("time")) {
    ReadTime(std::move(*time), map);
  }
  if (auto signals = file.Table("signal")) {
    for (const std::string& name : signals->Keys()) {
      const auto signal = ParseSignal(name);
      if (!signal) {
        signals->Refuse(name,
                        "unknown signal; there are CV P1 P2 T1 X F SP CVI Ps "
                        "Pz");
      }
      ReadSignal(*signal, *signals->Table(name), map);
    }
  }
  file.Finish();
  return map;
}

}  // namespace fdi::cli
