#pragma once

#include <memory>
#include <vector>

#include "diagnosis/fault_plan.h"
#include "diagnosis/model_set.h"
#include "diagnosis/observer_kernels.h"
#include "diagnosis/observer_plan.h"

namespace fdi {

/// A model set made ready for engines: checked, and laid out as they read it.
/// That takes some milliseconds, once for all valves of the set. Immutable; any
/// number of threads.
class EnginePlan {
 public:
  /// @throws DataError if `models` is not usable (Validate).
  explicit EnginePlan(std::shared_ptr<const ModelSet> models);

  const ModelSet& models() const { return *models_; }
  const std::shared_ptr<const ModelSet>& shared_models() const {
    return models_;
  }
  /// The signals that some channel of the set reads.
  SignalMask required() const { return required_; }
  const std::shared_ptr<const ObserverPlan>& observers() const {
    return observers_;
  }
  const std::shared_ptr<const FaultPlan>& faults() const { return faults_; }

 private:
  std::shared_ptr<const ModelSet> models_;
  SignalMask required_;
  std::shared_ptr<const ObserverPlan> observers_;
  std::shared_ptr<const FaultPlan> faults_;
};

/// What engines of one model set share: its plan, and the place where they put
/// what observers say about a sample. It serves one engine after the other, so
/// that it stays in the cache: engines that share it belong to one thread.
struct EngineParts {
  /// @throws DataError as EnginePlan.
  explicit EngineParts(std::shared_ptr<const ModelSet> models);
  EngineParts(std::shared_ptr<const EnginePlan> shared_plan,
              std::shared_ptr<ObserverOutputs> place);

  std::shared_ptr<const EnginePlan> plan;
  std::shared_ptr<ObserverOutputs> outputs;
  InstructionSet instructions{BestInstructionSet()};  ///< Same bits with any.
};

/// The parts in use, one per model set, for a thread that runs many engines.
///
/// One thread at a time: that of the engines.
class EnginePlans {
 public:
  /// The parts of this very object, made unless some engine still has them.
  /// @throws DataError as EnginePlan.
  EngineParts For(const std::shared_ptr<const ModelSet>& models);

 private:
  struct Known {
    std::weak_ptr<const EnginePlan> plan;
    std::weak_ptr<ObserverOutputs> outputs;
  };
  std::vector<Known> known_;
};

}  // namespace fdi
