#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "diagnosis/decision/episode_name.h"
#include "diagnosis/decision/episode_strengths.h"
#include "diagnosis/decision/valve_looks.h"
#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/strength_point.h"

namespace fdi {

/// Names the episodes of one valve (EpisodeName) and follows how strong their
/// faults are. It says which looks are due, and takes their answers, which
/// arrive between two samples, at once or many samples later.
class EpisodeNames {
 public:
  /// @param simulation null: no looks are taken.
  EpisodeNames(std::shared_ptr<const ModelSet> models,
               std::shared_ptr<const LookSimulation> simulation,
               std::shared_ptr<const SeverityCatalogue> severities =
                   std::make_shared<const SeverityCatalogue>());

  /// See EpisodeName::Inherit().
  void Inherit(const OpenEpisode* episode) { name_.Inherit(episode); }

  /// Takes a sample and the verdict of the engine. @param held nothing is to be
  /// named.
  /// @returns the verdict with the name that counts; stands until the next
  ///   call.
  const Verdict& Step(const Sample& sample, const Verdict& engine, bool held);

  /// The looks that became due since the last call.
  std::vector<LookTask> TakeDue() { return std::exchange(due_, {}); }

  /// The answer to a look that was due. It counts from the next Step() on, and
  /// for nothing where its episode is over.
  /// @param task may have lost the rows of its window.
  void Answer(const LookTask& task, LookAnswer answer);

  /// The engine was made to end its episode. @returns `closed` with the name
  /// that counted. Answers to looks that were due before count for nothing.
  Transition End(Transition closed);

  /// See EpisodeName::beside().
  const NameBeside& beside() const { return name_.beside(); }

  /// True if the engine should have an episode: ValveEngine::Suspect().
  bool suspects() const { return looks_ && looks_->suspects() && !held_; }

  /// The name of the open episode as of the last Step().
  const EpisodeNow& now() const { return name_.now(); }

  /// A look spoke in the place of the engine at the last Step().
  bool overruled() const { return overruled_; }

  /// The look whose answer counts since the last Step(), but for the id of its
  /// episode. Nothing if none began to count then.
  std::optional<EpisodeLook> TakeLook() {
    return std::exchange(look_, std::nullopt);
  }

  /// The strengths found by the last Step(), but for the id of their episode.
  std::vector<StrengthPoint> TakeStrengths() {
    return std::exchange(told_, {});
  }

  /// Makes a look due at how strong the faults are that a look of this session
  /// has named, if one has. Its answer changes no name.
  void RequestGrowth();

 private:
  void StepLooks(const Sample& sample, const Verdict& engine);
  std::optional<EpisodeName::Look> TakeAnswer(const Verdict& engine);
  void FollowStrengths(const Verdict& engine);
  bool HasMoved(const std::vector<StrengthPoint>& points) const;
  void AnswerGrowth(const LookTask& task, const LookAnswer& answer);
  void RecordStrengths(const LookAnswer& answer);
  void RecordStrength(const Explanation& e, std::int64_t stamp_ns);
  std::int64_t PeriodNs() const;
  EpisodeLook RecordOf(const LookAnswer& answer) const;
  void Reset();
  void ForgetEpisode();

  std::shared_ptr<const ModelSet> models_;
  std::shared_ptr<const LookSimulation> simulation_;
  EpisodeName name_;
  EpisodeStrengths strengths_;
  std::optional<ValveLooks> looks_;  // Restarted by an end from outside.
  std::vector<LookTask> due_;
  std::int64_t detection_ns_{0};
  bool open_{false};
  bool held_{false};
  bool overruled_{false};
  // About the open episode:
  std::int64_t look_ns_{0};  // Last row of the look that counts.
  std::optional<EpisodeLook> look_;
  std::vector<Explanation> known_;  // The faults that it is named after.
  std::vector<StrengthPoint> strength_points_;
  std::vector<StrengthPoint> told_;  // Reported by the last Step().
};

}  // namespace fdi
