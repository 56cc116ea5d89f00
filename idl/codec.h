#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <tuple>
#include <type_traits>
#include <unordered_set>

#include "base/mutex.h"
#include "idl/fast_dds.h"
#include "idl/wire.h"
#if FDI_FAST_DDS == 2
#include "fdi_v1.h"
#include "fdi_v1PubSubTypes.h"
#include "fdi_v2.h"
#include "fdi_v2PubSubTypes.h"
#else
#include "fdi_v1.hpp"
#include "fdi_v1PubSubTypes.hpp"
#include "fdi_v2.hpp"
#include "fdi_v2PubSubTypes.hpp"
#endif

/// Inside idl/ only: converts plain messages to generated types and back.
namespace fdi::idl {

/// The name of a topic and its types on the wire. All messages have version 1,
/// samples also 2.
template <typename Message, int kVersion = 1>
struct TopicOf;

#define FDI_TOPIC(MESSAGE, NAME, VERSION)                             \
  template <>                                                         \
  struct TopicOf<MESSAGE, VERSION> {                                  \
    using Wire = v##VERSION::NAME;                                    \
    using Type = v##VERSION::NAME##PubSubType;                        \
    static constexpr const char* kTopic = "fdi/v" #VERSION "/" #NAME; \
  };
FDI_TOPIC(ValveSampleMessage, ValveSample, 1)
FDI_TOPIC(ValveSampleMessage, ValveSample, 2)
FDI_TOPIC(DecisionMessage, DecisionVector, 1)
FDI_TOPIC(DecisionBatchMessage, DecisionBatch, 1)
FDI_TOPIC(FaultEvent, FaultEvent, 1)
FDI_TOPIC(ValveStateMessage, ValveState, 1)
FDI_TOPIC(ModelSetInfoMessage, ModelSetInfo, 1)
FDI_TOPIC(MonitorStatusMessage, MonitorStatus, 1)
FDI_TOPIC(MonitorShare, MonitorShare, 1)
#undef FDI_TOPIC

/// Converts the messages of one topic; codec.cpp lists the fields once for both
/// directions.
template <typename Message, int kVersion = 1>
struct Codec : TopicOf<Message, kVersion> {
  using Wire = typename TopicOf<Message, kVersion>::Wire;

  /// @throws DataError naming the field that does not fit and what would.
  static void Encode(const Message& message, Wire& wire);
  /// Encodes the key members only. @throws as Encode().
  static void EncodeKey(const Message& message, Wire& wire);
  /// @returns false for values that none of our publishers sends (an
  ///   enumerator, a size or a fault out of range); `message` is unspecified
  ///   then.
  static bool Decode(const Wire& wire, Message& message);
};

/// References to the key members of `message`.
template <typename Message>
auto KeyOf(Message& message) {
  if constexpr (requires { message.valve_id; }) {
    return std::tie(message.valve_id);
  } else if constexpr (requires { message.monitor; }) {
    return std::tie(message.monitor);
  } else {
    return std::tie(message.model_set, message.model_hash);
  }
}

template <typename... T>
std::tuple<std::remove_const_t<T>...> CopyOf(const std::tuple<T&...>& members) {
  return members;
}
/// The same by value.
template <typename Message>
using Key = decltype(CopyOf(KeyOf(std::declval<Message&>())));

/// A generated type that is safe with malformed data and several endpoints.
///
/// A message that cannot be deserialized, for whatever reason, is refused and
/// counted once: the library deserializes it first into an object of its own,
/// for the key, and then into the reader's.
///
/// Generated types compute keys in a buffer shared by all endpoints of the
/// type, so two threads could get each other's keys; hence the lock. Between a
/// text and a number in a key there are padding bytes that are never written,
/// so the hash depended on the previous key; hence a fresh buffer for such
/// keys.
template <typename Generated>
class CheckedType : public Generated {
 public:
#if FDI_FAST_DDS == 2
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    return Checked(payload, data);
  }
  void* createData() override {
    return RegisterObject(Generated::createData());
  }
  void deleteData(void* data) override {
    UnregisterObject(data);
    Generated::deleteData(data);
  }
  bool getKey(void* data, rtps::InstanceHandle_t* handle,
              bool force_md5) override {
    if constexpr (kKeyHasGaps) {
      return Generated().getKey(data, handle, force_md5);
    }
    const MutexLock lock(key_mutex_);
    return Generated::getKey(data, handle, force_md5);
  }
#else
  bool deserialize(rtps::SerializedPayload_t& payload, void* data) override {
    return Checked(payload, data);
  }
  void* create_data() override {
    return RegisterObject(Generated::create_data());
  }
  void delete_data(void* data) override {
    UnregisterObject(data);
    Generated::delete_data(data);
  }
  bool compute_key(const void* data, rtps::InstanceHandle_t& handle,
                   bool force_md5) override {
    if constexpr (kKeyHasGaps) {
      return Generated().compute_key(data, handle, force_md5);
    }
    const MutexLock lock(key_mutex_);
    return Generated::compute_key(data, handle, force_md5);
  }
  // For a message without a key hash. Without a handle it would belong to no
  // instance, and Fast DDS 3.1.2 then dereferences an end iterator
  // (update_instance_nts). A message whose key cannot be read therefore gets a
  // handle of its own here and is refused when it is taken. A dispose contains
  // only the key and cannot be read as a whole message.
  bool compute_key(rtps::SerializedPayload_t& payload,
                   rtps::InstanceHandle_t& handle, bool force_md5) override {
    typename Generated::type message;
    rtps::InstanceHandle_t of_none;
    compute_key(&message, of_none, force_md5);
    static_cast<void>(TryDeserialize(payload, &message));
    compute_key(&message, handle, force_md5);
    if (handle == of_none) {
      handle = rtps::InstanceHandle_t();
      handle.value[0] = 0xff;
    }
    return true;
  }
#endif

  std::uint64_t refused() const {
    return refused_.load(std::memory_order_relaxed);
  }

 private:
  static constexpr bool kKeyHasGaps =
      std::is_same_v<Generated, v1::ModelSetInfoPubSubType>;

  bool TryDeserialize(auto& payload, void* data) {
    try {
      return Generated::deserialize(payload, data);
    } catch (const std::exception&) {
      return false;  // E.g. bad_alloc for an absurd length.
    }
  }
#if FDI_FAST_DDS == 2
  static bool IsComplete(const rtps::SerializedPayload_t* /*payload*/,
                         const void* /*data*/) {
    return true;
  }
#else
  // Fast CDR 2 accepts the end of the bytes between any two members as the end
  // of the message; the remaining members keep their old values. So a message
  // must be as long as what was read from it. The calculated size may be a few
  // bytes too large, because it aligns the elements of an empty list.
  bool IsComplete(const rtps::SerializedPayload_t& payload, const void* data) {
    constexpr rtps::octet kFirstOfXcdr2 = 6;  // Among the encapsulations.
    const auto form = payload.data[1] < kFirstOfXcdr2
                          ? dds::XCDR_DATA_REPRESENTATION
                          : dds::XCDR2_DATA_REPRESENTATION;
    const std::uint32_t size = Generated::calculate_serialized_size(data, form);
    if (payload.length >= size) {
      return true;
    }
    rtps::SerializedPayload_t again(size);
    return Generated::serialize(data, again, form) &&
           payload.length >= again.length;
  }
#endif
  bool Checked(auto& payload, void* data) {
    if (TryDeserialize(payload, data) && IsComplete(payload, data)) {
      return true;
    }
    const MutexLock lock(objects_mutex_);
    if (!objects_of_library_.contains(data)) {
      refused_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    // For the key: use this message as far as it can be read, not the last one.
    *static_cast<typename Generated::type*>(data) = {};
    static_cast<void>(TryDeserialize(payload, data));
    return false;
  }
  void* RegisterObject(void* data) {
    const MutexLock lock(objects_mutex_);
    objects_of_library_.insert(data);
    return data;
  }
  void UnregisterObject(void* data) {
    const MutexLock lock(objects_mutex_);
    objects_of_library_.erase(data);
  }

  Mutex key_mutex_;
  Mutex objects_mutex_;
  std::unordered_set<const void*> objects_of_library_
      GUARDED_BY(objects_mutex_);
  std::atomic<std::uint64_t> refused_{0};
};

}  // namespace fdi::idl
