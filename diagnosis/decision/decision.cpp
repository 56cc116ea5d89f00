#include "diagnosis/decision/decision.h"

namespace fdi {

Decision::Decision(EngineParts parts,
                   std::shared_ptr<const LookSimulation> simulation,
                   std::shared_ptr<const SeverityCatalogue> severities)
    : models_(parts.plan->shared_models()),
      simulation_(std::move(simulation)),
      severities_(std::move(severities)),
      held_readings_(models_->sample_period_s, models_->every),
      engine_(std::move(parts)) {
  ForgetNames();
}

const Verdict& Decision::Step(const Sample& measured) {
  Sample sample = measured;
  held_readings_.Mark(sample);
  engine_.Allow(held_readings_.unseen());
  engine_.Suspect(names_->suspects());
  engine_.TakeName(names_->beside());
  const Verdict& verdict = engine_.Step(sample);
  // A look takes the readings that the observers took, but for a valve that is
  // judged at its position, whose samples the engine has changed already.
  const Sample* const judged =
      models_->position_as_command ? nullptr : engine_.judged();
  named_ = &names_->Step(judged != nullptr ? *judged : sample, verdict, held_);
  return *named_;
}

std::optional<Transition> Decision::End(EndReason reason) {
  std::optional<Transition> closed = engine_.EndEpisode(reason);
  named_ = nullptr;
  return closed ? std::optional(names_->End(*closed)) : std::nullopt;
}

std::optional<Transition> Decision::Adopt(
    EngineParts parts, std::shared_ptr<const LookSimulation> simulation) {
  std::shared_ptr<const ModelSet> models = parts.plan->shared_models();
  std::optional<Transition> closed = engine_.Adopt(std::move(parts));
  if (closed) {
    closed = names_->End(*closed);  // With the set that named it.
  }
  models_ = std::move(models);
  held_readings_ = HeldReadings(models_->sample_period_s, models_->every);
  simulation_ = std::move(simulation);
  ForgetNames();
  return closed;
}

void Decision::ForgetNames() {
  named_ = nullptr;
  names_ = std::make_unique<EpisodeNames>(models_, simulation_, severities_);
}

void Decision::HoldIsolation(bool hold) {
  held_ = hold;
  engine_.HoldIsolation(hold);
}

}  // namespace fdi
