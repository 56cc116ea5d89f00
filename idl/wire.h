#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/printable.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/fault_event.h"
#include "diagnosis/records/monitor_share.h"

/// The messages on the wire as plain structs, one per topic.
/// Doubles are transmitted bit for bit, including NaN.
namespace fdi::idl {

/// Lengths in bytes, besides kMaxIdLength; a longer text is rejected, never
/// truncated.
inline constexpr std::size_t kMaxNameLength = 32;  ///< Channel, counter.
inline constexpr std::size_t kMaxTextLength = 255;
inline constexpr std::size_t kMaxGroups = 64;
inline constexpr std::size_t kMaxCounters = 64;
inline constexpr std::size_t kMaxBatch = 128;

/// Range of sample stamps, 1900 to 2100: differences cannot overflow.
inline constexpr std::int64_t kMinStampNs = -2'208'988'800'000'000'000;
inline constexpr std::int64_t kMaxStampNs = 4'102'444'800'000'000'000;

/// UTC [ns] of a stamp that Fast DDS gave a message. RTPS counts seconds since
/// 1970 in 32 bits (RTPS 2.5, 9.3.2), which the library reads as signed: in
/// January 2038 its stamps go back to 1901. Read as unsigned they last until
/// 2106.
constexpr std::int64_t UtcOfStamp(std::int64_t stamp_ns) {
  constexpr std::int64_t kWrapNs = (std::int64_t{1} << 32) * 1'000'000'000;
  return stamp_ns < 0 ? stamp_ns + kWrapNs : stamp_ns;
}

/// Topics fdi/v1/ValveSample and, with PV, fdi/v2/ValveSample; key valve_id.
struct ValveSampleMessage {
  std::string valve_id;
  Sample sample;
};

/// Topic fdi/v1/DecisionVector, key valve_id. Each array in `verdict` is sent
/// up to its count (channel_count, fault_count, observer_count); transitions
/// are not: they are FaultEvents.
struct DecisionMessage {
  std::string valve_id;
  std::uint64_t model_hash{0};  ///< ModelSet::content_hash; 0 if unassigned.
  int channel_count{0};
  int fault_count{0};
  int observer_count{0};
  Verdict verdict;
};

/// Topic fdi/v1/DecisionBatch, key monitor: vectors in the order of diagnosis.
struct DecisionBatchMessage {
  std::string monitor;
  std::vector<DecisionMessage> vectors;  ///< At most kMaxBatch.
};

struct ObserverInfo {
  std::string name;
  int fault{0};  ///< 0 = normal.
  double strength{0.0};
};

/// Topic fdi/v1/ModelSetInfo, key (model_set, model_hash): what the arrays of
/// a DecisionVector with this hash mean.
struct ModelSetInfoMessage {
  std::string model_set;
  std::uint64_t model_hash{0};
  int version{0};
  std::int64_t created_ns{0};
  double sample_period_s{1.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  SignalMask required{0};
  double isolation_threshold{0.0};  ///< T
  double isolation_fraction{0.0};   ///< Share of the t_k samples with d ≥ T.
  int detection_samples{0};         ///< n_d
  int isolation_samples{0};         ///< t_k
  int clearing_samples{0};          ///< t_c
  int settling_samples{0};
  std::vector<ChannelSpec> channels;
  std::vector<int> faults;  ///< Bit i of a fault set stands for faults[i].
  std::vector<ObserverInfo> observers;
  std::vector<int> undetectable;
  std::vector<std::vector<int>> groups;
};

enum class Health : std::uint8_t { kOk, kDegraded, kFailing };
std::string_view HealthName(Health health);  ///< "OK", ...

/// Topic fdi/v1/MonitorStatus, key monitor.
struct MonitorStatusMessage {
  std::string monitor;  ///< Unique name of the process, e.g. host:pid.
  std::string software;
  std::int64_t started_ns{0};
  std::int64_t stamp_ns{0};
  Health health{Health::kOk};
  std::string text;  ///< Why it is not OK.
  /// Totals since the start, by reason: ("received", 12), ("range", 3), ...
  std::vector<std::pair<std::string, std::uint64_t>> counters;
};

/// Topic fdi/v1/ValveState, key valve_id: what is known of a valve now.
struct ValveStateMessage {
  std::string valve_id;
  std::string monitor;       ///< Who says so; MonitorStatusMessage::monitor.
  std::int64_t as_of_ns{0};  ///< Stamp of the newest sample; 0: none was seen.
  Quality quality{Quality::kStale};
  State state{State::kNormal};
  bool partly{false};  ///< Some channel abstains.
  /// Since when nothing confirms the state; 0: it is confirmed.
  std::int64_t unconfirmed_ns{0};
  std::string model_set;  ///< NAME@VERSION that judges it; empty: none.
  /// The alarm that stands; 0: none, and what follows is empty.
  std::uint64_t episode_id{0};
  std::string fault;        ///< "f3|f6", "unknown"; empty: no name yet.
  std::string look_alikes;  ///< "f18|f1"
  std::string certainty;    ///< CertaintyName()
  std::string layer;        ///< LayerName() of what named it.
  int priority{0};          ///< PriorityOf() its severity.
  double strength{0.0};     ///< Signed [-]; 0 before a name.
  std::int64_t since_ns{0};
  /// Since when the valve sends and is not judged; 0: it is judged.
  std::int64_t unjudged_ns{0};
  std::string why;  ///< WhyUnjudged(); empty: it is judged.

  bool operator==(const ValveStateMessage&) const = default;
};

/// @throws DataError unless `id` has 1..64 bytes, all of printable UTF-8.
void ValidateId(std::string_view id);

ModelSetInfoMessage Describe(const ModelSet& models);

}  // namespace fdi::idl
