#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/quality_count.h"
#include "storage/runs/runs.h"

namespace fdi::trainer {

/// Errors of the normal observer over consecutive samples, one period apart,
/// at which a valve without an alarm would have been judged.
struct ResidualStretch {
  std::string run;  ///< As RunName() has it.
  std::vector<std::int64_t> stamps_ns;
  std::vector<double> commands;  ///< CV [%].
  /// By channel, as the engine compares them with its limits: less what
  /// extrapolation may have put there. NaN where the channel abstains.
  std::vector<std::vector<double>> residuals;
};

/// Residuals of the normal observer over data that it was not fitted to.
struct HealthyResiduals {
  std::vector<ResidualStretch> stretches;
  QualityCount left_out;        ///< Samples that would not have been judged.
  std::int64_t samples{0};      ///< In the stretches.
  std::vector<Sample> excerpt;  ///< The end of the longest stretch, 15 min.
  /// The floor of the set, as wide as the data ask for (WidenFloor): it judges
  /// at every command in AUTO, so all samples that the engine would take count.
  std::optional<FloorLimits> floor{};
};

/// Runs the normal observer over the samples of a run as the engine does, and
/// adds its residuals. The observer settles again after every gap. Left out are
/// samples that the engine would not take, and those at which the valve is
/// outside of what the set covers, in another mode than AUTO, or settling.
///
/// @throws DataError naming the run if it is of another period or flow unit, or
///   has samples with a fault.
void AddResiduals(const std::shared_ptr<const ModelSet>& models,
                  const storage::StoredRun& run, HealthyResiduals& data);

}  // namespace fdi::trainer
