#include "idl/qos_report.h"

namespace fdi::idl {
namespace {

namespace dds = eprosima::fastdds::dds;

std::string Text(const eprosima::fastrtps::Duration_t& duration) {
  if (duration == eprosima::fastrtps::c_TimeInfinite) {
    return "infinite";
  }
  return std::to_string(duration.to_ns() / 1000000) + "ms";
}

std::string Text(const dds::ReliabilityQosPolicy& policy) {
  return policy.kind == dds::RELIABLE_RELIABILITY_QOS ? "RELIABLE"
                                                      : "BEST_EFFORT";
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

std::string Text(const dds::OwnershipQosPolicy& policy) {
  return policy.kind == dds::SHARED_OWNERSHIP_QOS ? "SHARED" : "EXCLUSIVE";
}

template <typename Endpoint>
PolicyTexts DescribeOurs(const Endpoint& qos) {
  return {{dds::RELIABILITY_QOS_POLICY_ID, Text(qos.reliability())},
          {dds::DURABILITY_QOS_POLICY_ID, Text(qos.durability())},
          {dds::DEADLINE_QOS_POLICY_ID, Text(qos.deadline().period)},
          {dds::LIVELINESS_QOS_POLICY_ID, Text(qos.liveliness())},
          {dds::OWNERSHIP_QOS_POLICY_ID, Text(qos.ownership())}};
}

template <typename Endpoint>
PolicyTexts DescribeRemote(const Endpoint& qos) {
  return {{dds::RELIABILITY_QOS_POLICY_ID, Text(qos.m_reliability)},
          {dds::DURABILITY_QOS_POLICY_ID, Text(qos.m_durability)},
          {dds::DEADLINE_QOS_POLICY_ID, Text(qos.m_deadline.period)},
          {dds::LIVELINESS_QOS_POLICY_ID, Text(qos.m_liveliness)},
          {dds::OWNERSHIP_QOS_POLICY_ID, Text(qos.m_ownership)}};
}

}  // namespace

PolicyTexts Describe(const dds::DataWriterQos& qos) {
  return DescribeOurs(qos);
}
PolicyTexts Describe(const dds::DataReaderQos& qos) {
  return DescribeOurs(qos);
}
PolicyTexts Describe(const dds::WriterQos& qos) {
  return DescribeRemote(qos);
}
PolicyTexts Describe(const dds::ReaderQos& qos) {
  return DescribeRemote(qos);
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
