#pragma once

#include <string>

#include "storage/run_types.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// "1a2b3c4d5e6f", or "1a2b3c4d5e6f@60:1500" for a stretch.
std::string RunName(const storage::StoredRun& run);

/// True if some sample carries a truth, stored or labelled.
bool HasTruth(const storage::StoredRun& run);

/// The samples of a stored run that may be trained on: accepted in their time,
/// mode AUTO, finite, of good quality, within what a transmitter reads, and
/// with the signals that most samples of the run have. Of a run with truth, the
/// samples without one are left out unless `assume_normal`.
TrainingRun ToTrainingRun(const storage::StoredRun& run, bool assume_normal);

}  // namespace fdi::trainer
