#include "diagnosis/engine_plan.h"

#include "diagnosis/error.h"

namespace fdi {
namespace {

std::shared_ptr<const ModelSet> Checked(
    std::shared_ptr<const ModelSet> models) {
  Require(models != nullptr, "the engine needs a model set");
  Validate(*models);
  return models;
}

}  // namespace

EnginePlan::EnginePlan(std::shared_ptr<const ModelSet> models)
    : models_(Checked(std::move(models))),
      required_(RequiredSignals(*models_)),
      observers_(std::make_shared<const ObserverPlan>(*models_)),
      faults_(std::make_shared<const FaultPlan>(observers_)) {}

std::shared_ptr<const EnginePlan> EnginePlans::For(
    const std::shared_ptr<const ModelSet>& models) {
  std::erase_if(plans_, [](const auto& plan) { return plan.expired(); });
  for (const std::weak_ptr<const EnginePlan>& known : plans_) {
    std::shared_ptr<const EnginePlan> plan = known.lock();
    if (plan && plan->shared_models() == models) {
      return plan;
    }
  }
  auto plan = std::make_shared<const EnginePlan>(models);
  plans_.push_back(plan);
  return plan;
}

}  // namespace fdi
