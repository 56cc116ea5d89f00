#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <thread>

#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>

#include "base/mutex.h"
#include "idl/codec.h"
#include "idl/endpoint.h"
#include "idl/participant_impl.h"

namespace fdi::idl {
namespace {

using Clock = std::chrono::steady_clock;

// A full history often returns at once instead of blocking; the back-off keeps
// retries from starving the reader.
constexpr auto kBackOff = std::chrono::microseconds(100);
constexpr auto kDisposeTimeout = std::chrono::seconds(5);
// A writer that replaces valves has places to spare: one is free again only
// once all readers have acknowledged the end of its valve, and a writer without
// a free one forgets the oldest message, the last one of a silent valve.
constexpr int kSparePlaces = 64;
constexpr int kMaxPlaces = 100'000;  // See DdsOptions::max_valves.

bool IsFull(const ReturnCode& code) {
  return code == return_code::RETCODE_TIMEOUT ||
         code == return_code::RETCODE_OUT_OF_RESOURCES;
}

Duration Until(Clock::time_point deadline) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::max(deadline - Clock::now(), Clock::duration::zero()));
  return {static_cast<std::int32_t>(left.count() / 1000),
          static_cast<std::uint32_t>(left.count() % 1000) * 1000000U};
}

}  // namespace

template <typename Message>
struct Publisher<Message>::Impl : dds::DataWriterListener {
  using Traits = Codec<Message>;

  Impl(Participant& participant, const PublisherOptions& options)
      : bus(participant.impl()),
        lossless(options.profile == Profile::kLossless),
        valves(options.valves > 0 ? options.valves : bus.options().max_valves),
        replaces(options.replaces) {
    const EndpointQos ours = QosFor<Message>(
        options.profile,
        replaces ? std::min(valves + kSparePlaces, kMaxPlaces) : valves);
    dds::PublisherQos publisher_qos;
    for (const std::string& partition : options.partitions) {
      publisher_qos.partition().push_back(partition.c_str());
    }
    publisher = {
        NotNull(bus->create_publisher(publisher_qos), "create_publisher"),
        [this](dds::Publisher* handle) { bus->delete_publisher(handle); }};
    const dds::DataWriterQos qos =
        bus.profiles().Override(ours.name + "_writer", ours.writer, *publisher);
    policies = Describe(qos);
    dds::Topic* topic =
        bus.TopicOf(Traits::kTopic,
                    dds::TypeSupport(new CheckedType<typename Traits::Type>()));
    // Callbacks may come before create_datawriter() returns. They use
    // `policies`, set before, and never `writer`.
    writer = NotNull(publisher->create_datawriter(
                         topic, qos, this,
                         dds::StatusMask::publication_matched()
                             << dds::StatusMask::offered_incompatible_qos()),
                     std::string("create_datawriter of ") + Traits::kTopic);
  }

  ~Impl() override {
    writer->set_listener(nullptr);
    // Deleting a writer frees its changes while its heartbeat may still iterate
    // over them, forever if a dead reader has not acknowledged them.
    std::size_t removed = 0;
    writer->clear_history(&removed);
    publisher->delete_datawriter(writer);
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // The instance of `message`, which is already encoded in `wire`; nullptr
  // beyond the limit.
  const dds::InstanceHandle_t* InstanceOf(const Message& message)
      REQUIRES(mutex) {
    auto found = instances.find(KeyOf(message));
    if (found == instances.end()) {
      const dds::InstanceHandle_t handle = writer->register_instance(&wire);
      if (!handle.isDefined()) {
        return nullptr;
      }
      found = instances.emplace(KeyOf(message), Instance{handle, 0}).first;
    }
    found->second.last_write = ++writes;
    return &found->second.handle;
  }

  // Makes room for a new valve before its message is encoded: `wire` is needed
  // for the key of the one that goes.
  void MakeRoomFor(const Message& message) REQUIRES(mutex) {
    if (!replaces || instances.size() < static_cast<std::size_t>(valves) ||
        instances.contains(KeyOf(message))) {
      return;
    }
    const auto oldest = std::ranges::min_element(
        instances, {}, [](const auto& each) { return each.second.last_write; });
    Message ended;
    KeyOf(ended) = oldest->first;
    Unregister(ended);
  }

  // The library frees the place once all readers have acknowledged the end.
  void Unregister(const Message& ended) REQUIRES(mutex) {
    const auto found = instances.find(KeyOf(ended));
    if (found == instances.end()) {
      return;
    }
    Traits::EncodeKey(ended, wire);
    const ReturnCode code =
        writer->unregister_instance(&wire, found->second.handle);
    if (!IsFull(code)) {
      Check(code, std::string("unregister_instance on ") + Traits::kTopic);
      instances.erase(found);
    }
  }

  // Retries `send` until the history has room. @returns false on timeout or
  // stop.
  template <typename Send>
  bool Retry(Send send, const char* operation, const std::stop_token& stop,
             Clock::time_point deadline) {
    while (true) {
      const ReturnCode code = send();
      if (code == return_code::RETCODE_OK) {
        return true;
      }
      if (!IsFull(code)) {
        Check(code, std::string(operation) + " on " + Traits::kTopic);
      }
      // A message that found no room was not sent: trying again does not repeat
      // it.
      retries.fetch_add(1, std::memory_order_relaxed);
      if (!lossless || stop.stop_requested() || Clock::now() >= deadline) {
        return false;
      }
      std::this_thread::sleep_for(kBackOff);
    }
  }

  void on_publication_matched(
      dds::DataWriter* /*writer*/,
      const dds::PublicationMatchedStatus& status) override {
    total_matched.store(status.total_count);
    matched.Set(status.current_count);
  }

  void on_offered_incompatible_qos(
      dds::DataWriter* /*writer*/,
      const dds::OfferedIncompatibleQosStatus& status) override {
    incompatible.store(status.total_count, std::memory_order_relaxed);
    bus.ReportIncompatible(Traits::kTopic, false, status.last_policy_id,
                           policies);
  }

  Participant::Impl& bus;
  const bool lossless;
  const int valves;
  const bool replaces;
  std::unique_ptr<dds::Publisher, std::function<void(dds::Publisher*)>>
      publisher;
  dds::DataWriter* writer{nullptr};
  PolicyTexts policies;
  Matched matched;
  std::atomic<int> total_matched{0};
  std::atomic<std::uint64_t> written{0};
  std::atomic<std::uint64_t> retries{0};
  std::atomic<std::uint64_t> refused{0};
  std::atomic<std::uint64_t> incompatible{0};
  // Held while Write() waits for room, because `wire` has to keep its message
  // until the library accepts it: all threads that write wait together.
  Mutex mutex;
  struct Instance {
    dds::InstanceHandle_t handle;
    std::uint64_t last_write;
  };
  std::map<Key<Message>, Instance, std::less<>> instances GUARDED_BY(mutex);
  std::uint64_t writes GUARDED_BY(mutex){0};
  typename Traits::Wire wire GUARDED_BY(mutex);
};

template <typename Message>
Publisher<Message>::Publisher(Participant& participant,
                              const PublisherOptions& options)
    : impl_(std::make_unique<Impl>(participant, options)) {}

template <typename Message>
Publisher<Message>::~Publisher() = default;

template <typename Message>
WriteResult Publisher<Message>::Write(const Message& message,
                                      std::stop_token stop,
                                      std::chrono::milliseconds timeout) {
  Impl& impl = *impl_;
  const MutexLock lock(impl.mutex);
  impl.MakeRoomFor(message);
  Impl::Traits::Encode(message, impl.wire);
  const dds::InstanceHandle_t* instance = impl.InstanceOf(message);
  if (instance == nullptr) {
    impl.refused.fetch_add(1, std::memory_order_relaxed);
    return WriteResult::kTooManyValves;
  }
  // With a handle: in Fast DDS 2.9 write() without one returns a bool, which
  // does not tell a full history from an error.
  const auto send = [&] { return impl.writer->write(&impl.wire, *instance); };
  if (!impl.Retry(send, "write", stop, DeadlineIn(timeout))) {
    return WriteResult::kNotSent;
  }
  impl.written.fetch_add(1, std::memory_order_relaxed);
  return WriteResult::kSent;
}

template <typename Message>
void Publisher<Message>::Dispose(const Message& message) {
  Impl& impl = *impl_;
  const MutexLock lock(impl.mutex);
  const auto found = impl.instances.find(KeyOf(message));
  if (found == impl.instances.end()) {
    return;
  }
  Impl::Traits::EncodeKey(message, impl.wire);
  const auto send = [&] {
    return impl.writer->dispose(&impl.wire, found->second.handle);
  };
  if (!impl.Retry(send, "dispose", {}, Clock::now() + kDisposeTimeout)) {
    throw TransportError("dispose: the readers are behind",
                         NumberOf(return_code::RETCODE_TIMEOUT));
  }
}

template <typename Message>
void Publisher<Message>::Unregister(const Message& message) {
  const MutexLock lock(impl_->mutex);
  impl_->Unregister(message);
}

template <typename Message>
bool Publisher<Message>::WaitForReaders(
    int count, std::chrono::milliseconds timeout) const {
  return impl_->matched.WaitFor(count, timeout);
}

template <typename Message>
bool Publisher<Message>::WaitForAcknowledged(
    std::chrono::milliseconds timeout) {
  return impl_->writer->wait_for_acknowledgments(Until(DeadlineIn(timeout))) ==
         return_code::RETCODE_OK;
}

template <typename Message>
PublisherStatus Publisher<Message>::status() const {
  constexpr auto kOrder = std::memory_order_relaxed;
  return {impl_->written.load(kOrder), impl_->retries.load(kOrder),
          impl_->refused.load(kOrder), impl_->incompatible.load(kOrder),
          matched()};
}

template <typename Message>
int Publisher<Message>::matched() const {
  return impl_->matched.count();
}

template <typename Message>
int Publisher<Message>::total_matched() const {
  return impl_->total_matched.load();
}

template <typename Message>
void Publisher<Message>::ClearHistory() {
  const MutexLock lock(impl_->mutex);
  std::size_t removed = 0;
  impl_->writer->clear_history(&removed);
}

template class Publisher<ValveSampleMessage>;
template class Publisher<DecisionMessage>;
template class Publisher<DecisionBatchMessage>;
template class Publisher<FaultEvent>;
template class Publisher<ModelSetInfoMessage>;
template class Publisher<MonitorStatusMessage>;
template class Publisher<PairState>;
template class Publisher<OperatorAction>;
template class Publisher<MonitorShare>;

}  // namespace fdi::idl
