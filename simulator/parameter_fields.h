#pragma once

#include <array>
#include <string_view>

#include "base/field_list.h"
#include "simulator/valve_parameters.h"

/// The fields of the physical structs, each listed once: TOML files and stored
/// model sets name and order them by these lists.
namespace fdi::simulator {

/// Names of the values of an enumeration, by number, as files state them.
template <typename Enum>
inline constexpr std::array<std::string_view, 0> kEnumNames{};
template <>
inline constexpr auto kEnumNames<SpringAction> =
    std::to_array<std::string_view>({"to-open", "to-close"});
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

FDI_VISITABLE(ActuatorParameters, moving_mass_kg, damping_n_s_m,
              spring_rate_n_m, spring_preload_m, diaphragm_area_m2, stroke_m,
              chamber_volume_m3, air_temperature_k, ambient_pressure_pa,
              supply_pressure_gauge_pa, plug_area_m2, play_fraction,
              lowest_travel, highest_travel, coulomb_friction_n, spring)
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

}  // namespace fdi::simulator
