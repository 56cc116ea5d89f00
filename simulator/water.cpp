#include "simulator/water.h"

#include <algorithm>
#include <cmath>

namespace fdi::simulator {

double WaterDensity(double temperature_c) {
  constexpr double kCriticalTemperatureK = 647.096;
  constexpr double kCriticalDensity = 322.0;
  const double theta = std::clamp(temperature_c, 0.0, 350.0) + 273.15;
  const double tau = 1.0 - theta / kCriticalTemperatureK;
  const double third = std::cbrt(tau);
  return kCriticalDensity *
         (1.0 + 1.99274064 * third + 1.09965342 * third * third -
          0.510839303 * std::pow(third, 5) - 1.75493479 * std::pow(third, 16) -
          45.5170352 * std::pow(third, 43) -
          6.74694450e5 * std::pow(third, 110));
}

double LiquidDensity(double temperature_c) {
  constexpr double kHottestC = 110.0;
  return WaterDensity(std::min(temperature_c, kHottestC));
}

double VapourPressure(double temperature_c) {
  return std::pow(10.0, -2141.0 / (temperature_c + 273.15) + 10.7167);
}

}  // namespace fdi::simulator
