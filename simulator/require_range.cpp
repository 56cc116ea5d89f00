#include "simulator/require_range.h"

#include <cmath>
#include <sstream>

#include "base/error.h"

namespace fdi::simulator {

void RequireRange(std::string_view field, double value, double low,
                  double high) {
  if (value >= low && value <= high) {
    return;
  }
  std::ostringstream message;
  message << field << " is " << value << ": expected " << low << " to " << high;
  throw ConfigError(message.str());
}

void RequirePositive(std::string_view field, double value) {
  if (value > 0.0 && std::isfinite(value)) {
    return;
  }
  std::ostringstream message;
  message << field << " is " << value << ": expected a value above 0";
  throw ConfigError(message.str());
}

}  // namespace fdi::simulator
