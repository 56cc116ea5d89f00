#pragma once

#include <string>

#include "storage/runs/runs.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// "1a2b3c4d5e6f", or "1a2b3c4d5e6f@60:1500" for the stretch of `part`.
std::string SelectorOf(const std::string& id, const storage::RunSelector& part);

/// The selector of the run and of its stretch.
std::string RunName(const storage::StoredRun& run);

/// True if some sample carries a truth, stored or labelled.
bool HasTruth(const storage::StoredRun& run);

/// The truth beside a sample; {0, 0} while no fault acts or none is known.
FaultTruth TruthOf(const storage::StoredSample& stored);

/// The first fault that acts in a run; 0: none does.
int FaultOf(const storage::StoredRun& run);

/// The signals that most accepted samples have: a transmitter that failed for a
/// while costs those samples, not the signal.
SignalMask UsualSignals(const storage::StoredRun& run);

/// The samples of a stored run that may be trained on: accepted in their time,
/// mode AUTO, finite, of good quality, within what a transmitter reads, and
/// with the signals that most samples of the run have. In a run with truth, the
/// samples without one are left out unless `assume_normal`.
TrainingRun ToTrainingRun(const storage::StoredRun& run, bool assume_normal);

}  // namespace fdi::trainer
