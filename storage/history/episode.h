#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/verdict.h"
#include "diagnosis/records/fields.h"

namespace fdi::storage {

/// Text form of an episode id: "00c0ffee12345678".
std::string EpisodeIdText(std::uint64_t episode_id);
/// The inverse; nothing unless the text is 16 lower-case hex digits.
std::optional<std::uint64_t> ParseEpisodeId(std::string_view text);

/// An entry in an episode's history: a transition or an operator action.
struct HistoryEntry {
  std::int64_t event_id{0};
  std::string kind;  ///< TransitionName(), or RESUMED, ACK, LABEL.
  std::int64_t stamp_ns{0};
  std::int64_t recorded_ns{0};
  std::string faults;  ///< Names joined by |.
  FaultSet fault_bits{0};
  double factor{0.0};
  double strength{0.0};
  std::string reason;
  std::string layer;  ///< LayerName() of the layer that named it.
  std::string value;  ///< Value of LABEL.
  std::string who;
  std::string comment;
  std::string origin;  ///< Where an operator action came from.
  std::optional<std::int64_t> priority;  ///< Priority from then on.
  std::uint64_t episode_id{0};
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

  std::string host;  ///< Host of the monitor; plant history only.
  std::string monitor;
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
  std::optional<std::string> layer;  ///< LayerName(); null until isolated.
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  std::vector<std::string> channels;  ///< Channels of the trace.
  std::vector<std::string> faults;    ///< Faults of the trace, by index.
  /// KnownFaults() of its set.
  std::vector<std::string> known;
  std::optional<double> lowest;  ///< Ends of the 95 % interval of strength.
  std::optional<double> highest;
  /// The largest strength since it has its name, whatever its sign.
  std::optional<double> worst_strength;
  /// 1 (critical) to 4 (low), as of now; null: not known.
  std::optional<std::int64_t> priority;
  /// The data ended then, for good or for now, and the fault has not been seen
  /// to be gone since.
  std::optional<std::int64_t> unconfirmed_ns;
  /// In plain words, as the monitor's catalogue has them; nothing before a name
  /// or where no monitor has said so.
  std::optional<std::string> fault_name;
  std::optional<std::string> ack_comment;
  /// Faults on top of the first one: names joined by |, or "unknown".
  std::optional<std::string> second;
  /// The finding of the audit of its loop that this episode took over.
  std::optional<std::string> audit;
  /// The look that counts (EpisodeLook) has found: the fault that explains the
  /// episode best among those that are not named, how many times larger its
  /// mean square error is, and what the observers named then, joined by |.
  /// Nothing without a look.
  std::optional<std::string> rival;
  std::optional<double> rival_times;
  std::optional<std::string> observers;
  /// The technical name of the fault, as the paper has it; likewise.
  std::optional<std::string> description;
  /// In so many hours a healthy valve shows that once; nothing: not known.
  std::optional<double> return_hours;
  /// Not rare enough for the budget of alarms: nobody is alarmed.
  bool notice{false};
};

/// True if its faults have a name, and with it a strength.
bool IsNamed(const Episode& episode);

/// One run of the monitor process.
struct MonitorSession {
  std::int64_t session_id{0};
  std::int64_t start_ns{0};
  std::int64_t alive_ns{0};  ///< Last heartbeat.
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
  kAlarmNotice,
};

/// Parses "any", "open", ... "UNACK", ..., ignoring case. @throws ConfigError
/// naming the accepted names.
EpisodeState ParseEpisodeState(std::string_view name);

/// Settings of HistoryReader::List().
struct EpisodeFilter {
  std::string valve_glob{"*"};  ///< Shell pattern: * ? [...].
  std::string fault;            ///< Name, "unknown", or empty: any.
  std::int64_t since_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t until_ns{std::numeric_limits<std::int64_t>::max()};
  EpisodeState state{EpisodeState::kAny};
  std::int64_t limit{0};   ///< Only the newest ones; 0: all.
  std::int64_t now_ns{0};  ///< Time at which kAlarmShelved is evaluated.
};

/// The names that ParseEpisodeState() accepts.
std::vector<std::string> EpisodeStateNames();

/// Time that one valve spent in one quality, over the days of a filter.
struct CoverageTime {
  std::string valve_id;
  std::string quality;  ///< QualityName().
  std::int64_t samples{0};
  double hours{0.0};
};

}  // namespace fdi::storage

FDI_FIELDS(fdi::storage::HistoryEntry, event_id, kind, stamp_ns, recorded_ns,
           faults, fault_bits, factor, strength, reason, layer, value, who,
           comment, origin, priority)

FDI_FIELDS(fdi::storage::Episode, episode_id, valve_id, detected_utc,
           isolated_utc, cleared_utc, fault, peak_factor, model_set, end_reason,
           label, acked_by, source_id, model_hash, detected_ns, isolated_ns,
           cleared_ns, ended_ns, acked_ns, trace_end_ns, session_id, fault_bits,
           strength, unknown_kind, layer, flow_unit, channels, faults, known,
           lowest, highest, worst_strength, priority, unconfirmed_ns,
           fault_name, ack_comment, second, audit, rival, rival_times,
           observers, description, return_hours, notice)

FDI_FIELDS(fdi::storage::MonitorSession, session_id, start_ns, alive_ns,
           stop_ns, clean, software, config)

FDI_FIELDS(fdi::storage::CoverageTime, valve_id, quality, samples, hours)
