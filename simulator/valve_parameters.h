#pragma once

#include <array>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "base/field_list.h"
#include "diagnosis/model/sample.h"

namespace fdi::simulator {

/// The medium in the valve.
enum class Fluid {
  kWater,   ///< Density, vapour pressure and choking of the benchmark.
  kLiquid,  ///< IEC 60534-2-1 with the three numbers of Medium.
  kGas,     ///< IEC 60534-2-1, density by the gas law.
  kSteam    ///< IEC 60534-2-1, density by SteamDensity().
};

/// The medium. A field that the fluid does not need is ignored.
struct Medium {
  Fluid fluid{Fluid::kWater};
  double density_kg_m3{1000.0};           ///< For a liquid.
  double vapour_pressure_kpa{0.0};        ///< For a liquid, absolute.
  double critical_pressure_kpa{22064.0};  ///< For a liquid, absolute.
  double molar_mass_kg_kmol{28.96};       ///< M of a gas.
  double compressibility{1.0};            ///< Z of a gas at the inlet.
  double isentropic_exponent{1.4};        ///< gamma of a gas.

  bool is_gas() const { return fluid == Fluid::kGas || fluid == Fluid::kSteam; }

  friend bool operator==(const Medium&, const Medium&) = default;
};

/// Where the spring takes the rod when the air fails.
enum class SpringAction {
  kToOpen,  ///< Air closes.
  kToClose  ///< Air opens.
};

/// Force that moves the rod.
enum class ActuatorDrive {
  kPneumatic,  ///< Air against a spring, equations (13)-(16).
  kElectric    ///< A motor of constant speed with a switching positioner.
};

/// Spring-and-diaphragm actuator, equations (13)-(15). Pressure in the chamber
/// moves the rod against the spring, from 0 to the stroke. An electric one has
/// the play and the last two fields alone.
struct ActuatorParameters {
  double moving_mass_kg{2.0};              ///< m.
  double damping_n_s_m{1500.0};            ///< b.
  double spring_rate_n_m{60892.0};         ///< K.
  double spring_preload_m{0.009525};       ///< x0.
  double diaphragm_area_m2{0.0290};        ///< A.
  double stroke_m{0.0381};                 ///< Travel of the rod.
  double chamber_volume_m3{0.0055};        ///< V0, at x = 0.
  double air_temperature_k{293.0};         ///< T of (15).
  double ambient_pressure_pa{101325.0};    ///< P0.
  double supply_pressure_gauge_pa{600e3};  ///< Above ambient.
  double plug_area_m2{1.9635e-3};          ///< A0, 50 mm plug.
  double play_fraction{0.01};              ///< Backlash width / stroke.
  /// Travel of the actuator / stroke, before the play: it continues where a
  /// stop holds the rod.
  double lowest_travel{-0.05};
  double highest_travel{1.25};
  double coulomb_friction_n{0.0};  ///< F_f of (13), 0 = none.
  SpringAction spring{SpringAction::kToOpen};
  ActuatorDrive drive{ActuatorDrive::kPneumatic};
  double stroke_time_s{60.0};  ///< Of the running motor, for the stroke.
  /// |CV - X| / stroke at which the motor starts; it stops at half of it.
  double dead_band{0.01};
};

/// Law of air flow between two pressures.
enum class AirRelay {
  kCompressible,  ///< (16), with a Cv each for filling and venting.
  kOrifice        ///< mdot = c if sqrt(Pa1 - Pa2), the DAMADICS benchmark's.
};

/// Positioner (17) with its filter, transducer and air relay.
struct PositionerParameters {
  double gain{100.0};  ///< Kp, on the error as a fraction of the stroke.
  double integral_time_s{std::numeric_limits<double>::infinity()};  ///< TI.
  double derivative_time_s{0.0};                                    ///< TD.
  double filter_time_s{0.30};     ///< Each of the two lags on the command.
  double sampling_period_s{0.0};  ///< 0 = continuous (17); benchmark: 0.035.
  AirRelay relay{AirRelay::kCompressible};
  double filling_cv{1.05e-3};          ///< Cv of (16) while filling.
  double venting_cv{1.05e-3};          ///< Cv of (16) while venting.
  double orifice_coefficient{2.5e-6};  ///< c of kOrifice [kg/(s sqrt(Pa))].
  bool transducer_dead_zone{false};    ///< Electro-pneumatic table in series.
};

/// f as a function of the opening h = 1 - X, IEC 60534-2-4.
enum class FlowCharacteristic {
  kExponential,   ///< f = exp(-n X): equal percentage of rangeability exp(n).
  kLinear,        ///< f = h.
  kQuickOpening,  ///< Points of a maker's handbook.
  kTable          ///< The points of Trim.
};

/// The trim, equation (12).
struct Trim {
  double kv_m3_h{120.0};  ///< Rated, fully open; reducers included.
  FlowCharacteristic characteristic{FlowCharacteristic::kExponential};
  double exponent{5.0};    ///< n of the exponential characteristic.
  double shut_off{0.975};  ///< X from which an exponential falls linearly.
  double leakage{0.0};     ///< f of the shut valve.
  std::vector<double> table_h{};  ///< Openings of the table, rising to 1.
  std::vector<double> table_f{};  ///< f at them, rising to 1.
  /// F_L; 0 takes the benchmark's Km(X) for its square.
  double liquid_recovery{0.0};
  double choked_pressure_ratio{0.72};  ///< x_T, for gases.
  double bypass_kv_m3_h{19.75};        ///< V3, fully open (fault f18).
};

/// A transmitter: reading = quantize(clamp(clamp(value) + noise)), both to
/// [low, high].
struct Transmitter {
  double low;
  double high;
  double noise_sd;  ///< Same unit as the range, >= 0.

  friend bool operator==(const Transmitter&, const Transmitter&) = default;
};

/// Transmitters in the units of Sample (%, kPa, degC, flow unit of the set).
struct Instrumentation {
  FlowUnit flow_unit{FlowUnit::kTPerHour};
  Transmitter command{0.0, 100.0, 0.0};
  Transmitter pressure{0.0, 4000.0, 5.64};
  Transmitter temperature{0.0, 200.0, 0.282};
  Transmitter position{0.0, 100.0, 0.141};
  Transmitter flow{0.0, 40.0, 0.0564};
  /// Noise of the command on its way to the positioner, drawn once per sample
  /// and held, hence 17 times smaller than fast white noise [%].
  double positioner_noise_sd_pct{0.0083};
  int resolution_bits{16};  ///< Over the span.
};

/// One valve. Users choose from the named sets below.
struct ValveParameters {
  std::string name{"lublin-actuator-3"};
  ActuatorParameters actuator{};
  PositionerParameters positioner{};
  Trim trim{};
  Instrumentation instruments{};
  Medium medium{};
};

/// Names of the values of an enumeration, by number, as files state them.
template <typename Enum>
inline constexpr std::array<std::string_view, 0> kEnumNames{};
template <>
inline constexpr auto kEnumNames<SpringAction> =
    std::to_array<std::string_view>({"to-open", "to-close"});
template <>
inline constexpr auto kEnumNames<ActuatorDrive> =
    std::to_array<std::string_view>({"pneumatic", "electric"});
template <>
inline constexpr auto kEnumNames<AirRelay> =
    std::to_array<std::string_view>({"compressible", "orifice"});
template <>
inline constexpr auto kEnumNames<FlowCharacteristic> =
    std::to_array<std::string_view>({"exponential", "linear", "quick-opening",
                                     "table"});
template <>
inline constexpr auto kEnumNames<FlowUnit> =
    std::to_array<std::string_view>({"m3/h", "t/h"});
template <>
inline constexpr auto kEnumNames<Fluid> =
    std::to_array<std::string_view>({"water", "liquid", "gas", "steam"});

/// The fields of the physical structs, each listed once: TOML files and stored
/// model sets name and order them by these lists.
FDI_VISITABLE(ActuatorParameters, moving_mass_kg, damping_n_s_m,
              spring_rate_n_m, spring_preload_m, diaphragm_area_m2, stroke_m,
              chamber_volume_m3, air_temperature_k, ambient_pressure_pa,
              supply_pressure_gauge_pa, plug_area_m2, play_fraction,
              lowest_travel, highest_travel, coulomb_friction_n, spring, drive,
              stroke_time_s, dead_band)
FDI_VISITABLE(PositionerParameters, gain, integral_time_s, derivative_time_s,
              filter_time_s, sampling_period_s, relay, filling_cv, venting_cv,
              orifice_coefficient, transducer_dead_zone)
FDI_VISITABLE(Trim, kv_m3_h, characteristic, exponent, bypass_kv_m3_h, shut_off,
              leakage, table_h, table_f, liquid_recovery, choked_pressure_ratio)
FDI_VISITABLE(Transmitter, low, high, noise_sd)
FDI_VISITABLE(Instrumentation, flow_unit, command, pressure, temperature,
              position, flow, positioner_noise_sd_pct, resolution_bits)
FDI_VISITABLE(Medium, fluid, density_kg_m3, vapour_pressure_kpa,
              critical_pressure_kpa, molar_mass_kg_kmol, compressibility,
              isentropic_exponent)
FDI_VISITABLE(ValveParameters, name, actuator, positioner, trim, instruments,
              medium)

/// The shipped sets:
/// - lublin-actuator-3: data sheet and benchmark values of actuator 3 of the
///   Lublin sugar factory (feedwater of the 4th boiler), flow in t/h, with the
///   benchmark's air relay in place of (16).
/// - lublin-actuator-3-refit: the same, refitted to 40 minutes of the plant
///   record: (16) with a Cv each for filling and venting (without the dead
///   zone's table), filter time, Kv and exponent; otherwise as above.
/// - liquid-globe, gas-globe, steam-globe: a globe valve of DN 50 with an equal
///   percentage trim of rangeability 50 for water, air or steam; flow in t/h.
/// - paper-operating-point: linear trim in m3/h that gives the flow, position
///   and noise floor of [Mendonca et al., 2009], tables 3 and 4.
std::vector<std::string> ParameterSetNames();

/// One line: medium, trim, Kv, spring, range of the flow.
std::string Describe(const ValveParameters& valve);

/// @throws ConfigError naming the accepted names.
ValveParameters ParameterSet(std::string_view name);

/// @throws ConfigError naming the first field out of range, its value and the
///   accepted range.
void Validate(const ValveParameters& parameters);

}  // namespace fdi::simulator
