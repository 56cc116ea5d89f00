#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// A fault that may explain an episode.
struct FaultCandidate {
  int fault{0};  ///< A fault or finding, see diagnosis/model/fault_catalogue.h.
  double factor{0.0};    ///< Decision factor d at the transition [-].
  double strength{0.0};  ///< Estimated; signed [-].
  bool isolated{false};  ///< Member of the isolated set.
};

/// The faults of `verdict` that may explain an episode: the members of
/// `isolated`, and those whose factor is at least half the isolation threshold;
/// largest factor first.
std::vector<FaultCandidate> CandidatesOf(const ModelSet& models,
                                         const Verdict& verdict,
                                         FaultSet isolated);

/// A transition of an episode, as stored in the history and published on the
/// topic FaultEvent.
struct FaultEvent {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t seq{0};  ///< Number of the sample at the transition.
  std::uint64_t episode_id{0};
  Transition transition;
  /// The faults that may explain the episode, largest factor first. When an
  /// unnamed episode ends: its last candidates; none if it is outside all known
  /// faults.
  std::vector<FaultCandidate> candidates;
  std::string model_set;  ///< NAME, without the version.
  int model_version{0};
  std::uint64_t model_hash{0};
  bool persisted{false};  ///< Committed to the history before it was published.
  bool resent{false};     ///< From an earlier session. Neither stored nor sent.
  /// The model set that made the transition; null if an earlier session made
  /// it. Neither stored nor sent.
  std::shared_ptr<const ModelSet> models{};
};

/// The members of FaultEvent that are stored and sent unchanged, as an X-macro.
#define FDI_FAULT_EVENT_FIELDS(FIELD) \
  FIELD(valve_id)                     \
  FIELD(source_id)                    \
  FIELD(seq)                          \
  FIELD(episode_id)                   \
  FIELD(model_set) FIELD(model_version) FIELD(model_hash) FIELD(persisted)

/// The kind as it is on the bus, whose types cannot grow: a rise of priority,
/// or a second fault, is an isolation of the same faults. A notice is not on
/// the bus, so one that becomes an alarm begins there, with its name if it has
/// one.
constexpr TransitionKind OnTheBus(TransitionKind kind, bool named = true) {
  switch (kind) {
    case TransitionKind::kChanged:
    case TransitionKind::kSecond:
      return TransitionKind::kReisolated;
    case TransitionKind::kRaised:
      return named ? TransitionKind::kIsolated : TransitionKind::kDetected;
    default:
      return kind;
  }
}

/// The severity of the episode by `event`: that of its transition, or else the
/// gravest of the faults that it is named after.
Severity SeverityOf(const FaultEvent& event,
                    const SeverityCatalogue& catalogue);

/// An episode that the last session left open.
struct OpenEpisode {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t episode_id{0};
  std::int64_t detection_stamp_ns{0};
  std::int64_t last_stamp_ns{0};           ///< Stamp of the last known instant.
  FaultSet faults{0};                      ///< The last isolated set, if any.
  std::vector<FaultCandidate> candidates;  ///< Its members.
  bool isolated{false};
  Layer layer{Layer::kObservers};    ///< Layer that named them.
  std::optional<Severity> severity;  ///< As last stored.
  SecondFault second;                ///< Fault on top of them.
  double share{0.0};                 ///< As last stored (Verdict::share).
  bool notice{false};
  std::string model_set;
  int model_version{0};
  std::uint64_t model_hash{0};
};

}  // namespace fdi
