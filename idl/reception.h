#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include <fastdds/dds/common/InstanceHandle.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "idl/endpoint.h"

/// Inside idl/ only: what the library says beside a message.
namespace fdi::idl {

struct HandleHash {
  std::size_t operator()(
      const eprosima::fastdds::dds::InstanceHandle_t& handle) const {
    std::size_t hash = 0;  // The handle is an MD5 sum: any part will do.
    std::memcpy(
        &hash,
        static_cast<const eprosima::fastrtps::rtps::octet*>(handle.value),
        sizeof hash);
    return hash;
  }
};

// 64-bit FNV-1a over the 16 bytes of the writer's GUID.
inline std::uint64_t WriterId(
    const eprosima::fastdds::dds::InstanceHandle_t& writer) {
  std::uint64_t hash = 14695981039346656037U;
  for (std::size_t i = 0; i < 16; ++i) {
    hash = (hash ^ writer.value[i]) * 1099511628211U;
  }
  return hash;
}

inline std::int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

inline Reception ReceptionOf(const eprosima::fastdds::dds::SampleInfo& info) {
  return {info.source_timestamp.to_ns(), info.reception_timestamp.to_ns(),
          WriterId(info.publication_handle)};
}

}  // namespace fdi::idl
