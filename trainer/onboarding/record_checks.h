#pragma once

#include <vector>

#include "simulator/valve_identification.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// From this period on a record does not show how the rod moves [s].
inline constexpr double kSlowS = 5.0;

/// Refuses records whose numbers cannot be those of a valve in the units and
/// the sense that the project uses (diagnosis/model/sample.h): CV and X in
/// shares of one, P1 in bar, T1 in K, P1 below P2, X or F that move against the
/// command; and records without X, with a copy of CV in X, or of an open/shut
/// valve.
/// @throws DataError with what was seen, what is expected and what to try.
void CheckRecords(const std::vector<TrainingRun>& runs,
                  const simulator::Medium& medium);

/// Refuses a simulation that follows the records worse than X = CV and F = its
/// mean do, and fitted parameters that stand at the bound of their search:
/// what faults do to such a valve is not known.
/// @param meter_end highest reading of the type's flow meter [unit of F].
/// @throws DataError likewise.
void CheckFit(const std::vector<TrainingRun>& runs,
              const simulator::RecordFit& simulation,
              const std::vector<simulator::FittedParameter>& parameters,
              double meter_end);

}  // namespace fdi::trainer
