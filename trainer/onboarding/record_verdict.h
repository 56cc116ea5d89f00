#pragma once

#include <string>
#include <vector>

#include "trainer/training.h"

namespace fdi::trainer {

/// What a model set is worth that was made from a healthy record, as far as the
/// record decides it.
struct RecordVerdict {
  std::string word;      ///< "usable" or "thin"; what is neither is refused.
  std::string sentence;  ///< Begins with the word; says what is still needed.
};

/// Thin is a record of less than 25 minutes, or one in which the command stays
/// within 5 %, outliers aside: the set would alarm where the valve works in
/// another way.
/// @param hours of healthy data in `runs`
RecordVerdict JudgeRecord(const std::vector<TrainingRun>& runs, double hours);

}  // namespace fdi::trainer
