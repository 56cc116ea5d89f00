#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "diagnosis/decision/episode_looks.h"
#include "diagnosis/decision/look_book.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/trained_signals.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// The looks at one valve and what they make of it: when one is due, the name
/// of the open episode, and whether there should be one.
class ValveLooks {
 public:
  /// `simulation` and `models` must outlive it; without a set, every signal
  /// counts and no groups bind.
  explicit ValveLooks(const LookSimulation& simulation,
                      const ModelSet* models = nullptr);

  /// The next sample, whatever its intake, and what the engine said about it.
  std::optional<LookTask> Step(const Sample& sample, const Verdict& verdict);

  /// The answer to a look that was due; for an earlier episode it counts for
  /// nothing.
  void Enter(const LookTask& task, LookAnswer answer);

  /// The answer that counts for the open episode at the last sample, if there
  /// is one.
  const LookAnswer* Answer() const;
  /// The same for a second fault, on top of the one of that episode.
  const LookAnswer* SecondAnswer() const;

  /// See EpisodeLooks::GrowthTask(). Its answer is not for Enter().
  std::optional<LookTask> GrowthTask(std::vector<Explanation> known) const {
    return looks_.GrowthTask(std::move(known));
  }

  /// The engine should have an episode (ValveEngine::Suspect).
  bool suspects() const { return suspicion_.found() != nullptr; }

 private:
  void EnterInBook(const LookTask& task, LookAnswer answer);

  EpisodeLooks looks_;
  const ModelSet* models_;
  TrainedSignals trained_;
  std::int64_t period_ns_;
  LookBook book_;
  LookBook second_book_;  // About the second fault.
  Suspicion suspicion_;
  std::int64_t stamp_ns_{0};
  std::int64_t detection_ns_{0};
  std::int64_t second_ns_{0};  // Detection of a second fault; 0: there is none.
  bool open_{false};
};

}  // namespace fdi
