#include "diagnosis/decision/engine_plan.h"

#include "base/error.h"

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

EngineParts::EngineParts(std::shared_ptr<const ModelSet> models)
    : plan(std::make_shared<const EnginePlan>(std::move(models))),
      outputs(std::make_shared<ObserverOutputs>(*plan->observers())) {}

EngineParts::EngineParts(std::shared_ptr<const EnginePlan> shared_plan,
                         std::shared_ptr<ObserverOutputs> place)
    : plan(std::move(shared_plan)), outputs(std::move(place)) {}

EngineParts EnginePlans::For(const std::shared_ptr<const ModelSet>& models) {
  std::erase_if(known_, [](const Known& known) {
    return known.plan.expired() || known.outputs.expired();
  });
  for (const Known& known : known_) {
    auto plan = known.plan.lock();
    auto outputs = known.outputs.lock();
    if (plan && outputs && plan->shared_models() == models) {
      return {std::move(plan), std::move(outputs)};
    }
  }
  EngineParts parts(models);
  known_.push_back({parts.plan, parts.outputs});
  return parts;
}

}  // namespace fdi
