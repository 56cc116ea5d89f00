#include "idl/qos.h"

#include <algorithm>

namespace fdi::idl {
namespace {

// Unacknowledged samples of a lossless writer: enough to hide a round trip. The
// library scans its free list at every release, so larger histories cost
// throughput (below 5000 measured best).
constexpr int kSamplesInFlight = 4096;
// Samples of all valves that are held in the library once the queue of the
// Subscriber is full; beyond it writers have to wait. The limit is per valve,
// and the library counts messages missing on the way towards it: 16 per valve
// halved the rate of 2000 valves.
constexpr int kReaderBacklog = 131072;
// Samples in a datagram. Fast DDS 3.1 holds their memory until it is sent,
// including samples that a newer one has replaced: without spare room beside
// the history, fast writing fails with OUT_OF_RESOURCES. Allocated on demand.
constexpr int kSamplesInDatagram = 1024;
// Samples of all valves that a live writer keeps for retransmission.
constexpr int kLiveHistory = 32768;
constexpr int kBatchesInFlight = 64;  // Up to 48 kB each.
constexpr int kModelSets = 256;
constexpr int kMonitors = 64;

// Fast DDS 2.9.1 deadlocks if a VOLATILE writer removes a reader, e.g. a dead
// one, while it is sending: it removes what that reader had not acknowledged,
// which waits for the sending thread, which waits for the removal (upstream
// pull requests 3468 and 5432). A TRANSIENT_LOCAL writer does not remove
// anything then: it keeps acknowledged samples until it needs the room.
// VOLATILE readers get no old samples from either.
#if FDI_FAST_DDS == 2
constexpr auto kWriterDurability = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
#else
constexpr auto kWriterDurability = dds::VOLATILE_DURABILITY_QOS;
#endif

Duration Milliseconds(int count) {
  return {count / 1000, static_cast<std::uint32_t>(count % 1000) * 1000000U};
}

Duration& HeartbeatPeriod(dds::DataWriterQos& writer) {
#if FDI_FAST_DDS == 2
  return writer.reliable_writer_qos().times.heartbeatPeriod;
#else
  return writer.reliable_writer_qos().times.heartbeat_period;
#endif
}

// Limits for `instances` keys. The library refuses an endpoint if max_samples
// is below the product. `allocated` sizes the lists of unacknowledged samples,
// which otherwise grow one by one; payloads are never preallocated.
void SetLimits(dds::ResourceLimitsQosPolicy& limits, int instances,
               int per_instance, int allocated) {
  limits.max_instances = instances;
  limits.max_samples_per_instance = per_instance;
  limits.max_samples = instances * per_instance;
  limits.allocated_samples = std::min(limits.max_samples, allocated);
}

// Common to all topics: reliable, volatile, sent by the library's thread (3
// times the rate of sending in write()), a full history detected within 50 ms
// instead of 3 s.
EndpointQos Common(const std::string& name) {
  EndpointQos qos;
  qos.name = name;
  dds::DataWriterQos& writer = qos.writer;
  writer.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  writer.reliability().max_blocking_time = Milliseconds(50);
  writer.durability().kind = kWriterDurability;
  writer.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
  writer.data_sharing().off();
  writer.resource_limits().extra_samples = kSamplesInDatagram;
  writer.endpoint().history_memory_policy = rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
  HeartbeatPeriod(writer) = Milliseconds(50);
  dds::DataReaderQos& reader = qos.reader;
  reader.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  reader.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  reader.data_sharing().off();
  // The dynamic modes reject a dispose, which has no payload, and with it
  // everything that the writer sends later.
  reader.endpoint().history_memory_policy =
      rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  return qos;
}

void SetKeepLast(EndpointQos& qos, int instances, int writer_depth,
                 int reader_depth) {
  qos.writer.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.writer.history().depth = writer_depth;
  SetLimits(qos.writer.resource_limits(), instances, writer_depth, 64);
  qos.reader.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.reader.history().depth = reader_depth;
  SetLimits(qos.reader.resource_limits(), instances, reader_depth, 64);
}

void WriterKeepsAll(EndpointQos& qos, int instances) {
  const int per_instance =
      std::max(2, (kSamplesInFlight + instances - 1) / instances);
  qos.writer.history().kind = dds::KEEP_ALL_HISTORY_QOS;
  SetLimits(qos.writer.resource_limits(), instances, per_instance,
            kSamplesInFlight);
}

void ReaderKeepsAll(EndpointQos& qos, int instances) {
  const int per_instance =
      std::clamp(kReaderBacklog / instances, 64, kSamplesInFlight);
  qos.reader.history().kind = dds::KEEP_ALL_HISTORY_QOS;
  SetLimits(qos.reader.resource_limits(), instances, per_instance, 256);
}

// Lossless, for writers with one instance.
void SetKeepAll(EndpointQos& qos, int messages) {
  qos.writer.history().kind = dds::KEEP_ALL_HISTORY_QOS;
  SetLimits(qos.writer.resource_limits(), 1, messages, 1);
  qos.writer.resource_limits().extra_samples = 1;
  qos.reader.history().kind = dds::KEEP_ALL_HISTORY_QOS;
  SetLimits(qos.reader.resource_limits(), kMonitors, messages, 1);
}

void TransientLocal(EndpointQos& qos) {
  qos.writer.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  qos.reader.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
}

// Policies as text, for the log.
std::string Text(const Duration& duration) {
  if (duration == kForever) {
    return "infinite";
  }
  return std::to_string(duration.to_ns() / 1000000) + "ms";
}

std::string Text(const dds::DurabilityQosPolicy& policy) {
  switch (policy.kind) {
    case dds::VOLATILE_DURABILITY_QOS:
      return "VOLATILE";
    case dds::TRANSIENT_LOCAL_DURABILITY_QOS:
      return "TRANSIENT_LOCAL";
    case dds::TRANSIENT_DURABILITY_QOS:
      return "TRANSIENT";
    default:
      return "PERSISTENT";
  }
}

std::string Text(const dds::LivelinessQosPolicy& policy) {
  const std::string lease = "/" + Text(policy.lease_duration);
  switch (policy.kind) {
    case dds::AUTOMATIC_LIVELINESS_QOS:
      return "AUTOMATIC" + lease;
    case dds::MANUAL_BY_PARTICIPANT_LIVELINESS_QOS:
      return "MANUAL_BY_PARTICIPANT" + lease;
    default:
      return "MANUAL_BY_TOPIC" + lease;
  }
}

PolicyTexts Texts(const dds::ReliabilityQosPolicy& reliability,
                  const dds::DurabilityQosPolicy& durability,
                  const dds::DeadlineQosPolicy& deadline,
                  const dds::LivelinessQosPolicy& liveliness,
                  const dds::OwnershipQosPolicy& ownership) {
  const bool reliable = reliability.kind == dds::RELIABLE_RELIABILITY_QOS;
  const bool shared = ownership.kind == dds::SHARED_OWNERSHIP_QOS;
  return {
      {dds::RELIABILITY_QOS_POLICY_ID, reliable ? "RELIABLE" : "BEST_EFFORT"},
      {dds::DURABILITY_QOS_POLICY_ID, Text(durability)},
      {dds::DEADLINE_QOS_POLICY_ID, Text(deadline.period)},
      {dds::LIVELINESS_QOS_POLICY_ID, Text(liveliness)},
      {dds::OWNERSHIP_QOS_POLICY_ID, shared ? "SHARED" : "EXCLUSIVE"}};
}

// Our QoS has accessor functions where discovered QoS has members.
PolicyTexts LocalPolicyTexts(const auto& qos) {
  return Texts(qos.reliability(), qos.durability(), qos.deadline(),
               qos.liveliness(), qos.ownership());
}
PolicyTexts RemotePolicyTexts(const auto& qos) {
#if FDI_FAST_DDS == 2
  return Texts(qos.m_reliability, qos.m_durability, qos.m_deadline,
               qos.m_liveliness, qos.m_ownership);
#else
  return Texts(qos.reliability, qos.durability, qos.deadline, qos.liveliness,
               qos.ownership);
#endif
}

}  // namespace

template <>
EndpointQos QosFor<ValveSampleMessage>(Profile profile, int valves) {
  EndpointQos qos = Common("fdi_valve_sample");
  qos.is_stream = true;
  SetKeepLast(qos, valves, std::clamp(kLiveHistory / valves, 2, 16), 16);
  ReaderKeepsAll(qos, valves);
  if (profile == Profile::kLossless) {
    qos.name += "_lossless";
    WriterKeepsAll(qos, valves);
  } else if (profile == Profile::kBestEffort) {
    qos.name += "_best_effort";
    qos.writer.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
    qos.reader.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  }
  return qos;
}

template <>
EndpointQos QosFor<DecisionMessage>(Profile /*profile*/, int valves) {
  EndpointQos qos = Common("fdi_decision_vector");
  qos.is_stream = true;
  TransientLocal(qos);
  SetKeepLast(qos, valves, 1, 16);
  return qos;
}

// With TRANSIENT_LOCAL and KEEP_ALL the library would hold, and scan, samples
// that were acknowledged long ago.
template <>
EndpointQos QosFor<DecisionBatchMessage>(Profile /*profile*/, int /*valves*/) {
  EndpointQos qos = Common("fdi_decision_batch");
  SetKeepAll(qos, kBatchesInFlight);
  HeartbeatPeriod(qos.writer) = Milliseconds(10);
  return qos;
}

template <>
EndpointQos QosFor<FaultEvent>(Profile /*profile*/, int valves) {
  EndpointQos qos = Common("fdi_fault_event");
  TransientLocal(qos);
  SetKeepLast(qos, valves, 16, 16);
  return qos;
}

// Only the newest state of a valve counts, for whoever comes whenever.
template <>
EndpointQos QosFor<ValveStateMessage>(Profile /*profile*/, int valves) {
  EndpointQos qos = Common("fdi_valve_state");
  TransientLocal(qos);
  SetKeepLast(qos, valves, 1, 1);
  return qos;
}

template <>
EndpointQos QosFor<ModelSetInfoMessage>(Profile /*profile*/, int /*valves*/) {
  EndpointQos qos = Common("fdi_model_set_info");
  TransientLocal(qos);
  SetKeepLast(qos, kModelSets, 1, 1);
  return qos;
}

// Dead or hung monitors are noticed after 5 s. MANUAL_BY_TOPIC, because with
// the other kinds any other participant keeps a dead one alive (Fast-DDS#4373).
template <>
EndpointQos QosFor<MonitorStatusMessage>(Profile /*profile*/, int /*valves*/) {
  EndpointQos qos = Common("fdi_monitor_status");
  TransientLocal(qos);
  SetKeepLast(qos, kMonitors, 1, 1);
  qos.writer.liveliness().kind = dds::MANUAL_BY_TOPIC_LIVELINESS_QOS;
  qos.writer.liveliness().lease_duration = Milliseconds(5000);
  qos.writer.liveliness().announcement_period = Milliseconds(2000);
  qos.reader.liveliness().kind = dds::MANUAL_BY_TOPIC_LIVELINESS_QOS;
  qos.reader.liveliness().lease_duration = Milliseconds(5000);
  return qos;
}

// Only the newest share matters.
template <>
EndpointQos QosFor<MonitorShare>(Profile /*profile*/, int /*valves*/) {
  EndpointQos qos = Common("fdi_monitor_share");
  SetKeepLast(qos, kMonitors, 1, 1);
  return qos;
}

const std::set<std::string>& EndpointNames() {
  static const std::set<std::string> names{"fdi_valve_sample",
                                           "fdi_valve_sample_lossless",
                                           "fdi_valve_sample_best_effort",
                                           "fdi_decision_vector",
                                           "fdi_decision_batch",
                                           "fdi_fault_event",
                                           "fdi_valve_state",
                                           "fdi_model_set_info",
                                           "fdi_monitor_status",
                                           "fdi_monitor_share"};
  return names;
}

PolicyTexts Describe(const dds::DataWriterQos& qos) {
  return LocalPolicyTexts(qos);
}
PolicyTexts Describe(const dds::DataReaderQos& qos) {
  return LocalPolicyTexts(qos);
}
PolicyTexts Describe(const RemoteWriterQos& qos) {
  return RemotePolicyTexts(qos);
}
PolicyTexts Describe(const RemoteReaderQos& qos) {
  return RemotePolicyTexts(qos);
}

std::string PolicyName(dds::QosPolicyId_t id) {
  switch (id) {
    case dds::RELIABILITY_QOS_POLICY_ID:
      return "RELIABILITY";
    case dds::DURABILITY_QOS_POLICY_ID:
      return "DURABILITY";
    case dds::DEADLINE_QOS_POLICY_ID:
      return "DEADLINE";
    case dds::LIVELINESS_QOS_POLICY_ID:
      return "LIVELINESS";
    case dds::OWNERSHIP_QOS_POLICY_ID:
      return "OWNERSHIP";
    default:
      return "policy_" + std::to_string(static_cast<int>(id));
  }
}

}  // namespace fdi::idl
