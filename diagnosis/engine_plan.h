#pragma once

#include <memory>
#include <vector>

#include "diagnosis/fault_plan.h"
#include "diagnosis/model_set.h"
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

/// The plans in use, one per model set, for those who are given model sets.
///
/// One thread at a time.
class EnginePlans {
 public:
  /// The plan of this very object, made unless some engine still has it.
  /// @throws DataError as EnginePlan.
  std::shared_ptr<const EnginePlan> For(
      const std::shared_ptr<const ModelSet>& models);

 private:
  std::vector<std::weak_ptr<const EnginePlan>> plans_;
};

}  // namespace fdi
