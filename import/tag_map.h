#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "import/csv.h"

namespace CLI {
class App;
}

namespace fdi::importer {

/// Reads `--map FILE.toml`: which column of a foreign table is which signal,
/// and how it is converted. docs/import.md describes the format with three
/// examples.
/// @throws ConfigError naming file, line and key; NotFoundError.
ColumnMap ReadTagMap(const std::filesystem::path& path);
/// The same for the text of a map; `name` stands for the file in messages.
ColumnMap ReadTagMapText(std::string_view text, const std::string& name);

/// Parses "1s", "1s:hold", "500ms:linear", "1s:linear:2min": the period, how to
/// fill between readings (hold), and the longest interval to fill (ten
/// periods).
/// @throws ConfigError naming the accepted forms.
Resampling ParseResampling(const std::string& text);

/// Converts a reading to the unit of its signal:
/// offset + scale · reading.
struct UnitConversion {
  double scale{1.0};
  double offset{0.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
};

/// The unit `name` of a signal: "bar", "bar g", "barg", "psi(a)", "degF",
/// "m3/h", "%", "1", ... Required for a flow. Pressures are absolute unless
/// marked as gauge.
std::optional<UnitConversion> FindUnit(Signal signal, std::string_view name);
/// All units of a signal, for messages.
std::string UnitNames(Signal signal);
/// The number and the unit of "11.1 t/h", "-3 °C"; the unit may be empty.
std::pair<std::string_view, std::string_view> SplitUnit(std::string_view cell);
/// True if `name` is a unit of some signal.
bool IsUnit(std::string_view name);
/// True if `name` is a flow of gas at standard conditions: Nm3/h, scfm, ...
bool IsGasUnit(std::string_view name);

/// True if a map that states F as a gas at standard conditions suits the medium
/// of the valve.
/// @param molar_mass_kg_kmol of the medium; 0: a liquid.
/// @throws ConfigError naming the likeliest cause.
void CheckGasFlow(const ColumnMap& map, double molar_mass_kg_kmol);

/// Options of every verb that reads tables; each overrides the map.
struct TableOptions {
  std::filesystem::path map;
  std::string zone;
  std::string resample;

  void AddTo(CLI::App& verb);
  bool given() const {
    return !map.empty() || !zone.empty() || !resample.empty();
  }
  /// Reads the map, overridden by the other options.
  /// @param utc times without a zone are UTC.
  ColumnMap Read(bool utc) const;
};

}  // namespace fdi::importer
