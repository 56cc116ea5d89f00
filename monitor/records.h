#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/sample.h"
#include "diagnosis/verdict.h"
#include "monitor/trace.h"

namespace fdi::monitor {

/// A fault in the running of an episode.
struct Candidate {
  int fault{0};          ///< 1..22
  double factor{0.0};    ///< Decision factor at the transition [-].
  double strength{0.0};  ///< Estimated; signed.
  bool isolated{false};  ///< Member of the isolated set.
};

/// The faults of `verdict` in the running for `isolated`: its members, and
/// whose factor is at least half the isolation threshold; largest factor first.
std::vector<Candidate> CandidatesOf(const ModelSet& models,
                                    const Verdict& verdict, FaultSet isolated);

/// A step in the life of an episode, with all that history and bus need.
struct EpisodeEvent {
  std::string valve_id;
  std::uint64_t source_id{0};  ///< Of the episode.
  std::uint64_t seq{0};        ///< Of the sample at the transition.
  std::uint64_t episode_id{0};
  Transition transition;
  /// In the running. At the end of an episode that got no name: those that
  /// could explain it last; none if it is outside all known faults.
  std::vector<Candidate> candidates;
  /// That made the transition; null if an earlier session did.
  std::shared_ptr<const ModelSet> models;
  std::string model_set;
  int model_version{0};
  std::uint64_t model_hash{0};
};

/// Evidence of an episode, in the order in which it was gathered.
struct EpisodeTrace {
  std::uint64_t episode_id{0};
  Trace trace;
  bool complete{false};  ///< Nothing follows.
};

/// A time without diagnosis of one valve, or of all if `valve_id` is empty.
struct DataGap {
  std::string valve_id;
  std::int64_t from_ns{0};
  std::int64_t to_ns{0};
  std::string reason;  ///< "monitor_down", "stream", "persistence_degraded".
};

/// An episode that the last session left open.
struct OpenEpisode {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t episode_id{0};
  std::int64_t detection_stamp_ns{0};
  std::int64_t last_stamp_ns{0};      ///< Last instant known of the valve.
  FaultSet faults{0};                 ///< The set isolated last, if any.
  std::vector<Candidate> candidates;  ///< Its members.
  bool isolated{false};
  std::string model_set;
  int model_version{0};
  std::uint64_t model_hash{0};
};

/// A sample as it was received, with what became of it.
struct ReceivedSample {
  std::string valve_id;
  Sample sample;
  Intake intake{Intake::kAccepted};
  bool initialised{false};    ///< The observers were initialised here.
  bool model_swapped{false};  ///< Another model set answered from here on.
  bool ended{false};          ///< No sample: the stream of the valve ended.
};

}  // namespace fdi::monitor
