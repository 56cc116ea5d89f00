#pragma once

#include <string_view>

namespace fdi::simulator {

/// @throws ConfigError "`field` is `value`: expected `low` <= `field` <=
///   `high`" unless value is in [low, high].
void RequireRange(std::string_view field, double value, double low,
                  double high);

/// @throws ConfigError unless `value` is finite and above 0.
void RequirePositive(std::string_view field, double value);

}  // namespace fdi::simulator
