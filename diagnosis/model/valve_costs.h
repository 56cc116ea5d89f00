#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "diagnosis/model/sample.h"

namespace fdi {

/// Costs of waiting and of work at a valve. A missing figure is not known.
struct ValveCosts {
  std::string currency{};              ///< "EUR"; of all figures.
  std::optional<double> medium{};      ///< For one t or m3 of what flows.
  FlowUnit flow{FlowUnit::kTPerHour};  ///< The unit of F that it fits.
  std::optional<double> downtime{};    ///< For an hour.
  std::optional<double> visit{};
};

/// Parses "12.5 EUR/t, 4000 EUR/h, 350 EUR". The unit says what a figure is of:
/// /t or /m3 of the medium, /h of downtime, none of a visit. Empty: no figure.
/// @throws ConfigError naming the figure that is wrong, and what is accepted.
ValveCosts ParseCosts(std::string_view text);

}  // namespace fdi
