#pragma once

#include <set>
#include <string>

#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "idl/endpoint.h"
#include "idl/profile_file.h"

/// Inside idl/ only: the QoS of every topic, with the reasons beside it.
namespace fdi::idl {

struct EndpointQos {
  std::string name;  ///< Profiles of --qos: name + "_writer", + "_reader".
  std::string partition{};  ///< Empty: the default one.
  eprosima::fastdds::dds::DataWriterQos writer;
  eprosima::fastdds::dds::DataReaderQos reader;
};

/// The QoS of the topic of Message for up to `valves` valves. One
/// specialisation per topic; profiles that a topic does not know are kLive.
template <typename Message>
EndpointQos QosFor(Profile profile, int valves);

template <>
EndpointQos QosFor<ValveSampleMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<DecisionMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<FaultEventMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<ModelSetInfoMessage>(Profile profile, int valves);
template <>
EndpointQos QosFor<MonitorStatusMessage>(Profile profile, int valves);

/// Profile names that a QoS file may use.
std::set<std::string> WriterProfileNames();
std::set<std::string> ReaderProfileNames();
/// XML elements of an endpoint profile that override ours.
const std::set<std::string>& OverridablePolicies();

/// Takes from `stated`, a profile of the file, the policies that the file
/// names.
void Override(const eprosima::fastdds::dds::DataWriterQos& stated,
              const std::set<std::string>& policies,
              eprosima::fastdds::dds::DataWriterQos& qos);
void Override(const eprosima::fastdds::dds::DataReaderQos& stated,
              const std::set<std::string>& policies,
              eprosima::fastdds::dds::DataReaderQos& qos);

}  // namespace fdi::idl
