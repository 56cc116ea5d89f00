#pragma once

#include <cstdint>

#if __has_include(<fastdds/config.hpp>)
#include <fastdds/LibrarySettings.hpp>
#include <fastdds/config.hpp>
#include <fastdds/dds/core/ReturnCode.hpp>
#include <fastdds/dds/core/Time_t.hpp>
#include <fastdds/rtps/builtin/data/PublicationBuiltinTopicData.hpp>
#include <fastdds/rtps/builtin/data/SubscriptionBuiltinTopicData.hpp>
#include <fastdds/rtps/common/InstanceHandle.hpp>
#include <fastdds/rtps/common/SerializedPayload.hpp>
#else
#include <fastdds/dds/publisher/qos/WriterQos.hpp>
#include <fastdds/dds/subscriber/qos/ReaderQos.hpp>
#include <fastdds/rtps/common/InstanceHandle.h>
#include <fastdds/rtps/common/SerializedPayload.h>
#include <fastrtps/config.h>
#include <fastrtps/qos/QosPolicies.h>
#include <fastrtps/types/TypesBase.h>
#endif

/// Inside idl/ only: common names for what Fast DDS 2.9 (Debian 12) and 3.1
/// (Debian 13) call differently. Differences in behaviour are handled where
/// they occur, under `#if FDI_FAST_DDS == 2`.
namespace fdi::idl {

namespace dds = eprosima::fastdds::dds;

#ifdef FASTDDS_VERSION_MAJOR
#define FDI_FAST_DDS FASTDDS_VERSION_MAJOR
namespace rtps = eprosima::fastdds::rtps;
namespace return_code = eprosima::fastdds::dds;
using ReturnCode = dds::ReturnCode_t;
using Duration = dds::Duration_t;
using RemoteWriterQos = rtps::PublicationBuiltinTopicData;
using RemoteReaderQos = rtps::SubscriptionBuiltinTopicData;
inline const Duration kForever = dds::c_TimeInfinite;
inline int NumberOf(const ReturnCode& code) {
  return code;
}
#else
#define FDI_FAST_DDS FASTRTPS_VERSION_MAJOR
namespace rtps = eprosima::fastrtps::rtps;
using ReturnCode = eprosima::fastrtps::types::ReturnCode_t;
using return_code = ReturnCode;
using Duration = eprosima::fastrtps::Duration_t;
using RemoteWriterQos = dds::WriterQos;
using RemoteReaderQos = dds::ReaderQos;
inline const Duration kForever = eprosima::fastrtps::c_TimeInfinite;
inline int NumberOf(const ReturnCode& code) {
  return static_cast<int>(code());
}
#endif

}  // namespace fdi::idl
