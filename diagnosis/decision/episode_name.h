#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/decision/look.h"
#include "diagnosis/decision/name_beside.h"
#include "diagnosis/model/severity.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/fault_event.h"
#include "diagnosis/records/strength_point.h"

namespace fdi {

enum class Rule : std::uint8_t;

/// Who gave an episode its name.
enum class NameSource : std::uint8_t {
  kNone,       ///< It has no name.
  kFloor,      ///< A limit of the floor.
  kObservers,  ///< The observers.
  kLook,       ///< A simulation of the valve.
  kRestart,    ///< An earlier session; it still stands.
};

/// One fault of a name, with its strength.
struct NamedFault {
  std::size_t bit{0};  ///< Index in the model set.
  Estimate estimate{};
  Severity severity{Severity::kMedium};
};

/// An episode as of now: the only place that says what it is called, how strong
/// it is and how bad.
struct EpisodeNow {
  FaultSet faults{0};               ///< Empty: no name.
  Unknown unknown{Unknown::kNone};  ///< Why there is none.
  NameSource source{NameSource::kNone};
  Layer layer{Layer::kObservers};       ///< Layer that first named `faults`.
  std::vector<NamedFault> estimates{};  ///< One a fault, likeliest first.
  /// The gravest of `faults`, each at its own strength.
  Severity severity{Severity::kMedium};

  Estimate strength() const {
    return estimates.empty() ? Estimate{} : estimates.front().estimate;
  }
};

/// Decides what the open episode of one valve is called, from one sample to the
/// next. The inputs, the strongest first (Stage::kSource):
///
/// 1. a second look whose answer counts (LookBook);
/// 2. the name that an earlier session gave: one by a look until a look of this
///    session has an answer, or for ten minutes; then, like any other, until
///    the observers name a fault, for which the floor is not enough; with a
///    second fault on top, both until the first one is named by itself;
/// 3. the observers, and the floor until they have a name.
///
/// The engine is an input and never changed: its transitions that name a fault
/// are replaced by those of the name. A name that gets more severe than it was
/// when it was last announced is announced again (TransitionKind::kChanged).
///
/// A state machine: no thread, no clock.
class EpisodeName {
 public:
  /// The answer of a second look.
  struct Look {
    std::vector<NamedFault> faults;  ///< Likeliest first; empty: no name.
    bool outside{false};             ///< No hypothesis fits.
  };

  struct Inputs {
    const Verdict& engine;
    std::optional<Look> look{};
    bool can_look{false};          ///< Looks are taken at this valve.
    std::optional<Look> on_top{};  ///< At engine.second.
  };

  EpisodeName(std::shared_ptr<const ModelSet> models,
              std::shared_ptr<const SeverityCatalogue> severities);
  EpisodeName(const EpisodeName&) = delete;
  EpisodeName& operator=(const EpisodeName&) = delete;

  /// `episode`, left by an earlier session, is the one that the next detection
  /// continues; null: none is.
  void Inherit(const OpenEpisode* episode);

  /// The next sample. @returns the verdict with the name that counts; stands as
  ///   long as the engine's and until the next call.
  const Verdict& Step(const Inputs& inputs);

  /// Takes the strengths of the name's faults by now and ignores others. Only
  /// this tells whether the name gets more severe: the transition is added to
  /// verdict(). Points of the first fault get the severity of the name.
  void Follow(std::span<StrengthPoint> points);

  /// The engine was made to end its episode. @returns `closed` with the name.
  Transition End(Transition closed);

  /// As the last Step() returned it, with what Follow() has added.
  const Verdict& verdict() const { return *current_; }
  const EpisodeNow& now() const { return now_; }
  /// The name for ValveEngine::TakeName(): by a look.
  const NameBeside& beside() const { return beside_; }

 private:
  struct Choice {
    FaultSet faults{0};
    Unknown unknown{Unknown::kNone};
    NameSource source{NameSource::kNone};
    Layer layer{Layer::kObservers};
  };

  void Begin();
  Choice Choose(const Inputs& inputs);
  std::optional<Choice> SaidBy(Rule source, const Inputs& inputs);
  std::optional<Choice> OfLook(const Inputs& inputs);
  Choice OfObservers(const Inputs& inputs) const;
  bool InheritedStands(const Inputs& inputs) const;
  bool TakesTwoForOne(FaultSet faults) const;
  void FollowLook(const Inputs& inputs);
  void FollowSecond(const Inputs& inputs);
  void Rename(const Choice& choice, const Inputs& inputs);
  void Estimates(const Inputs& inputs);
  const SeverityBands& BandsOf(int fault) const;
  void Announce(TransitionKind kind);
  void WriteName(Transition& transition) const;
  void WriteVerdict();
  void Reset();

  std::shared_ptr<const ModelSet> models_;
  std::shared_ptr<const SeverityCatalogue> severities_;
  FaultSet findings_;           // Bits of what the floor finds.
  std::int64_t look_patience_;  // Samples that an inherited look waits.
  std::optional<OpenEpisode> inherited_;
  std::int64_t waited_{0};  // Samples since it was inherited.
  std::int64_t detection_ns_{0};
  bool open_{false};
  bool named_{false};  // The episode has had a name.
  NameBeside beside_;
  SecondFault second_;  // As it was announced last.
  Severity announced_{Severity::kMedium};
  EpisodeNow now_;
  Verdict verdict_;  // With the name.
  const Verdict* current_{&verdict_};
};

/// The faults that a look names beside the observers (NamesBeside()), in their
/// order of likelihood. Faults that the set does not have cannot be recorded
/// and stay out. @returns nothing where the look does not count.
/// @param answer null: there is none.
std::optional<EpisodeName::Look> LookThatCounts(const Verdict& engine,
                                                const ModelSet& models,
                                                const LookAnswer* answer);

/// The same for a second fault, on top of the one of the episode.
std::optional<EpisodeName::Look> SecondThatCounts(const Verdict& engine,
                                                  const ModelSet& models,
                                                  const LookAnswer* answer);

}  // namespace fdi
