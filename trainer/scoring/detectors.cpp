#include "trainer/scoring/detectors.h"

#include <vector>

#include "diagnosis/fault_catalogue.h"
#include "diagnosis/quality_count.h"
#include "simulator/second_look/episode_looks.h"
#include "simulator/second_look/valve_physics.h"
#include "trainer/campaign/run_input.h"
#include "trainer/parallel_for.h"
#include "trainer/scoring/rescore.h"

namespace fdi::trainer {
namespace {

// What the second look makes of the indications: while an episode has an answer
// of the physics, that is the set.
class SecondLooks {
 public:
  explicit SecondLooks(const ModelSet& models)
      : models_(models),
        physics_(simulator::PhysicsFrom(models.physics)),
        looks_(std::in_place, physics_) {}

  bool suspects() const { return looks_->suspects(); }
  void BeginAnew() { looks_.emplace(physics_); }

  void Watch(const Sample& sample, const Verdict& verdict) {
    if (const auto task = looks_->Step(sample, verdict)) {
      if (auto answer = simulator::TakeLook(physics_, *task)) {
        looks_->Enter(*task, std::move(*answer));
      }
    }
    if (OutOfOrder(verdict.intake)) {
      return;
    }
    sets_.push_back(NamesAt(verdict.isolated));
  }

  void Apply(std::vector<Indication>& indications) const {
    for (std::size_t k = 0; k < indications.size(); ++k) {
      if (sets_[k]) {
        indications[k].isolated = *sets_[k];
        indications[k].withdrawn = sets_[k]->empty();
      }
    }
  }

 private:
  // Nothing if what the engine says stands.
  std::optional<std::vector<int>> NamesAt(FaultSet isolated) const {
    if (const simulator::LookAnswer* answer = looks_->Answer()) {
      if (auto names = simulator::NamesOf(
              *answer, simulator::ObserversName(models_, isolated))) {
        // A finding that the set does not have, no name can hold.
        std::erase_if(*names, [this](int fault) {
          return IsFinding(fault) && FaultIndex(models_, fault) < 0;
        });
        return names;
      }
    }
    const FaultSet observed = looks_->Observed(models_, isolated);
    return observed == isolated ? std::nullopt
                                : std::optional(FaultsIn(models_, observed));
  }

  const ModelSet& models_;
  simulator::ValvePhysics physics_;
  std::optional<simulator::ValveLooks> looks_;
  std::vector<std::optional<std::vector<int>>> sets_;
};

Answer FollowEngine(const std::shared_ptr<const ModelSet>& models,
                    const ScoredRun& scored, const VerdictSink& sink) {
  QualityCount samples;
  std::optional<SecondLooks> looks;
  if (!models->physics.empty()) {
    looks.emplace(*models);
  }
  OutsideKnowledge outside;
  if (looks) {
    outside = {[&looks] { return looks->suspects(); },
               [&looks] { looks->BeginAnew(); }};
  }
  const auto watch = [&](const Sample& sample, const Verdict& verdict) {
    if (CountsAsTime(verdict)) {
      samples.Add(verdict.quality);
    }
    if (looks) {
      looks->Watch(sample, verdict);
    }
    if (sink) {
      sink(sample, verdict);
    }
  };
  Answer answer;
  answer.indications = Rescore(models, scored.run, watch, outside);
  if (looks) {
    looks->Apply(answer.indications);
  }
  answer.seconds.emplace();
  for (std::size_t q = 0; q < kQualityCount; ++q) {
    (*answer.seconds)[q] =
        models->sample_period_s *
        static_cast<double>(samples[static_cast<Quality>(q)]);
  }
  return answer;
}

}  // namespace

Detector EngineDetector(const std::shared_ptr<const ModelSet>& models) {
  return {models->name,
          models->version,
          models->groups,
          RequiredSignals(*models),
          [models](const ScoredRun& run, const VerdictSink& sink) {
            return FollowEngine(models, run, sink);
          },
          simulator::FlowTargetOf(*models)};
}

EvaluatedRun Evaluate(const Detector& detector, const ScoredRun& run,
                      const EvaluationSettings& settings) {
  const Answer answer = detector.follow(
      run, settings.watch ? settings.watch(run) : VerdictSink{});
  EvaluatedRun result;
  result.indices = ComputeIndices(answer.indications, run.horizon_s);
  result.indices.run_id = run.name;
  result.has_truth = settings.assume_normal || HasTruth(run.run);
  result.duration_s = run.run.info.run.period_s *
                      static_cast<double>(answer.indications.size());
  result.seconds = answer.seconds;
  for (const Indication& indication : answer.indications) {
    if (!indication.isolated.empty() || indication.withdrawn) {
      result.last_set = indication.isolated;
    }
  }
  if (settings.scored) {
    settings.scored(run, result, answer.indications);
  }
  return result;
}

std::vector<EvaluatedRun> Evaluate(const Detector& detector,
                                   const std::vector<ScoredRun>& runs,
                                   const EvaluationSettings& settings) {
  std::vector<EvaluatedRun> results(runs.size());
  ParallelFor(static_cast<int>(runs.size()), settings.threads, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    results[r] = Evaluate(detector, runs[r], settings);
  });
  return results;
}

}  // namespace fdi::trainer
