#pragma once

#include <algorithm>
#include <string>
#include <string_view>

#include "idl/codec.h"

/// Generated types without an endpoint, as either version of Fast DDS has them.
namespace fdi::idl {

/// The message `data` of `type` as it goes over the wire.
inline std::string Serialized(dds::TopicDataType& type, void* data) {
#if FDI_FAST_DDS == 2
  rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(data)());
  const bool done = type.serialize(data, &payload);
#else
  constexpr auto kPlain = dds::XCDR_DATA_REPRESENTATION;
  rtps::SerializedPayload_t payload(
      type.calculate_serialized_size(data, kPlain));
  const bool done = type.serialize(data, payload, kPlain);
#endif
  return done ? std::string(reinterpret_cast<const char*>(payload.data),
                            payload.length)
              : "";
}

/// @returns whether `type` read `bytes` into `data`.
inline bool Deserialize(dds::TopicDataType& type, std::string_view bytes,
                        void* data) {
  rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
#if FDI_FAST_DDS == 2
  return type.deserialize(&payload, data);
#else
  return type.deserialize(payload, data);
#endif
}

/// The handle of the instance of `data`.
inline rtps::InstanceHandle_t HandleOf(dds::TopicDataType& type, void* data) {
  rtps::InstanceHandle_t handle;
#if FDI_FAST_DDS == 2
  type.getKey(data, &handle, false);
#else
  type.compute_key(data, handle, false);
#endif
  return handle;
}

}  // namespace fdi::idl
