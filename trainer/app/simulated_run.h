#pragma once

#include <cstdint>

#include "storage/run_types.h"
#include "trainer/app/campaign.h"

namespace fdi::trainer {

/// The configuration that a run of a campaign is simulated with: `start_ns`
/// where its scenario does not say it, a source of its seed.
simulator::ValveSimulationConfig SimulationConfigOf(const SimulatedRun& run,
                                                    std::int64_t start_ns);

/// What is stored of it, without state and samples.
storage::NewRun RunRowOf(const SimulatedRun& run, std::int64_t start_ns,
                         const std::string& software);

/// Simulates it in memory; its id stays empty.
storage::StoredRun SimulateRun(const SimulatedRun& run);

}  // namespace fdi::trainer
