#include "trainer/scoring/detectors.h"

#include <vector>

#include "diagnosis/fault_catalogue.h"
#include "diagnosis/quality_count.h"
#include "simulator/second_look/episode_looks.h"
#include "simulator/second_look/taught_names.h"
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
    Name name{NamesAt(verdict), {}};
    if (name.faults) {
      const bool stays = !names_.empty() && name.faults == names_.back().faults;
      const bool by_look = looks_->Answer() != nullptr;
      name.wording =
          stays ? names_.back().wording
                : WordingOf(models_, verdict, *name.faults,
                            by_look ? Layer::kPhysics : Layer::kObservers);
    }
    names_.push_back(std::move(name));
  }

  void Apply(std::vector<Indication>& indications) const {
    for (std::size_t k = 0; k < indications.size(); ++k) {
      if (names_[k].faults) {
        indications[k].isolated = *names_[k].faults;
        indications[k].withdrawn = names_[k].faults->empty();
        indications[k].wording = names_[k].wording;
      }
    }
  }

 private:
  // Instead of what the engine says, which stands where there are no faults.
  struct Name {
    std::optional<std::vector<int>> faults;
    Wording wording;
  };

  // Nothing if what the engine says stands.
  std::optional<std::vector<int>> NamesAt(const Verdict& verdict) const {
    const FaultSet isolated = verdict.isolated;
    if (const simulator::LookAnswer* answer = looks_->Answer()) {
      if (auto names = simulator::NamesBeside(verdict, models_, *answer)) {
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
  std::vector<Name> names_;
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
      if (indication.isolated.empty() ||
          indication.isolated != result.last_set) {
        result.last_wording = indication.wording;
      }
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
