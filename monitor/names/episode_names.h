#pragma once

#include <cstdint>
#include <deque>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/decision/episode_name.h"
#include "diagnosis/decision/episode_strengths.h"
#include "diagnosis/decision/valve_looks.h"
#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/strength_point.h"
#include "monitor/names/look_worker.h"

namespace fdi::monitor {

/// The episodes of one valve and what EpisodeName calls them: asks for second
/// looks and for strengths when they are due, and gives it the answers. So what
/// leaves the monitor is what `fdi-trainer evaluate` scores. Routine looks may
/// open an episode that the engine does not see.
class EpisodeNames {
 public:
  /// @param physics null: no looks are taken. @param worker outlives this; null
  ///   only without physics.
  EpisodeNames(std::string valve_id, std::shared_ptr<const ModelSet> models,
               LookWorker::Physics physics, LookWorker* worker,
               std::shared_ptr<const SeverityCatalogue> severities =
                   std::make_shared<const SeverityCatalogue>());

  /// See EpisodeName::Inherit().
  void Inherit(const OpenEpisode* episode) { name_.Inherit(episode); }

  /// Takes a sample and the verdict of the engine. @param held nothing is to be
  /// named; see ModelResolver::IsolationHeld().
  /// @returns the verdict with the name that counts; stands until the next
  ///   call.
  const Verdict& Step(const Sample& sample, const Verdict& engine, bool held);

  /// What the open episode is called as of the last Step().
  const EpisodeNow& now() const { return name_.now(); }

  /// See EpisodeName::beside().
  NameBeside beside() const { return name_.beside(); }

  /// Whether the engine should have an episode: ValveEngine::Suspect().
  bool suspects() const { return suspects_; }

  /// The look whose answer counts since the last Step(), but for the id of its
  /// episode. Nothing if none began to count then.
  std::optional<EpisodeLook> TakeLook() {
    return std::exchange(look_, std::nullopt);
  }

  /// Asks how strong the faults are that the episode is named after by a look
  /// of this session, if it is; called when that is due. The answer comes at
  /// some later Step() and changes no name.
  void RequestGrowth();

  /// The strengths found since the last call, but for the id of their episode.
  std::vector<StrengthPoint> TakeStrengths() {
    return std::exchange(strength_points_, {});
  }

  /// The engine was made to end its episode. @returns `closed` with the name
  /// that counted.
  Transition End(Transition closed);

 private:
  // A look that was asked for.
  struct PendingLook {
    LookTask task;  // Without its rows.
    std::future<LookWorker::Answer> answer;
  };

  // A look for growth.
  struct PendingGrowth {
    std::int64_t middle_ns;  // Of its rows.
    std::int64_t look_ns;    // Of the look whose faults it knows.
    std::future<LookWorker::Answer> answer;
  };

  void StepLooks(const Sample& sample, const Verdict& engine, bool held);
  std::optional<EpisodeName::Look> TakeAnswer(const Verdict& engine);
  void FollowStrengths(const Verdict& engine);
  bool HasMoved(const std::vector<StrengthPoint>& points) const;
  void RequestLook(LookTask task);
  void CollectAnswers();
  void CollectGrowth();
  void RecordStrengths(const LookAnswer& answer);
  void RecordStrength(const Explanation& e, std::int64_t stamp_ns);
  std::int64_t PeriodNs() const;
  EpisodeLook RecordOf(const LookAnswer& answer) const;
  void Reset();
  void ForgetEpisode();

  std::string valve_id_;
  std::shared_ptr<const ModelSet> models_;
  LookWorker::Physics physics_;
  LookWorker* worker_;
  EpisodeName name_;
  EpisodeStrengths strengths_;
  std::optional<ValveLooks> looks_;  // Made anew at an end.
  std::deque<PendingLook> pending_looks_;
  std::int64_t detection_ns_{0};
  bool suspects_{false};
  // Of the open episode.
  std::int64_t look_ns_{0};  // Of the look that counts, its last row.
  std::optional<EpisodeLook> look_;
  std::vector<Explanation> known_;  // What it is named after.
  std::deque<PendingGrowth> pending_growth_;
  std::vector<StrengthPoint> strength_points_;
};

}  // namespace fdi::monitor
