#pragma once

#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "report/progress.h"
#include "report/report.h"
#include "report/stop_signals.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// @throws ConfigError naming the option unless a model set or a type can be
///   stored under `name`: before the work, not after it.
void RequireStorable(const std::string& name, const std::string& option);

/// Moves the bar, and ends the work by Interrupted where the user asked for it.
Progress Reporting(report::Progress& bar, const report::StopSignals& signals);

/// Facts on false alarms: the rate that the limits are set for, the hours that
/// were seen, and the bound that follows from these only.
std::string AlarmRateText(const ModelSet& models);
/// ["f8", "f14"]
report::Json FaultsJson(const std::vector<int>& faults);

/// Null for the VAF [%] of an output that did not vary in the validation data:
/// it divides by what rounding leaves of the variance, and says nothing.
report::Json VafJson(double vaf);

/// The object that `train`, `onboard` and `show` have in common: model_set,
/// version, content_hash, channels, observers, groups, undetectable.
report::Json ModelsJson(const ModelSet& models);

/// Shows the ModelsJson() that the report's document holds: channels with
/// thresholds and regressors, limits on windows, every observer with rules,
/// MSE, VAF and bias per channel, and which faults the set cannot tell.
void AddModelTables(const ModelSet& models, report::Report& report);

/// The strength of the fault of a labelled episode; "-" if it is normal
/// operation or was refused.
report::Column StrengthColumn();

/// The labelled episodes of `lineage` in the document, as report::LineageJson()
/// gives them; nothing if there are none.
void AddEpisodeTable(report::Report& report);

}  // namespace fdi::trainer
