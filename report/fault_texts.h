#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/loop/valve_counters.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/severity.h"
#include "report/global_options.h"
#include "report/json_output.h"

namespace fdi::report {

/// Who is responsible.
enum class Discipline : std::uint8_t {
  kOperator,
  kInstrument,
  kAir,
  kMechanical
};
/// Status signals of NAMUR NE 107, the most severe last.
enum class NamurClass : std::uint8_t {
  kMaintenanceRequired,
  kOutOfSpecification,
  kCheckFunction,
  kFailure
};

std::string_view DisciplineName(Discipline discipline);  ///< "air", ...
std::string_view NamurName(NamurClass namur);            ///< "failure", ...
/// The same; "good" for nothing.
std::string_view StatusName(std::optional<NamurClass> status);

/// Texts about a fault for operators and planners.
struct FaultText {
  std::string name;   ///< "Flow transmitter wrong"
  std::string check;  ///< Tells it from similar faults in the field.
  Discipline discipline{Discipline::kInstrument};
  NamurClass namur{NamurClass::kCheckFunction};
  SeverityBands bands;
};

/// A figure that is counted for a valve (loop::Figure), and the value at which
/// the valve needs attention.
struct FigureText {
  std::string name;
  std::string unit;  ///< "% of travel"; empty: none.
  std::string check;
  Discipline discipline{Discipline::kInstrument};
  NamurClass namur{NamurClass::kMaintenanceRequired};
  /// Accepted values: up to the highest, and from the lowest on. Nothing: no
  /// limit.
  std::optional<double> lowest;
  std::optional<double> highest;

  bool Exceeded(double value) const {
    return (lowest && value < *lowest) || (highest && value > *highest);
  }
};

/// A diagnosis in plain words. For faults that cannot be distinguished, the
/// names are joined by " or ", and the most severe of the other values are
/// used.
struct FaultWords {
  std::string name;
  std::string check;       ///< For the first fault.
  std::string discipline;  ///< Distinct ones, joined by "|".
  NamurClass namur{NamurClass::kMaintenanceRequired};
  Severity severity{Severity::kLow};
};

/// The fault catalogue: a text for every fault and for faults unlike any of
/// them. A TOML file with one table per fault, [f1]..[x1] and [unknown], and
/// the keys name, check, discipline, namur and severity; and one per figure,
/// [figure.dead_band] and so on, with unit, lowest and highest instead of
/// severity.
/// See monitor/catalogue/faults.toml.
class FaultTexts {
 public:
  /// Reads the whole catalogue from `path`.
  /// @throws ConfigError for a missing, unknown or invalid key; NotFoundError.
  explicit FaultTexts(const std::filesystem::path& path);

  /// Replaces the keys that `path` contains; rejects unknown faults and keys.
  /// @throws as the constructor.
  void Override(const std::filesystem::path& path);

  /// @param fault or finding of the catalogue; 0 means unknown.
  const FaultText& Of(int fault) const;
  const FigureText& Of(loop::Figure figure) const {
    return figures_[static_cast<std::size_t>(figure)];
  }

  /// @param answer as in fault_history: "f19", "f3|f6", "unknown", or empty;
  ///   other names count as unknown.
  /// @param strength estimated; the sign is ignored.
  /// @param priority of the alarm as it is stored, which tells the severity;
  ///   nothing: that of the gravest fault at `strength`.
  FaultWords Words(std::string_view answer, double strength,
                   std::optional<std::int64_t> priority = {}) const;

  /// The name of every fault, finding and "unknown", by what the view
  /// fault_history calls it.
  std::map<std::string, std::string> Names() const;

  /// The bands from which the monitor tells how bad a fault is.
  SeverityCatalogue Severities() const;

 private:
  std::map<int, FaultText> texts_;  // [0]: unknown
  std::array<FigureText, loop::kFigureCount> figures_;
};

/// The catalogue installed with the programs, overridden by DATA/faults.toml if
/// it exists.
FaultTexts LoadFaultTexts(const GlobalOptions& options);

/// {"faults": [{"fault", "name", "check", "discipline", "namur", "severity":
/// [{"from", "level"}], "label"}], "figures": [{"figure", "name", "check",
/// "discipline", "namur", "lowest", "highest"}]}, unknown last. An episode can
/// be labelled with a fault, and not with a finding, which does not tell the
/// cause.
Json FaultTextsJson(const FaultTexts& texts);

}  // namespace fdi::report
