#pragma once

#include <map>
#include <set>
#include <string>

#include <fastdds/dds/core/policy/QosPolicies.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/publisher/qos/WriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/subscriber/qos/ReaderQos.hpp>

#include "idl/endpoint.h"

/// Inside idl/ only: the QoS of every topic, with the reasons beside it.
namespace fdi::idl {

struct EndpointQos {
  std::string name;  ///< Profiles of --qos: name + "_writer", + "_reader".
  std::string partition{};  ///< Empty: the default one.
  eprosima::fastdds::dds::DataWriterQos writer{};
  eprosima::fastdds::dds::DataReaderQos reader{};
};

/// The QoS of the topic of Message for up to `valves` valves. Profiles that a
/// topic does not know are kLive.
template <typename Message>
EndpointQos QosFor(Profile profile, int valves);

/// EndpointQos::name of every topic and profile.
const std::set<std::string>& EndpointNames();

/// The policies that two endpoints must agree on, in words, by policy id.
using PolicyTexts =
    std::map<eprosima::fastdds::dds::QosPolicyId_t, std::string>;

PolicyTexts Describe(const eprosima::fastdds::dds::DataWriterQos& qos);
PolicyTexts Describe(const eprosima::fastdds::dds::DataReaderQos& qos);
/// As discovered from a remote endpoint.
PolicyTexts Describe(const eprosima::fastdds::dds::WriterQos& qos);
PolicyTexts Describe(const eprosima::fastdds::dds::ReaderQos& qos);

/// "RELIABILITY", ...
std::string PolicyName(eprosima::fastdds::dds::QosPolicyId_t id);

}  // namespace fdi::idl
