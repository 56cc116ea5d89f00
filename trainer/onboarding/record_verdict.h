#pragma once

#include <string>
#include <vector>

#include "trainer/onboarding/coverage.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// The worth of a model set that was made from a healthy record.
struct RecordVerdict {
  std::string word;      ///< "usable" or "thin"; what is neither is refused.
  std::string sentence;  ///< Begins with the word; says what is still needed.
};

/// Thin is a record of less than 25 minutes, or with less than 25 minutes of
/// readings of CV, or of both X and F (the rest is held or filled in), one in
/// which the command stays within 5 %, outliers aside, and one whose parts the
/// models of the rest do not know: they alarm there, or judge less than half of
/// it. The set would alarm where the valve works in another way.
///
/// @param hours of healthy data in `runs`
/// @param coverage of parts that the models did not see; null: not scored.
RecordVerdict JudgeRecord(const std::vector<TrainingRun>& runs, double hours,
                          const CoverageTable* coverage = nullptr);

}  // namespace fdi::trainer
