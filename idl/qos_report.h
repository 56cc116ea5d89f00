#pragma once

#include <map>
#include <string>

#include <fastdds/dds/core/policy/QosPolicies.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/publisher/qos/WriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/subscriber/qos/ReaderQos.hpp>

/// Inside idl/ only: QoS in words, for the log.
namespace fdi::idl {

/// The policies that two endpoints must agree on, by policy id.
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
