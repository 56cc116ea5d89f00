#pragma once

#include <atomic>
#include <cstdint>
#include <exception>

#include <fastdds/dds/topic/TypeSupport.hpp>

namespace fdi::idl {

/// A generated type that survives foreign bytes: what cannot be deserialized,
/// for whatever reason, is refused and counted.
template <typename Generated>
class CheckedType : public Generated {
 public:
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload,
                   void* data) override {
    try {
      if (Generated::deserialize(payload, data)) {
        return true;
      }
    } catch (const std::exception&) {
      // E.g. bad_alloc of an absurd length; counted below.
    }
    refused_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }

  std::uint64_t refused() const {
    return refused_.load(std::memory_order_relaxed);
  }

 private:
  std::atomic<std::uint64_t> refused_{0};
};

}  // namespace fdi::idl
