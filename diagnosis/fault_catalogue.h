#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace fdi {

/// The nineteen actuator faults of the DAMADICS benchmark, numbered 1..19.
inline constexpr int kFaultCount = 19;

struct FaultFacts {
  std::string_view name;         ///< "f1".
  std::string_view description;  ///< "valve clogging".
  std::string_view paper_name;   ///< "F1".."F5", or empty.
  bool is_signed;                ///< Strength in [-1, 1], else in [0, 1].
};

/// @throws std::invalid_argument if `fault` is not in 1..19.
const FaultFacts& FaultFactsOf(int fault);

/// "f19"; "normal" for 0; "unknown" for anything else.
std::string FaultName(int fault);

/// The fault called `name`: f1..f19 in any case, or paper1..paper5 for the
/// five faults of [Mendonça et al., 2009] (f1 f3 f6 f7 f19).
std::optional<int> ParseFault(std::string_view name);

/// As ParseFault(). @throws ConfigError naming the accepted names.
int RequireFault(std::string_view name);

}  // namespace fdi
