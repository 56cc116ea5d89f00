#pragma once

#include "diagnosis/model/sample.h"
#include "simulator/valve_parameters.h"

/// The algebraic equations of the valve, one function each. SI units; X is the
/// fraction of closing (0 open, 1 closed), pressures are absolute.
namespace fdi::simulator {

/// Density of saturated water [kg/m3] at 0..350 degC, after [Wagner & Pruss,
/// 1993]; within 0.3 % of compressed water at the pressures of a boiler feed.
///
/// - [Wagner & Pruss, 1993] "International equations for the saturation
///   properties of ordinary water substance", J. Phys. Chem. Ref. Data 22.
double WaterDensity(double temperature_c);

/// Density used for the valve's flow [kg/m3]: WaterDensity() up to 110 degC,
/// constant above, as in the benchmark's model, whose evaporation fault does
/// not change the liquid's density.
double LiquidDensity(double temperature_c);

/// The unit that a valve's flow is wanted in, and what decides its density.
struct FlowTarget {
  FlowUnit unit{FlowUnit::kM3PerHour};
  Medium medium{};
  double p1_kpa{0.0};    ///< Usual P1; 0: not known.
  double t1_degc{20.0};  ///< Usual T1.
};

/// Converts the flow of successive samples to a unit, m3/h being those at the
/// inlet, by the density of the medium at the last known P1 and T1, initially
/// the usual ones.
class FlowConversion {
 public:
  explicit FlowConversion(const FlowTarget& to) : to_(to) {}
  /// @throws DataError if a gas has to be converted whose P1 is not known.
  void Apply(Sample& sample);

 private:
  FlowTarget to_;  // With the last known P1 and T1.
};

/// Vapour pressure of water Pv = 10^(-2141/(T + 273.15) + 10.7167) [Pa], the
/// benchmark's formula: exact at 200 degC, 6 % low at 100, 11 % high at 300.
double VapourPressure(double temperature_c);

/// Temperature of boiling water [degC] at 0.6 kPa to 22 MPa, the backward
/// equation of region 4 of [IAPWS, 2007], "Revised Release on the IAPWS
/// Industrial Formulation 1997".
double SaturationTemperature(double pressure_pa);

/// Density of steam [kg/m3]; within 0.3 % of IAPWS IF97 at 0.05..10 MPa, from
/// saturation to 600 degC. Below saturation, that of saturated steam.
///
///   v = 0.461526e-3 T/P - 1e-3 [4.743 (647.096/T)^2.961 +
///       0.006238 P^2 (647.096/T)^13.364]      [m3/kg], P in MPa, T in K
double SteamDensity(double pressure_pa, double temperature_c);

/// f(X) of (12) in [0, 1]; 1 is open.
double Opening(const Trim& trim, double closing);

/// Km(X) of the trim: F_L^2, or the benchmark's table, 1 (open)..0.4.
double RecoveryCoefficient(const Trim& trim, double closing);
/// Km of the bypass path, 0.45 (open)..1.
double BypassRecoveryCoefficient(double closing);
/// Critical pressure ratio rc(P1) of the benchmark's table.
double CriticalPressureRatio(double inlet_pressure_pa);

/// M of the medium [kg/kmol]; 0 for liquids.
double MolarMass(const Medium& medium);

/// Vapour pressure of the medium [Pa]; 0 for gases.
double VapourPressure(const Medium& medium, double temperature_c);

/// The medium at the trim.
struct MediumState {
  double inlet_pressure_pa;   ///< P1m = max(P1, Pv).
  double outlet_pressure_pa;  ///< P2.
  double vapour_pressure_pa;  ///< Pv at T1.
  double density_kg_m3;       ///< rho at the inlet.
  double critical_ratio;      ///< Water: rc(P1m); liquids: F_F.
  double gas_factor;          ///< F_gamma = gamma / 1.40; 0 for liquids.
  double rounding;            ///< Factor on the drop, by rounded constants.
};
MediumState MediumAt(const Medium& medium, double inlet_pressure_pa,
                     double outlet_pressure_pa, double temperature_c);

/// Pressure drop of water that would drive the same flow [Pa].
///
/// Liquids: P1m - P2, at most max(0, Km (P1m - F_F Pv)) (choking).
///
/// Gases: Y^2 x P1 with x = (P1 - P2)/P1, at most F_gamma x_T (choking), and
/// Y = 1 - x / (3 F_gamma x_T); 0 for reversed flow.
///
/// [IEC 60534-2-1:2011]; for water with the benchmark's Km and rc.
double EffectivePressureDrop(const MediumState& medium, double recovery,
                             double choked_pressure_ratio);

/// (12) F = 100 Kv f sqrt(dP / rho) [m3/h at the inlet], Kv in m3/h, dP in MPa;
/// negative for reversed flow. The root is regularised below 1 kPa.
///
/// The constants of the standard are rounded, N1 and N9 within 0.1 % of these
/// 100; steam has N6 = 3.16 (MediumState::rounding).
double Flow(double kv_m3_h, double opening, double pressure_drop_pa,
            double density_kg_m3);

/// The inverse of the flow equation: Kv f(X) [m3/h] that passes a flow
/// [m3/h at the inlet] through the trim at the position `closing`; 0 if less
/// than 10 kPa drive it.
double CapacityFor(double flow_m3_h, const Trim& trim,
                   const MediumState& medium, double closing);

/// Converts a flow at the inlet [m3/h] to `unit`, and back.
double FlowInUnit(FlowUnit unit, double flow_m3_h, double density_kg_m3);
double FlowFromUnit(FlowUnit unit, double flow, double density_kg_m3);

/// Force of the flow on the plug, with the spring: (P1m - P2) A0 / Km, with the
/// unlimited drop. The paper prints Km (Pus - Pds) A0; this is the benchmark's
/// form.
double FlowForce(double pressure_drop_pa, double plug_area_m2, double recovery);

/// (15) Absolute pressure in the chamber Pc = (P0 V0 + R T m) / (V0 + A x),
/// with R T m = charge P0 V0 and x the position of the rod.
double ChamberPressure(const ActuatorParameters& actuator, double charge,
                       double position_m);

/// (16) Air flow [kg/s] between two pressures per unit of |if| and Cv: 4.13e-6
/// sqrt((Pa1 - Pa2) Pa2) while Pa2 >= Pa1/2, else 2.065e-6 Pa1 (the printed
/// 2.06e-6 would cause a jump); reversed if Pa1 < Pa2.
double AirFlow(double from_pa, double to_pa);

/// Square-root law of the benchmark's air relay: sqrt(Pa1 - Pa2) [sqrt(Pa)],
/// odd, regularised below 1 kPa.
double OrificeAirFlow(double from_pa, double to_pa);

/// Static table of the electro-pneumatic transducer, with a dead zone about 0.
double TransducerOutput(double signal);

/// The lever between rod and positioner: X = 0.5 + sin(60 deg (a - 0.5)), with
/// the angle a as a fraction of its travel. LeverAngle() is its inverse,
/// clamped at the ends of the travel.
double LeverPosition(double angle);
double LeverAngle(double closing);

}  // namespace fdi::simulator
