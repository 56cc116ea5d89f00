#pragma once

#include <memory>
#include <vector>

#include "diagnosis/decision/fault_plan.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/observers/observer_kernels.h"
#include "diagnosis/observers/observer_plan.h"

namespace fdi {

/// A model set prepared for engines: validated and laid out for evaluation.
/// This takes some milliseconds, once for all valves of the set. Immutable and
/// thread safe.
class EnginePlan {
 public:
  /// @throws DataError if `models` is invalid (Validate).
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

/// Shared by the engines of one model set: its plan, and a buffer for the
/// outputs of the observers for one sample. Engines use the buffer one after
/// the other, which keeps it in the cache; so they must belong to one thread.
struct EngineParts {
  /// @throws DataError as EnginePlan.
  explicit EngineParts(std::shared_ptr<const ModelSet> models);
  EngineParts(std::shared_ptr<const EnginePlan> shared_plan,
              std::shared_ptr<ObserverOutputs> place);

  std::shared_ptr<const EnginePlan> plan;
  std::shared_ptr<ObserverOutputs> outputs;
  InstructionSet instructions{BestInstructionSet()};  ///< Same bits with any.
};

/// Cache of the parts in use, one per model set, for a thread that runs many
/// engines.
///
/// Used by the thread of the engines only.
class EnginePlans {
 public:
  /// The parts for this object, created unless an engine still uses them.
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
