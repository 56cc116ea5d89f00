#include "idl/qos.h"

#include <algorithm>

namespace fdi::idl {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

// Unacknowledged samples that a lossless writer may have on the way: enough to
// hide a round trip. The library scans its free list at every release, so that
// larger histories cost throughput (fewer than 5000 measured best).
constexpr int kSamplesInFlight = 4096;
// Samples of all valves that wait in the library once the queue of the
// Subscriber is full; beyond it writers are made to wait. The limit is per
// valve, and the library counts what is missing on the way towards it: 16 per
// valve halved the rate of 2000 valves.
constexpr int kReaderBacklog = 131072;
constexpr int kModelSets = 256;
constexpr int kMonitors = 64;

eprosima::fastrtps::Duration_t Milliseconds(int count) {
  return {count / 1000, static_cast<std::uint32_t>(count % 1000) * 1000000U};
}

// Limits for `instances` keys. An endpoint is refused unless max_samples is at
// least the product. `allocated` sizes the lists of unacknowledged samples,
// which otherwise grow one by one; payloads are never allocated ahead.
void SetLimits(dds::ResourceLimitsQosPolicy& limits, int instances,
               int per_instance, int allocated) {
  limits.max_instances = instances;
  limits.max_samples_per_instance = per_instance;
  limits.max_samples = instances * per_instance;
  limits.allocated_samples = std::min(limits.max_samples, allocated);
}

// What all topics share: reliable, volatile, sent by the library's thread (3
// times the rate of sending in write()), a full history noticed within 50 ms
// instead of 3 s.
EndpointQos Common(const std::string& name) {
  EndpointQos qos;
  qos.name = name;
  dds::DataWriterQos& writer = qos.writer;
  writer.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  writer.reliability().max_blocking_time = Milliseconds(50);
  writer.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  writer.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
  writer.data_sharing().off();
  writer.endpoint().history_memory_policy = rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
  writer.reliable_writer_qos().times.heartbeatPeriod = Milliseconds(50);
  dds::DataReaderQos& reader = qos.reader;
  reader.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  reader.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  reader.data_sharing().off();
  // The dynamic modes refuse the end of an instance, which has no payload, and
  // with it all that the writer sends later.
  reader.endpoint().history_memory_policy =
      rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  return qos;
}

void KeepLast(EndpointQos& qos, int instances, int writer_depth,
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

void TransientLocal(EndpointQos& qos) {
  qos.writer.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  qos.reader.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
}

const std::set<std::string>& EndpointNames() {
  static const std::set<std::string> names{"fdi_valve_sample",
                                           "fdi_valve_sample_lossless",
                                           "fdi_valve_sample_best_effort",
                                           "fdi_decision_vector",
                                           "fdi_decision_vector_lossless",
                                           "fdi_fault_event",
                                           "fdi_model_set_info",
                                           "fdi_monitor_status"};
  return names;
}

std::set<std::string> WithSuffix(const std::string& suffix) {
  std::set<std::string> names;
  for (const std::string& name : EndpointNames()) {
    names.insert(name + suffix);
  }
  return names;
}

// What both kinds of endpoint have.
template <typename Qos>
void OverrideShared(const Qos& stated, const std::set<std::string>& policies,
                    Qos& qos) {
  const auto states = [&](const char* name) { return policies.contains(name); };
  if (states("reliability")) {
    qos.reliability() = stated.reliability();
  }
  if (states("durability")) {
    qos.durability() = stated.durability();
  }
  if (states("deadline")) {
    qos.deadline() = stated.deadline();
  }
  if (states("liveliness")) {
    qos.liveliness() = stated.liveliness();
  }
  if (states("lifespan")) {
    qos.lifespan() = stated.lifespan();
  }
  if (states("historyQos")) {
    qos.history() = stated.history();
  }
  if (states("resourceLimitsQos")) {
    qos.resource_limits() = stated.resource_limits();
  }
  if (states("historyMemoryPolicy")) {
    qos.endpoint().history_memory_policy =
        stated.endpoint().history_memory_policy;
  }
  if (states("unicastLocatorList")) {
    qos.endpoint().unicast_locator_list =
        stated.endpoint().unicast_locator_list;
  }
  if (states("multicastLocatorList")) {
    qos.endpoint().multicast_locator_list =
        stated.endpoint().multicast_locator_list;
  }
}

}  // namespace

template <>
EndpointQos QosFor<ValveSampleMessage>(Profile profile, int valves) {
  EndpointQos qos = Common("fdi_valve_sample");
  KeepLast(qos, valves, 16, 16);
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
EndpointQos QosFor<DecisionMessage>(Profile profile, int valves) {
  EndpointQos qos = Common("fdi_decision_vector");
  TransientLocal(qos);
  KeepLast(qos, valves, 1, 16);
  if (profile == Profile::kLossless) {
    // In a partition of its own: with TRANSIENT_LOCAL and KEEP_ALL the library
    // holds, and searches, what was acknowledged long ago.
    qos.name += "_lossless";
    qos.partition = "lossless";
    qos.writer.durability().kind = dds::VOLATILE_DURABILITY_QOS;
    qos.reader.durability().kind = dds::VOLATILE_DURABILITY_QOS;
    WriterKeepsAll(qos, valves);
    ReaderKeepsAll(qos, valves);
    // Samples that have waited come valve by valve, and so do their vectors.
    SetLimits(qos.writer.resource_limits(), valves,
              qos.reader.resource_limits().max_samples_per_instance,
              kSamplesInFlight);
    qos.writer.reliable_writer_qos().times.heartbeatPeriod = Milliseconds(10);
  }
  return qos;
}

template <>
EndpointQos QosFor<FaultEventMessage>(Profile /*profile*/, int valves) {
  EndpointQos qos = Common("fdi_fault_event");
  TransientLocal(qos);
  KeepLast(qos, valves, 16, 16);
  return qos;
}

template <>
EndpointQos QosFor<ModelSetInfoMessage>(Profile /*profile*/, int /*valves*/) {
  EndpointQos qos = Common("fdi_model_set_info");
  TransientLocal(qos);
  KeepLast(qos, kModelSets, 1, 1);
  return qos;
}

// Dead or hung monitors are noticed after 5 s. MANUAL_BY_TOPIC, because with
// the other kinds any other participant keeps the dead alive (Fast-DDS#4373).
template <>
EndpointQos QosFor<MonitorStatusMessage>(Profile /*profile*/, int /*valves*/) {
  EndpointQos qos = Common("fdi_monitor_status");
  TransientLocal(qos);
  KeepLast(qos, kMonitors, 1, 1);
  qos.writer.liveliness().kind = dds::MANUAL_BY_TOPIC_LIVELINESS_QOS;
  qos.writer.liveliness().lease_duration = Milliseconds(5000);
  qos.writer.liveliness().announcement_period = Milliseconds(2000);
  qos.reader.liveliness().kind = dds::MANUAL_BY_TOPIC_LIVELINESS_QOS;
  qos.reader.liveliness().lease_duration = Milliseconds(5000);
  return qos;
}

std::set<std::string> WriterProfileNames() {
  return WithSuffix("_writer");
}
std::set<std::string> ReaderProfileNames() {
  return WithSuffix("_reader");
}

const std::set<std::string>& OverridablePolicies() {
  static const std::set<std::string> names{
      "reliability",        "durability",
      "deadline",           "liveliness",
      "lifespan",           "historyQos",
      "resourceLimitsQos",  "historyMemoryPolicy",
      "unicastLocatorList", "multicastLocatorList",
      "publishMode",        "times"};
  return names;
}

void Override(const dds::DataWriterQos& stated,
              const std::set<std::string>& policies, dds::DataWriterQos& qos) {
  OverrideShared(stated, policies, qos);
  if (policies.contains("publishMode")) {
    qos.publish_mode() = stated.publish_mode();
  }
  if (policies.contains("times")) {
    qos.reliable_writer_qos().times = stated.reliable_writer_qos().times;
  }
}

void Override(const dds::DataReaderQos& stated,
              const std::set<std::string>& policies, dds::DataReaderQos& qos) {
  OverrideShared(stated, policies, qos);
  if (policies.contains("times")) {
    qos.reliable_reader_qos().times = stated.reliable_reader_qos().times;
  }
}

}  // namespace fdi::idl
