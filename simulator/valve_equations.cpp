#include "simulator/valve_equations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <string>

#include "base/error.h"

// Numbers of equations are those of docs/model.md, which has the sources and
// the departures from them. Tables without a source here are the benchmark's.
namespace fdi::simulator {
double WaterDensity(double temperature_c) {
  constexpr double kCriticalTemperatureK = 647.096;
  constexpr double kCriticalDensity = 322.0;
  const double theta = std::clamp(temperature_c, 0.0, 350.0) + 273.15;
  // The density of the saturated liquid in powers of the cube root of tau. The
  // line ends before the critical point, where its slope is infinite.
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

double FlowInUnit(FlowUnit unit, double flow_m3_h, double density_kg_m3) {
  return unit == FlowUnit::kTPerHour ? flow_m3_h * (density_kg_m3 / 1000.0)
                                     : flow_m3_h;
}

double FlowFromUnit(FlowUnit unit, double flow, double density_kg_m3) {
  return unit == FlowUnit::kTPerHour ? flow * (1.0 / (density_kg_m3 / 1000.0))
                                     : flow;
}

// The sample's own T1 and P1 come first, so that its flow is converted at its
// own state; where it has none, at the last known.
void FlowConversion::Apply(Sample& sample) {
  if (sample.Has(Signal::kT1)) {
    to_.t1_degc = sample[Signal::kT1];
  }
  if (sample.Has(Signal::kP1)) {
    to_.p1_kpa = sample[Signal::kP1];
  }
  if (sample.flow_unit != to_.unit) {
    if (to_.medium.is_gas() && to_.p1_kpa <= 0.0) {
      throw DataError(
          "F is in " + std::string(FlowUnitName(sample.flow_unit)) +
          ", the valve's in " + std::string(FlowUnitName(to_.unit)) +
          ": m3/h of a gas become t/h by its density, which needs P1 (kPa "
          "absolute) in the record. If they are m3/h at standard conditions, "
          "map them as Nm3/h");
    }
    const double density =
        MediumAt(to_.medium, 1e3 * to_.p1_kpa, 0.0, to_.t1_degc).density_kg_m3;
    double& flow = sample.values[Index(Signal::kF)];
    flow = FlowInUnit(to_.unit, FlowFromUnit(sample.flow_unit, flow, density),
                      density);
    sample.flow_unit = to_.unit;
  }
}

double VapourPressure(double temperature_c) {
  return std::pow(10.0, -2141.0 / (temperature_c + 273.15) + 10.7167);
}

namespace {

// The root of (12) and (16) has an infinite slope at 0, where a flow turns
// round. An implicit integrator needs a finite one for its Jacobian.
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
double Interpolate(std::span<const double> x, std::span<const double> y,
                   double at) {
  if (!(at > x.front())) {
    return y.front();
  }
  for (std::size_t i = 1; i < x.size(); ++i) {
    if (at <= x[i]) {
      return y[i - 1] + (y[i] - y[i - 1]) * (at - x[i - 1]) / (x[i] - x[i - 1]);
    }
  }
  return y.back();
}

// From the shut valve, whose f is `leakage`, linearly to the first point.
double InTable(std::span<const double> h, std::span<const double> f,
               double leakage, double at) {
  return at < h.front() ? leakage + (f.front() - leakage) * at / h.front()
                        : Interpolate(h, f, at);
}

constexpr std::array<double, 11> kTenths{0.0, 0.1, 0.2, 0.3, 0.4, 0.5,
                                         0.6, 0.7, 0.8, 0.9, 1.0};

}  // namespace

double SaturationTemperature(double pressure_pa) {
  // n1 to n10 of the release; beta, E, F, G and D are its names, too.
  constexpr std::array kN{1167.0521452767,  -724213.16703206, -17.073846940092,
                          12020.82470247,   -3232555.0322333, 14.91510861353,
                          -4823.2657361591, 405113.40542057,  -0.23855557567849,
                          650.17534844798};
  const double beta =
      std::pow(std::clamp(1e-6 * pressure_pa, 6e-4, 22.0), 0.25);
  const double e = beta * beta + kN[2] * beta + kN[5];
  const double f = kN[0] * beta * beta + kN[3] * beta + kN[6];
  const double g = kN[1] * beta * beta + kN[4] * beta + kN[7];
  const double d = 2.0 * g / (-f - std::sqrt(f * f - 4.0 * e * g));
  const double sum = kN[9] + d;
  return 0.5 * (sum - std::sqrt(sum * sum - 4.0 * (kN[8] + kN[9] * d))) -
         273.15;
}

double SteamDensity(double pressure_pa, double temperature_c) {
  constexpr double kMaxPressureMpa = 12.0;  // The line ends there.
  const double p = std::clamp(1e-6 * pressure_pa, 1e-3, kMaxPressureMpa);
  const double t =
      std::max(temperature_c, SaturationTemperature(1e6 * p)) + 273.15;
  const double hot = 647.096 / t;
  const double v =
      0.461526e-3 * t / p - 1e-3 * (4.743 * std::pow(hot, 2.961) +
                                    0.006238 * p * p * std::pow(hot, 13.364));
  return 1.0 / v;
}

double Opening(const Trim& trim, double closing) {
  // The quick-opening points of a maker's handbook.
  constexpr std::array kOpenings{0.0458, 0.1076, 0.2023, 0.2892, 0.4219,
                                 0.5332, 0.7034, 0.8441, 1.0};
  constexpr std::array kQuick{0.166, 0.394, 0.723, 0.825, 0.881,
                              0.909, 0.940, 0.968, 1.0};
  const double x = std::clamp(closing, 0.0, 1.0);
  switch (trim.characteristic) {
    case FlowCharacteristic::kLinear:
      return trim.leakage + (1.0 - trim.leakage) * (1.0 - x);
    case FlowCharacteristic::kQuickOpening:
      return InTable(kOpenings, kQuick, trim.leakage, 1.0 - x);
    case FlowCharacteristic::kTable:
      return InTable(trim.table_h, trim.table_f, trim.leakage, 1.0 - x);
    case FlowCharacteristic::kExponential:
      break;
  }
  const auto curve = [&trim](double at) {
    return std::max(trim.leakage, std::exp(-trim.exponent * at));
  };
  // An equal percentage trim never shuts by its own formula: from `shut_off`
  // on, a straight line leads to the leakage.
  if (x <= trim.shut_off) {
    return curve(x);
  }
  return trim.leakage + (curve(trim.shut_off) - trim.leakage) * (1.0 - x) /
                            (1.0 - trim.shut_off);
}

double RecoveryCoefficient(const Trim& trim, double closing) {
  if (trim.liquid_recovery > 0.0) {
    return trim.liquid_recovery * trim.liquid_recovery;
  }
  constexpr std::array<double, 10> kKm{1.00,  0.95, 0.90, 0.85,  0.785,
                                       0.725, 0.67, 0.61, 0.555, 0.50};
  const double x = std::clamp(closing, 0.0, 1.0) * 10.0;
  // The last tenth of the travel has one point more, at 0.99.
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

double MolarMass(const Medium& medium) {
  constexpr double kWaterKgKmol = 18.015;
  return medium.fluid == Fluid::kGas     ? medium.molar_mass_kg_kmol
         : medium.fluid == Fluid::kSteam ? kWaterKgKmol
                                         : 0.0;
}

double VapourPressure(const Medium& medium, double temperature_c) {
  switch (medium.fluid) {
    case Fluid::kWater:
      return VapourPressure(temperature_c);
    case Fluid::kLiquid:
      return 1e3 * medium.vapour_pressure_kpa;
    default:
      return 0.0;
  }
}

MediumState MediumAt(const Medium& medium, double inlet_pressure_pa,
                     double outlet_pressure_pa, double temperature_c) {
  // P2 is passed on unlimited: the force on the plug is that of the whole drop,
  // and only the flow is limited by choking (EffectivePressureDrop).
  constexpr double kMolarGasConstant = 8314.0;  // J/(kmol K)
  constexpr double kAirExponent = 1.40;         // gamma that x_T is stated for
  constexpr double kSteamExponent = 1.30;       // 1.28..1.30 at 0.5..10 MPa
  constexpr double kN6 = 3.16;  // of the standard, for kPa and kg/h
  const double vapour = VapourPressure(medium, temperature_c);
  constexpr double kVacuumPa = 1.0;  // a gas without pressure has no density
  const double inlet = std::max({inlet_pressure_pa, vapour, kVacuumPa});
  MediumState state{inlet, outlet_pressure_pa, vapour, 0.0, 0.0, 0.0, 1.0};
  switch (medium.fluid) {
    case Fluid::kWater:
      state.density_kg_m3 = LiquidDensity(temperature_c);
      state.critical_ratio = CriticalPressureRatio(inlet);
      break;
    case Fluid::kLiquid:
      state.density_kg_m3 = medium.density_kg_m3;
      state.critical_ratio =
          0.96 - 0.28 * std::sqrt(medium.vapour_pressure_kpa /
                                  medium.critical_pressure_kpa);
      break;
    case Fluid::kGas:
      state.density_kg_m3 = inlet * medium.molar_mass_kg_kmol /
                            (medium.compressibility * kMolarGasConstant *
                             (temperature_c + 273.15));
      state.gas_factor = medium.isentropic_exponent / kAirExponent;
      break;
    case Fluid::kSteam:
      state.density_kg_m3 = SteamDensity(inlet, temperature_c);
      state.gas_factor = kSteamExponent / kAirExponent;
      state.rounding = kN6 * kN6 / 10.0;
      break;
  }
  return state;
}

double EffectivePressureDrop(const MediumState& medium, double recovery,
                             double choked_pressure_ratio) {
  const double drop = medium.inlet_pressure_pa - medium.outlet_pressure_pa;
  if (medium.gas_factor > 0.0) {
    // A choked gas stays at x = `most` and Y = 2/3, whatever P2 is. A reversed
    // gas does not flow, whereas a reversed liquid does, below.
    const double most = medium.gas_factor * choked_pressure_ratio;
    const double x = std::clamp(drop / medium.inlet_pressure_pa, 0.0, most);
    const double expansion = 1.0 - x / (3.0 * most);
    return medium.rounding * expansion * expansion * x *
           medium.inlet_pressure_pa;
  }
  const double limit =
      recovery * (medium.inlet_pressure_pa -
                  medium.critical_ratio * medium.vapour_pressure_pa);
  return std::min(drop, std::max(0.0, limit));
}

double Flow(double kv_m3_h, double opening, double pressure_drop_pa,
            double density_kg_m3) {
  constexpr double kPaPerMpa = 1e6;
  return 100.0 * kv_m3_h * opening * SignedRoot(pressure_drop_pa, kRegularPa) /
         std::sqrt(kPaPerMpa * density_kg_m3);
}

double CapacityFor(double flow_m3_h, const Trim& trim,
                   const MediumState& medium, double closing) {
  constexpr double kMinDropPa = 1e4;
  const double drop = EffectivePressureDrop(
      medium, RecoveryCoefficient(trim, closing), trim.choked_pressure_ratio);
  return drop < kMinDropPa
             ? 0.0
             : flow_m3_h / Flow(1.0, 1.0, drop, medium.density_kg_m3);
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

// Both branches meet where Pa2 is half of Pa1: the root is Pa1/2 there.
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
