#pragma once

#include <optional>
#include <string>

namespace fdi {

/// Who a valve is in the words of the plant. Empty texts are not stated.
struct ValveIdentity {
  std::optional<int> grade{};  ///< 1 (the plant depends on it most) to 3.
  std::string service{};       ///< F, P, L, T or A: what its loop controls.
  std::string description{};   ///< "Feed to column C-101"
  std::string location{};      ///< "Hall 2, level 3"
  std::string document{};      ///< Address or number of its data sheet.
  std::string costs{};         ///< As ParseCosts() reads it.

  bool operator==(const ValveIdentity&) const = default;
};

}  // namespace fdi
