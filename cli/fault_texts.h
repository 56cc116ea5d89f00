#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "cli/global_options.h"
#include "cli/json_output.h"
#include "diagnosis/fault_catalogue.h"

namespace fdi::cli {

/// Who goes there.
enum class Discipline : std::uint8_t {
  kOperator,
  kInstrument,
  kAir,
  kMechanical
};
/// Status signals of NAMUR NE 107, the gravest last.
enum class NamurClass : std::uint8_t {
  kMaintenanceRequired,
  kOutOfSpecification,
  kCheckFunction,
  kFailure
};
enum class Severity : std::uint8_t { kLow, kMedium, kHigh, kCritical };

std::string_view DisciplineName(Discipline discipline);  ///< "air", ...
std::string_view NamurName(NamurClass namur);            ///< "failure", ...
std::string_view SeverityName(Severity severity);        ///< "critical", ...

/// The severity of a fault from `from` on, |strength| in 0..1.
struct SeverityBand {
  double from{0.0};
  Severity level{Severity::kMedium};
};

/// What people are told about a fault.
struct FaultText {
  std::string name;   ///< "Flow transmitter wrong"
  std::string check;  ///< How to tell it from its look-alikes in the field.
  Discipline discipline{Discipline::kInstrument};
  NamurClass namur{NamurClass::kCheckFunction};
  std::vector<SeverityBand> bands;  ///< Ascending, the first from 0.

  Severity SeverityAt(double strength) const;
};

/// An answer of the diagnosis in people's words; of a group of faults that
/// cannot be told apart the names joined by " or ", and the gravest of the
/// rest.
struct FaultWords {
  std::string name;
  std::string check;       ///< Of the fault named first.
  std::string discipline;  ///< Each once, joined by "|".
  NamurClass namur{NamurClass::kMaintenanceRequired};
  Severity severity{Severity::kLow};
};

/// The fault catalogue: a text for every fault and for what is unlike all of
/// them. A TOML file with a table per fault, [f1]..[p2] and [unknown], with the
/// keys name, check, discipline, namur and severity; see
/// monitor/catalogue/faults.toml.
class FaultTexts {
 public:
  /// Reads the whole catalogue from `path`.
  /// @throws ConfigError at what is missing, unknown or wrong; NotFoundError.
  explicit FaultTexts(const std::filesystem::path& path);

  /// Replaces the keys that `path` has. Unknown faults and keys are refused.
  /// @throws as the constructor.
  void Override(const std::filesystem::path& path);

  /// @param fault or finding of the catalogue, 0 stands for unknown.
  const FaultText& Of(int fault) const;

  /// @param answer as in fault_history: "f19", "f3|f6", "unknown", empty or
  ///   what no catalogue knows (both as unknown).
  /// @param strength estimated, of either sign.
  FaultWords Words(std::string_view answer, double strength) const;

 private:
  std::map<int, FaultText> texts_;  // [0]: unknown
};

/// The catalogue that was installed with the programs, then DATA/faults.toml if
/// it is there, then --fault-catalogue, each on top of the one before.
FaultTexts LoadFaultTexts(const GlobalOptions& options);

/// {"faults": [{"fault", "name", "check", "discipline", "namur", "severity":
/// [{"from", "level"}]}]}, unknown last.
Json FaultTextsJson(const FaultTexts& texts);

}  // namespace fdi::cli
