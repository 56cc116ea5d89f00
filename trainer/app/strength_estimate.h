#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "diagnosis/model_set.h"
#include "storage/run_types.h"

namespace fdi::trainer {

/// How strong a fault was, or why that cannot be told.
struct StrengthEstimate {
  double strength{0.0};  ///< Signed.
  std::string problem;   ///< Empty: the strength is good.
};

/// What the engine of `models` makes of `run` from `detected_ns` on: the median
/// over the later half of the time in which it detects something. Good if the
/// fault explains the samples there with a factor of T/2 at least, at a
/// strength that is not beyond those it was trained at: the prediction from
/// beyond them is a guess, and so would be the strength.
///
/// @throws DataError as Rescore().
StrengthEstimate EstimateStrength(const std::shared_ptr<const ModelSet>& models,
                                  const storage::StoredRun& run, int fault,
                                  std::int64_t detected_ns);

}  // namespace fdi::trainer
