#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "diagnosis/decision/episode_names.h"
#include "diagnosis/decision/valve_engine.h"
#include "diagnosis/model/held_readings.h"

namespace fdi {

/// Decides on one valve: whether it has an episode, what that is called, how
/// strong and how bad it is, when it ends, and when a simulation is to look at
/// it. Nothing else makes a transition of an episode that the observers, the
/// floor or a look have found. The monitor and `fdi-trainer evaluate` run this
/// very class. Each sample is handled in this order:
///
/// 0. repeats of a transmitter that is polled, or tells of changes alone, are
///    marked, and what it does not tell meanwhile is allowed for
///    (HeldReadings);
/// 1. the engine judges it, with the name and the suspicion of the sample
///    before it (ValveEngine);
/// 2. the looks that are due at it are noted (ValveLooks);
/// 3. its episode is named, and the strengths are followed (EpisodeName,
///    EpisodeStrengths).
///
/// No clock, no I/O, no thread: the results depend only on the order of calls.
/// One thread at a time for all that share EngineParts, as for ValveEngine.
class Decision {
 public:
  /// @param simulation null: no looks are due.
  Decision(EngineParts parts, std::shared_ptr<const LookSimulation> simulation,
           std::shared_ptr<const SeverityCatalogue> severities =
               std::make_shared<const SeverityCatalogue>());
  Decision(Decision&&) noexcept = default;
  Decision& operator=(Decision&&) noexcept = default;
  Decision(const Decision&) = delete;
  Decision& operator=(const Decision&) = delete;

  /// See EpisodeName::Inherit().
  void Inherit(const OpenEpisode* episode) { names_->Inherit(episode); }
  /// See ValveEngine::HoldIsolation().
  void HoldIsolation(bool hold);

  /// Takes the next sample in order of arrival. @returns the verdict with the
  /// name that counts; stands until the next call.
  const Verdict& Step(const Sample& measured);

  /// The looks that became due since the last call.
  std::vector<LookTask> TakeDue() { return names_->TakeDue(); }
  /// See EpisodeNames::Answer().
  void Answer(const LookTask& task, LookAnswer answer) {
    names_->Answer(task, std::move(answer));
  }

  /// Ends an open episode for a reason from outside. @returns its kClosed
  /// transition, or nothing if no episode was open.
  std::optional<Transition> End(EndReason reason);

  /// Continues with another model set, see ValveEngine::Adopt(). As
  /// End(kModelChanged).
  std::optional<Transition> Adopt(
      EngineParts parts, std::shared_ptr<const LookSimulation> simulation);

  /// See SourceOrder::ForgetSuperseded().
  void ForgetSuperseded() { engine_.ForgetSuperseded(); }

  /// Forgets names and looks, as a restart of the program does; what
  /// ValveEngine::Save() keeps over one stays.
  void ForgetNames();

  /// With the name that counts, as Step() gave it last; that of the engine
  /// after an end.
  const Verdict& verdict() const {
    return named_ != nullptr ? *named_ : engine_.verdict();
  }
  /// The verdict of the engine on the last sample, by itself.
  const Verdict& engine() const { return engine_.verdict(); }
  const EpisodeNames& names() const { return *names_; }
  /// Transmitters that are not read for each sample, although the model set
  /// knows them to be.
  SignalMask held() const { return held_readings_.held(); }
  bool episode_open() const { return engine_.episode_open(); }
  const std::shared_ptr<const LookSimulation>& simulation() const {
    return simulation_;
  }

  /// See EpisodeNames.
  std::optional<EpisodeLook> TakeLook() { return names_->TakeLook(); }
  std::vector<StrengthPoint> TakeStrengths() { return names_->TakeStrengths(); }

  /// See ValveEngine.
  std::vector<std::byte> Save() const { return engine_.Save(); }
  bool Restore(std::span<const std::byte> bytes) {
    return engine_.Restore(bytes);
  }

 private:
  std::shared_ptr<const ModelSet> models_;
  std::shared_ptr<const LookSimulation> simulation_;
  std::shared_ptr<const SeverityCatalogue> severities_;
  HeldReadings held_readings_;
  ValveEngine engine_;
  std::unique_ptr<EpisodeNames> names_;
  const Verdict* named_{nullptr};  // Null: an end came after the last sample.
  bool held_{false};
};

}  // namespace fdi
