#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "cli/csv.h"

namespace CLI {
class App;
}

namespace fdi::cli {

/// Reads `--map FILE.toml`: where each signal stands in a foreign table and how
/// it is converted. docs/import.md has the format with three examples.
/// @throws ConfigError naming file, line and key; NotFoundError.
ColumnMap ReadTagMap(const std::filesystem::path& path);

/// "1s", "1s:hold", "500ms:linear", "1s:linear:2min": the period, what is done
/// between readings (hold), and for how long at most (ten periods).
/// @throws ConfigError naming the accepted forms.
Resampling ParseResampling(const std::string& text);

/// How a reading in some unit becomes one in the unit of its signal:
/// offset + scale · reading.
struct UnitConversion {
  double scale{1.0};
  double offset{0.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
};

/// The unit called `name` of a signal: "bar", "bar g", "barg", "psi(a)",
/// "degF", "m3/h", "%", "1", ... A flow needs one. Pressures are absolute
/// unless they say that they are gauge.
std::optional<UnitConversion> FindUnit(Signal signal, std::string_view name);
/// All units of a signal, for messages.
std::string UnitNames(Signal signal);

/// The options of every verb that reads tables: --map, --zone, --resample.
struct TableOptions {
  std::filesystem::path map;
  std::string zone;
  std::string resample;

  void AddTo(CLI::App& verb);
  bool given() const {
    return !map.empty() || !zone.empty() || !resample.empty();
  }
  /// The map with what the other options say instead.
  /// @param utc times that do not say their zone are UTC.
  ColumnMap Read(bool utc) const;
};

}  // namespace fdi::cli
