#include "simulator/valve_unknowns.h"

#include <algorithm>
#include <cmath>

#include "simulator/valve_equations.h"
#include "simulator/water.h"

namespace fdi::simulator {
namespace {

// `factor` to both sides of the nominal value, inside [least, most].
ValveUnknown Unknown(const char* name, double& (*in)(ValveParameters&),
                     ValveParameters nominal, double factor, double least,
                     double most) {
  const double value = in(nominal);
  const double centre = std::clamp(value, least, most);
  return {name,
          in,
          value,
          std::max(least, centre / factor),
          std::min(most, centre * factor),
          false};
}

// Sums of a weighted straight line y = a - n x.
struct LineSums {
  double w{0.0};
  double x{0.0};
  double y{0.0};
  double xx{0.0};
  double xy{0.0};
  int rows{0};

  void Add(double weight, double at, double value) {
    w += weight;
    x += weight * at;
    y += weight * value;
    xx += weight * at * at;
    xy += weight * at * value;
    ++rows;
  }
};

// Flow over 100 sqrt(dP / rho), i.e. Kv f(X) [m3/h]; 0 where it says nothing.
double EffectiveKv(const RecordRow& row, const InstrumentParameters& i) {
  const double margin = 0.01 * (i.flow.high - i.flow.low);
  if (row.flow < i.flow.low + margin || row.flow > i.flow.high - margin) {
    return 0.0;
  }
  const MediumState medium = MediumAt(
      1e3 * row.input.p1_kpa, 1e3 * row.input.p2_kpa, row.input.t1_degc);
  const double drop =
      EffectivePressureDrop(medium, RecoveryCoefficient(0.01 * row.x_pct));
  constexpr double kLeastDropPa = 1e4;
  if (drop < kLeastDropPa) {
    return 0.0;
  }
  const double to_m3 =
      i.flow_unit == FlowUnit::kTPerHour ? 1000.0 / medium.density_kg_m3 : 1.0;
  return row.flow * to_m3 / Flow(1.0, 1.0, drop, medium.density_kg_m3);
}

}  // namespace

std::vector<ValveUnknown> UnknownsOf(const ValveParameters& nominal,
                                     bool has_flow) {
  using V = ValveParameters;
  std::vector<ValveUnknown> unknowns;
  const auto add = [&](const char* name, double& (*in)(V&), double factor,
                       double least, double most) {
    unknowns.push_back(Unknown(name, in, nominal, factor, least, most));
  };
  if (has_flow) {
    add(
        "trim.kv_m3_h", [](V& v) -> double& { return v.trim.kv_m3_h; }, 4.0,
        0.1, 1e5);
    if (nominal.trim.characteristic == FlowCharacteristic::kExponential) {
      add(
          "trim.exponent", [](V& v) -> double& { return v.trim.exponent; }, 2.0,
          0.1, 20.0);
    }
  }
  if (nominal.positioner.relay == AirRelay::kOrifice) {
    add(
        "positioner.orifice_coefficient",
        [](V& v) -> double& { return v.positioner.orifice_coefficient; }, 5.0,
        1e-9, 1e-3);
  } else {
    add(
        "positioner.filling_cv",
        [](V& v) -> double& { return v.positioner.filling_cv; }, 5.0, 1e-6,
        1.0);
    add(
        "positioner.venting_cv",
        [](V& v) -> double& { return v.positioner.venting_cv; }, 5.0, 1e-6,
        1.0);
  }
  add(
      "positioner.filter_time_s",
      [](V& v) -> double& { return v.positioner.filter_time_s; }, 5.0, 1e-2,
      100.0);
  const std::size_t first_stated = unknowns.size();
  add(
      "positioner.gain", [](V& v) -> double& { return v.positioner.gain; }, 5.0,
      0.1, 1e4);
  add(
      "actuator.play_fraction",
      [](V& v) -> double& { return v.actuator.play_fraction; }, 5.0, 2e-3, 0.2);
  add(
      "actuator.supply_pressure_gauge_pa",
      [](V& v) -> double& { return v.actuator.supply_pressure_gauge_pa; }, 2.0,
      1.3e5, 2e6);
  for (std::size_t i = first_stated; i < unknowns.size(); ++i) {
    unknowns[i].stated = true;
  }
  return unknowns;
}

std::vector<ValveParameters> RelayVariants(const ValveParameters& nominal) {
  ValveParameters other = nominal;
  const bool orifice = nominal.positioner.relay == AirRelay::kOrifice;
  other.positioner.relay =
      orifice ? AirRelay::kCompressible : AirRelay::kOrifice;
  other.positioner.transducer_dead_zone = !orifice;
  return {nominal, other};
}

PointBounds BoundsOf(const std::vector<ValveUnknown>& unknowns) {
  constexpr double kPriorSd = 0.5;
  const auto count = static_cast<Eigen::Index>(unknowns.size());
  PointBounds bounds{Eigen::VectorXd(count), Eigen::VectorXd(count),
                     Eigen::VectorXd(count),
                     Eigen::VectorXd::Constant(count, kPriorSd)};
  for (Eigen::Index i = 0; i < count; ++i) {
    const ValveUnknown& unknown = unknowns[static_cast<std::size_t>(i)];
    bounds.lower[i] = std::log(unknown.lower);
    bounds.upper[i] = std::log(unknown.upper);
    bounds.prior_mean[i] =
        std::log(std::clamp(unknown.nominal, unknown.lower, unknown.upper));
  }
  return bounds;
}

ValveParameters WithUnknowns(ValveParameters parameters,
                             const std::vector<ValveUnknown>& unknowns,
                             const Eigen::VectorXd& point) {
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    unknowns[i].in(parameters) = std::exp(point[static_cast<Eigen::Index>(i)]);
  }
  return parameters;
}

TrimParameters RegressTrim(const std::vector<HealthyRecord>& records,
                           const ValveParameters& nominal) {
  TrimParameters trim = nominal.trim;
  const bool exponential =
      trim.characteristic == FlowCharacteristic::kExponential;
  LineSums sums;
  for (const HealthyRecord& record : records) {
    for (const RecordRow& row : record.rows) {
      const double kv = EffectiveKv(row, nominal.instruments);
      const double x = 0.01 * row.x_pct;
      if (kv > 0.0 && x < 0.97) {
        const double shape = exponential ? 0.0 : std::log1p(-std::max(0.0, x));
        sums.Add(row.flow * row.flow, x, std::log(kv) - shape);
      }
    }
  }
  constexpr int kLeastRows = 30;
  if (sums.rows < kLeastRows) {
    return trim;
  }
  const double x_mean = sums.x / sums.w;
  const double x_variance = sums.xx / sums.w - x_mean * x_mean;
  constexpr double kLeastSpread = 0.02;  // Of X, standard deviation.
  if (exponential && x_variance > kLeastSpread * kLeastSpread) {
    const double n =
        -(sums.xy / sums.w - x_mean * sums.y / sums.w) / x_variance;
    trim.exponent = std::clamp(n, 0.5 * trim.exponent, 2.0 * trim.exponent);
  }
  const double slope = exponential ? trim.exponent : 0.0;
  trim.kv_m3_h = std::exp(sums.y / sums.w + slope * x_mean);
  return trim;
}

}  // namespace fdi::simulator
