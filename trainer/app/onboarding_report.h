#pragma once

#include <ostream>

#include "storage/baseline.h"
#include "storage/cli/json_output.h"
#include "trainer/onboarding/onboarding.h"

namespace fdi::trainer {

/// Physical parameters, fit of the normal observer against a naive model, model
/// set, coverage.
void PrintOnboarding(std::ostream& out, const Onboarding& onboarding);
cli::Json OnboardingJson(const Onboarding& onboarding);

/// Per fault what is detectable and isolable, its look-alikes, and what one
/// more transmitter would buy.
void PrintCoverage(std::ostream& out, const CoverageTable& table);
cli::Json CoverageJson(const CoverageTable& table);

/// What is kept of an onboarding in the valve table.
storage::BaselineRecord BaselineOf(const Onboarding& onboarding,
                                   std::uint32_t epoch);

}  // namespace fdi::trainer
