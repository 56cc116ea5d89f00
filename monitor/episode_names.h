#pragma once

#include <cstdint>
#include <deque>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/strength_point.h"
#include "diagnosis/verdict.h"
#include "monitor/look_worker.h"
#include "simulator/second_look/episode_looks.h"

namespace fdi::monitor {

/// Names the episodes of one valve: as its engine does, with the memory of
/// simulator::ObserversMemory, until a second look has an answer. While one
/// counts, it is the name, and what the engine isolates meanwhile is not; see
/// simulator::LookBook. So what leaves the monitor is what `fdi-trainer
/// evaluate` scores. Routine looks may open an episode that the engine does not
/// see.
class EpisodeNames {
 public:
  /// @param worker outlives this.
  EpisodeNames(std::string valve_id, std::shared_ptr<const ModelSet> models,
               LookWorker::Physics physics, LookWorker& worker);

  /// `faults`, by an earlier session's look, name the episode that goes on
  /// until a look of this session has an answer; nothing: none goes on.
  void SetInheritedName(std::optional<FaultSet> faults) { inherited_ = faults; }

  /// Takes a sample and the verdict of the engine. @param held nothing is to be
  /// named; see ModelResolver::IsolationHeld().
  /// @returns the verdict with the name that counts; stands as long as `engine`
  ///   and until the next call.
  const Verdict& Step(const Sample& sample, const Verdict& engine, bool held);

  /// Whether the engine should have an episode: ValveEngine::Suspect().
  bool suspects() const { return suspects_; }

  /// The look whose answer counts since the last Step(), but for the id of its
  /// episode. Nothing if none began to count then.
  std::optional<EpisodeLook> TakeLook() {
    return std::exchange(look_, std::nullopt);
  }

  /// A look gave the open episode its name.
  bool by_physics() const { return by_physics_; }

  /// Asks how strong the faults are that the episode is named after by a look
  /// of this session, if it is. TakeStrengths() has the answer at some later
  /// time; it changes no name.
  void RequestGrowth();

  /// The strengths that looks have found since the last call, but for the id of
  /// their episode.
  std::vector<StrengthPoint> TakeStrengths() {
    return std::exchange(strength_points_, {});
  }

  /// The engine was made to end its episode. @returns `closed` with the name
  /// that counted.
  Transition End(Transition closed);

 private:
  // A look that was asked for.
  struct PendingLook {
    simulator::LookTask task;  // Without its rows.
    std::future<LookWorker::Answer> answer;
  };

  // A look for growth.
  struct PendingGrowth {
    std::int64_t middle_ns;  // Of its rows.
    std::int64_t look_ns;    // Of the look whose faults it knows.
    std::future<LookWorker::Answer> answer;
  };

  const simulator::LookAnswer* AnswerTo(const Verdict& engine, bool held);
  void RequestLook(simulator::LookTask task);
  void CollectAnswers();
  void CollectGrowth();
  void RecordStrengths(const simulator::LookAnswer& answer);
  void RecordStrength(const simulator::Explanation& e, std::int64_t stamp_ns);
  std::int64_t PeriodNs() const;
  void Name(const simulator::LookAnswer& answer,
            const std::vector<int>& faults);
  void SetName(FaultSet faults, Unknown unknown);
  EpisodeLook RecordOf(const simulator::LookAnswer& answer) const;
  void EmitNameChange();
  void WriteName(Transition& transition) const;
  void Reset();

  std::string valve_id_;
  std::shared_ptr<const ModelSet> models_;
  LookWorker::Physics physics_;
  LookWorker* worker_;
  std::optional<simulator::ValveLooks> looks_;  // Made anew at an end.
  std::deque<PendingLook> pending_looks_;
  std::optional<FaultSet> inherited_;
  std::int64_t stamp_ns_{0};
  std::int64_t detection_ns_{0};
  bool suspects_{false};
  // Of the open episode.
  bool own_{false};         // Its name was not the engine's, once at least.
  bool by_physics_{false};  // An answer counts.
  FaultSet faults_{0};      // Its name,
  Layer layer_{Layer::kObservers};
  // and what the look estimated, by fault index, likeliest first.
  std::vector<std::pair<std::size_t, double>> strengths_;
  std::int64_t look_ns_{0};  // Of the look that counts, its last row.
  std::optional<EpisodeLook> look_;
  std::vector<simulator::Explanation> known_;  // What it is named after.
  std::deque<PendingGrowth> pending_growth_;
  std::vector<StrengthPoint> strength_points_;
  Verdict verdict_;  // With that name.
};

}  // namespace fdi::monitor
