#pragma once

#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// Samples of a valve while a fault acted on it, as a person said.
struct Lesson {
  int fault{0};
  double strength{0.0};  ///< Signed.
  std::vector<Stretch> stretches;
};

/// The result of a lesson.
struct TaughtObserver {
  Observer observer;         ///< Its name ends with kTaughtMark.
  std::string adapted_from;  ///< Name of an observer; empty: none.
  std::int64_t samples{0};
  /// Gains over normal operation, and over what it was adapted from, in
  /// explaining the samples: differences of log-likelihood, all on folds of the
  /// samples that were left out.
  double gain_over_normal{0.0};
  double gain_over_former{0.0};
};

/// Makes an observer from what a fault did to the very valve that `parent` was
/// onboarded for.
///
/// In every channel it is the parent's observer of the fault at the nearest
/// strength in the same direction, with the consequents changed as little as
/// the samples ask for (AdaptModel); for a fault that the parent does not know,
/// the normal one. Deviation, membership and the limits of the fit are those on
/// folds of the samples that were left out, but none is closer than the
/// parent's: a window of minutes does not show another day.
///
/// @param parent A set of onboarding.
/// @throws DataError if the samples are too few, or explain no more than noise
///   does: less than the evidence that refutes a fault
///   (DecisionParameters::evidence_support).
TaughtObserver Teach(const ModelSet& parent, const Lesson& lesson);

/// `parent` with these observers instead of those taught before; all else stays
/// bit for bit, but for a fault that it did not know.
/// @throws DataError if there are more observers than a set can hold.
ModelSet WithTaught(const ModelSet& parent,
                    const std::vector<TaughtObserver>& taught);

/// Joins those of one fault at strengths that differ by less than half the step
/// of conditions (0.05).
std::vector<Lesson> JoinLessons(std::vector<Lesson> lessons);

}  // namespace fdi::trainer
