#include "simulator/valve_equations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

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

void FlowConversion::Apply(Sample& sample) {
  if (sample.Has(Signal::kT1)) {
    temperature_c_ = sample[Signal::kT1];
  }
  const double t_per_m3 = LiquidDensity(temperature_c_) / 1000.0;
  if (sample.flow_unit != to_) {
    sample.values[Index(Signal::kF)] *=
        to_ == FlowUnit::kTPerHour ? t_per_m3 : 1.0 / t_per_m3;
    sample.flow_unit = to_;
  }
}

double VapourPressure(double temperature_c) {
  return std::pow(10.0, -2141.0 / (temperature_c + 273.15) + 10.7167);
}

namespace {

constexpr double kRegularPa = 1e3;

// sqrt(d), odd and with a finite slope at 0: inside +-epsilon a cubic that
// matches value and slope of the root at its ends.
double SignedRoot(double d, double epsilon) {
  const double q = d / epsilon;
  if (std::abs(q) >= 1.0) {
    return std::copysign(std::sqrt(std::abs(d)), d);
  }
  return std::sqrt(epsilon) * q * (1.25 - 0.25 * q * q);
}

// Linear interpolation in a table, constant beyond its ends.
template <std::size_t N>
double Interpolate(const std::array<double, N>& x,
                   const std::array<double, N>& y, double at) {
  if (!(at > x.front())) {
    return y.front();
  }
  for (std::size_t i = 1; i < N; ++i) {
    if (at <= x[i]) {
      return y[i - 1] + (y[i] - y[i - 1]) * (at - x[i - 1]) / (x[i] - x[i - 1]);
    }
  }
  return y.back();
}

constexpr std::array<double, 11> kTenths{0.0, 0.1, 0.2, 0.3, 0.4, 0.5,
                                         0.6, 0.7, 0.8, 0.9, 1.0};

}  // namespace

double Opening(const TrimParameters& trim, double closing) {
  const double x = std::clamp(closing, 0.0, 1.0);
  if (trim.characteristic == FlowCharacteristic::kLinear) {
    return 1.0 - x;
  }
  constexpr double kSeat = 0.975;
  if (x <= kSeat) {
    return std::exp(-trim.exponent * x);
  }
  return std::exp(-trim.exponent * kSeat) * (1.0 - x) / (1.0 - kSeat);
}

double RecoveryCoefficient(double closing) {
  constexpr std::array<double, 10> kKm{1.00,  0.95, 0.90, 0.85,  0.785,
                                       0.725, 0.67, 0.61, 0.555, 0.50};
  const double x = std::clamp(closing, 0.0, 1.0) * 10.0;
  if (x >= 9.0) {
    return x < 9.9 ? 0.50 - 0.05 * (x - 9.0) / 0.9
                   : 0.45 - 0.05 * (x - 9.9) / 0.1;
  }
  const auto i = static_cast<std::size_t>(x);
  return kKm[i] + (kKm[i + 1] - kKm[i]) * (x - static_cast<double>(i));
}

double BypassRecoveryCoefficient(double closing) {
  constexpr std::array<double, 11> kKm{0.45,  0.50, 0.555, 0.61, 0.67, 0.725,
                                       0.785, 0.85, 0.90,  0.95, 1.00};
  return Interpolate(kTenths, kKm, closing);
}

double CriticalPressureRatio(double inlet_pressure_pa) {
  constexpr std::array<double, 7> kPressure{
      0.0, 1723763.0, 3447527.0, 6895055.0, 13790111.0, 17237639.0, 20685166.0};
  constexpr std::array<double, 7> kRatio{0.94, 0.87,  0.84, 0.79,
                                         0.75, 0.725, 0.685};
  return Interpolate(kPressure, kRatio, inlet_pressure_pa);
}

MediumState MediumAt(double inlet_pressure_pa, double outlet_pressure_pa,
                     double temperature_c) {
  const double vapour = VapourPressure(temperature_c);
  return {std::max(inlet_pressure_pa, vapour), outlet_pressure_pa, vapour,
          LiquidDensity(temperature_c)};
}

double EffectivePressureDrop(const MediumState& medium, double recovery) {
  const double ratio = CriticalPressureRatio(medium.inlet_pressure_pa);
  const double limit =
      recovery * (medium.inlet_pressure_pa - ratio * medium.vapour_pressure_pa);
  return std::min(medium.inlet_pressure_pa - medium.outlet_pressure_pa,
                  std::max(0.0, limit));
}

double Flow(double kv_m3_h, double opening, double pressure_drop_pa,
            double density_kg_m3) {
  constexpr double kPaPerMpa = 1e6;
  return 100.0 * kv_m3_h * opening * SignedRoot(pressure_drop_pa, kRegularPa) /
         std::sqrt(kPaPerMpa * density_kg_m3);
}

double FlowForce(double pressure_drop_pa, double plug_area_m2,
                 double recovery) {
  return pressure_drop_pa / recovery * plug_area_m2;
}

double ChamberPressure(const ActuatorParameters& actuator, double charge,
                       double position_m) {
  return actuator.ambient_pressure_pa * actuator.chamber_volume_m3 *
         (1.0 + charge) /
         (actuator.chamber_volume_m3 + actuator.diaphragm_area_m2 * position_m);
}

double AirFlow(double from_pa, double to_pa) {
  if (from_pa < to_pa) {
    return -AirFlow(to_pa, from_pa);
  }
  if (2.0 * to_pa < from_pa) {
    return 2.065e-6 * from_pa;
  }
  return 4.13e-6 * SignedRoot(from_pa - to_pa, kRegularPa) * std::sqrt(to_pa);
}

double OrificeAirFlow(double from_pa, double to_pa) {
  return SignedRoot(from_pa - to_pa, kRegularPa);
}

double TransducerOutput(double signal) {
  constexpr std::array<double, 6> kIn{-1.0, -0.94, -0.54, 0.46, 0.86, 1.0};
  constexpr std::array<double, 6> kOut{-0.55, -0.55, -0.02, 0.02, 1.0, 1.0};
  return Interpolate(kIn, kOut, signal);
}

double LeverPosition(double angle) {
  return 0.5 + std::sin(std::numbers::pi / 3.0 * (angle - 0.5));
}

double LeverAngle(double closing) {
  const double sine = std::clamp(closing - 0.5, -1.0, 1.0);
  return 0.5 + std::asin(sine) * 3.0 / std::numbers::pi;
}

}  // namespace fdi::simulator
