#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <mutex>
#include <unordered_set>

#include <fastdds/dds/topic/TypeSupport.hpp>

namespace fdi::idl {

/// A generated type that survives foreign bytes: what cannot be deserialized,
/// for whatever reason, is refused and counted, once: the library deserializes
/// a message into an object of its own first, for its key, and then into that
/// of the reader. And one that the endpoints of a participant can share:
/// generated types compute keys in a buffer of their own, from which two
/// threads got each other's keys.
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
    const std::lock_guard lock(objects_mutex_);
    if (!objects_of_library_.contains(data)) {
      refused_.fetch_add(1, std::memory_order_relaxed);
    }
    return false;
  }

  void* createData() override {
    void* const data = Generated::createData();
    const std::lock_guard lock(objects_mutex_);
    objects_of_library_.insert(data);
    return data;
  }

  void deleteData(void* data) override {
    {
      const std::lock_guard lock(objects_mutex_);
      objects_of_library_.erase(data);
    }
    Generated::deleteData(data);
  }

  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle,
              bool force_md5) override {
    const std::lock_guard lock(key_mutex_);
    return Generated::getKey(data, handle, force_md5);
  }

  std::uint64_t refused() const {
    return refused_.load(std::memory_order_relaxed);
  }

 private:
  std::mutex key_mutex_;
  std::mutex objects_mutex_;
  std::unordered_set<const void*> objects_of_library_;
  std::atomic<std::uint64_t> refused_{0};
};

}  // namespace fdi::idl
