#pragma once

#include <map>
#include <set>
#include <string>

#include <fastdds/dds/core/policy/QosPolicies.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "idl/endpoint.h"
#include "idl/fast_dds.h"

/// Inside idl/ only: the QoS of every topic; qos.cpp gives the reasons.
namespace fdi::idl {

struct EndpointQos {
  std::string name;  ///< Profiles of --qos: name + "_writer", + "_reader".
  dds::DataWriterQos writer{};
  dds::DataReaderQos reader{};
  /// The next messages tell all that matters: a writer that cannot keep them
  /// for a late reader may forget what it wrote.
  bool is_stream{false};
};

/// The QoS of the topic of Message for up to `valves` valves. A profile that
/// the topic does not have means kLive.
template <typename Message>
EndpointQos QosFor(Profile profile, int valves);
template <>
EndpointQos QosFor<ValveSampleMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<DecisionMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<DecisionBatchMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<FaultEvent>(Profile profile, int valves);
template <>
EndpointQos QosFor<ValveStateMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<ModelSetInfoMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<MonitorStatusMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<MonitorShare>(Profile profile, int valves);

/// EndpointQos::name of every topic and profile.
const std::set<std::string>& EndpointNames();

/// Text of the policies on which two endpoints must agree, by policy id.
using PolicyTexts = std::map<dds::QosPolicyId_t, std::string>;

PolicyTexts Describe(const dds::DataWriterQos& qos);
PolicyTexts Describe(const dds::DataReaderQos& qos);
/// As discovered from a remote endpoint.
PolicyTexts Describe(const RemoteWriterQos& qos);
PolicyTexts Describe(const RemoteReaderQos& qos);

/// "RELIABILITY", ...
std::string PolicyName(dds::QosPolicyId_t id);

}  // namespace fdi::idl
