#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/toml_reader.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {

/// Defaults for the parameter set lublin-actuator-3.
ValveSimulationConfig DefaultConfig();

/// One simulated valve, as described by a TOML table.
struct Scenario {
  std::string valve_id{"VALVE-0001"};
  ValveSimulationConfig config{DefaultConfig()};  ///< start_ns 0: not set.
  std::string excitation_file;  ///< File of a csv excitation, as given.
};

/// Applies `table` to `scenario`; what it does not mention is unchanged. Keys:
///
///     valve = "LC51_03"
///     parameters = "lublin-actuator-3"   # or a name of ParameterSetNames(),
///                                        # "FILE.toml", or a table
///     excitation = "level-loop"          # or operating-point, sine,
///                                        # inventory-loop, "csv:FILE", or a
///                                        # table
///     faults = ["f19:abrupt@50:strength=0.75"]   # kFaultForms
///     seed = 7
///     duration_s = 2000
///     period_s = 1
///     start = "2026-11-20T00:00:00Z"
///     cold_start = false
///     continuous_inputs = false  # sine only: not held from sample to sample
///     noise = true
///     resolution = true
///     tolerance_scale = 1
///
///     [excitation]                       # the fields of excitation.h
///     name = "operating-point"           # absent: the present one
///     amplitude_pct = 5
///     cv_noise_pct.sd = 0.3
///
///     [[input]]                          # InputProfile, laid over it
///     t_s = [0, 600]
///     cv_pct = [100, 60]                 # also p1_kpa, p2_kpa, t1_degc
///     p1_noise_kpa = {sd = 22, correlation = 0.85}   # also cv_.., p2_..
///
///     [[mode]]                           # AUTO elsewhere
///     from_s = 0                         # absent: 0
///     until_s = 600                      # absent: to the end
///     mode = "MANUAL"                    # kValveModeNames
///
///     [parameters]                       # the fields of valve_parameters.h
///     base = "lublin-actuator-3"         # absent: the present ones
///     name = "mine"
///     trim.kv_m3_h = 72.7
///
/// A parameter file has the keys of [parameters]. A csv excitation sets the
/// period and, unless the table has duration_s, the duration.
///
/// @param folder base of relative file names.
/// @throws ConfigError naming file, line, key, value and what is accepted. The
///   caller's Finish() of the whole document rejects unknown keys.
/// @throws DataError if a csv excitation cannot be read.
void ApplyScenario(TomlReader& table, const std::filesystem::path& folder,
                   Scenario& scenario);

/// Applies a whole file to `scenario`. @throws as ApplyScenario(), and
/// ConfigError for an unknown key.
void ApplyScenarioFile(const std::filesystem::path& path, Scenario& scenario);

/// The named set, or the one in "FILE.toml"; `folder` as above.
/// @throws ConfigError naming the accepted names.
ValveParameters FindParameters(const std::string& name,
                               const std::filesystem::path& folder = {});

/// Selects an excitation: operating-point, sine, level-loop, inventory-loop
/// or csv:FILE.
/// @throws ConfigError naming these; DataError.
void ChooseExcitation(const std::string& name,
                      const std::filesystem::path& folder, Scenario& scenario);

/// Applies one `key=value` to `scenario`, e.g. "excitation.amplitude_pct=5" or
/// "excitation=level-loop" (text needs no quotes). @throws as above.
void ApplySetting(std::string_view setting, Scenario& scenario);

/// The canonical text: TOML from which ApplyScenario() restores `scenario`. For
/// excitation and parameters it contains the differences from the defaults of
/// that name (which the software version pins). Numbers round-trip bit for bit.
std::string ScenarioText(const Scenario& scenario);

}  // namespace fdi::simulator
