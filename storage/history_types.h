#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model_set.h"
#include "diagnosis/verdict.h"
#include "storage/sample_codec.h"

namespace fdi::storage {

/// "00c0ffee12345678": how an episode id is stored and shown.
std::string EpisodeIdText(std::uint64_t episode_id);

/// What the evidence file keeps of one sample of an episode.
struct TraceInstant {
  StoredSample received;
  Quality quality{Quality::kSettling};
  State state{State::kNormal};
  FaultSet isolated{0};
  double normal_factor{0.0};          ///< d_0
  std::vector<double> residuals;      ///< By channel; NaN where it abstains.
  std::vector<double> fault_factors;  ///< d by fault index.
};

/// The instant of `sample` and what the engine with `models` said about it.
TraceInstant MakeTraceInstant(const StoredSample& sample,
                              const Verdict& verdict, const ModelSet& models);

/// A transition with all that its record needs.
struct NewEvent {
  std::string valve_id;
  std::uint64_t source_id{0};
  Transition transition;
  const ModelSet* models{nullptr};  ///< That made the transition; not kept.
  std::int64_t recorded_ns{0};      ///< UTC now.
  /// Set if this goes on with an episode that was open when the monitor died;
  /// else the id follows from valve, source and detection stamp.
  std::optional<std::uint64_t> resumed_episode;
};

/// The id under which `event` is recorded.
std::uint64_t EpisodeIdOf(const NewEvent& event);

/// A recorded event. Of the transitions, all but `who`, `value`,
/// `comment`, `origin`.
struct EpisodeEvent {
  std::int64_t event_id{0};
  std::uint64_t episode_id{0};
  std::string kind;  ///< TransitionName(), or RESUMED, ACK, LABEL.
  std::int64_t stamp_ns{0};
  std::int64_t recorded_ns{0};
  std::string faults;  ///< Names joined by |.
  FaultSet fault_bits{0};
  double factor{0.0};
  double strength{0.0};
  std::string reason;
  std::string value;
  std::string who;
  std::string comment;
  std::string origin;  ///< Of what people did: from where.
};

/// An event that was committed but perhaps not handed to DDS.
struct UnsentEvent {
  std::int64_t event_id{0};
  std::uint64_t episode_id{0};
  std::string valve_id;
  std::uint64_t source_id{0};
  Transition transition;
  std::vector<int> faults;  ///< Numbers of the faults in transition.faults.
  std::string model_set;    ///< NAME@VERSION
  std::uint64_t model_hash{0};
};

/// The columns of the view fault_history, and what the tables add.
struct Episode {
  std::string episode_id;
  std::string valve_id;
  std::string detected_utc;
  std::optional<std::string> isolated_utc;
  std::optional<std::string> cleared_utc;
  std::optional<std::string> fault;
  double peak_factor{0.0};
  std::string model_set;
  std::optional<std::string> end_reason;
  std::optional<std::string> label;
  std::optional<std::string> acked_by;

  std::uint64_t id{0};
  std::uint64_t source_id{0};
  std::uint64_t model_hash{0};
  std::int64_t detected_ns{0};
  std::optional<std::int64_t> isolated_ns;
  std::optional<std::int64_t> cleared_ns;
  std::optional<std::int64_t> ended_ns;
  std::optional<std::int64_t> acked_ns;
  std::optional<std::int64_t> trace_end_ns;  ///< Last instant of the trace.
  std::optional<std::int64_t> session_id;
  FaultSet fault_bits{0};
  double strength{0.0};
  /// While no fault is isolated: "too_early" or "outside_known".
  std::optional<std::string> unknown_kind;
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  std::vector<std::string> channels;  ///< Of the trace.
  std::vector<std::string> faults;    ///< Of the trace, by index.
};

/// A time in which a valve, or all (empty valve_id), was not diagnosed or not
/// recorded.
struct DataGap {
  std::string valve_id;
  std::int64_t from_ns{0};
  std::int64_t to_ns{0};
  std::string reason;  ///< "monitor_down", "persistence_degraded", ...
};

/// One life of a monitor.
struct MonitorSession {
  std::int64_t session_id{0};
  std::int64_t start_ns{0};
  std::int64_t alive_ns{0};  ///< Last sign of life.
  std::optional<std::int64_t> stop_ns;
  bool clean{false};
  std::string software;
  std::string config;
};

enum class EpisodeState {
  kAny,
  kOpen,      ///< Not ended.
  kDetected,  ///< Open and not isolated.
  kIsolated,  ///< Open and isolated.
  kClosed,
  kUnacked,  ///< Active or not.
  // AlarmState; shelved ones are also in the state below.
  kAlarmUnacked,
  kAlarmAcked,
  kAlarmReturnedUnacked,
  kAlarmNormal,
  kAlarmShelved,
};

/// "any", "open", ... "UNACK", ..., in any case. @throws ConfigError naming the
/// accepted names.
EpisodeState ParseEpisodeState(std::string_view name);

/// Settings of HistoryReader::List().
struct EpisodeFilter {
  std::string valve_glob{"*"};  ///< As in a shell: * ? [...].
  std::string fault;            ///< Name, "unknown", or empty: any.
  std::int64_t since_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t until_ns{std::numeric_limits<std::int64_t>::max()};
  EpisodeState state{EpisodeState::kAny};
  std::int64_t limit{0};   ///< The newest so many; 0: all.
  std::int64_t now_ns{0};  ///< At which kAlarmShelved holds.
};

/// The words of ParseEpisodeState().
std::vector<std::string> EpisodeStateNames();

/// Episodes of one valve with one answer.
struct EpisodeStatistics {
  std::string valve_id;
  std::string fault;  ///< As in the view; "" while not isolated.
  std::int64_t episodes{0};
  std::int64_t open{0};
  std::int64_t unacked{0};
  std::int64_t labelled_true{0};           ///< Label true, or of the answer.
  std::int64_t labelled_false{0};          ///< Label false, or another fault.
  std::optional<double> mean_isolation_s;  ///< From detection.
  std::optional<double> mean_duration_s;   ///< Of the ended ones.
  double peak_factor{0.0};
  std::int64_t last_detected_ns{0};
};

}  // namespace fdi::storage
