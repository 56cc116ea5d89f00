#pragma once

#include <string>

#include "report/program.h"
#include "report/report.h"
#include "report/stop_signals.h"
#include "trainer/learning/label_plan.h"

namespace fdi::trainer {

struct TeachOptions {
  std::string type;  ///< Saved valve type to offer the result to; may be empty.
  bool activate{false};
};

/// Stores the parent of `plan`, a set of onboarding, with the observers that
/// its labels teach as the next version, and shows how both call the episodes.
/// @param plan of which the evidence is stored (StoreEvidence).
/// @throws as TeachFrom(); ConfigError if the type was not saved with the
///   parent.
report::Report TeachAndStore(const LabelPlan& plan, const TeachOptions& options,
                             report::StopSignals& signals,
                             const report::Context& context);

}  // namespace fdi::trainer
