#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <unordered_set>
#include <utility>

#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>

#include "base/mutex.h"
#include "idl/codec.h"
#include "idl/endpoint.h"
#include "idl/participant_impl.h"
#include "idl/writer_pace.h"

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
// Half of what a reader admits, and so much may come before it is told.
constexpr std::uint64_t kMaxSpan = kLargestGap / 2;
// Writers look how far back their history reaches at each so many writes.
constexpr std::uint64_t kWritesBetweenLooks = 1024;
// A reader that was found has found the writer by then, which takes it a second
// on a loaded machine.
constexpr auto kNewcomer = std::chrono::seconds(10);

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

namespace {

// The writer of one topic, see Publisher.
template <typename Message, int kVersion = 1>
struct TopicWriter : dds::DataWriterListener {
  using Traits = Codec<Message, kVersion>;

  TopicWriter(Participant& participant, const PublisherOptions& options)
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
    forgets = ours.is_stream;
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

  ~TopicWriter() override {
    writer->set_listener(nullptr);
    // Deleting a writer frees its changes while its heartbeat may still iterate
    // over them, forever if a dead reader has not acknowledged them.
    std::size_t removed = 0;
    writer->clear_history(&removed);
    publisher->delete_datawriter(writer);
  }

  TopicWriter(const TopicWriter&) = delete;
  TopicWriter& operator=(const TopicWriter&) = delete;

  WriteResult Write(const Message& message, const std::stop_token& stop,
                    std::chrono::milliseconds timeout) {
    const MutexLock lock(mutex);
    ForgetSilentValves();
    MakeRoomFor(message);
    Traits::Encode(message, wire);
    const dds::InstanceHandle_t* instance = InstanceOf(message);
    if (instance == nullptr) {
      refused.fetch_add(1, std::memory_order_relaxed);
      return WriteResult::kTooManyValves;
    }
    // With a handle: in Fast DDS 2.9 write() without one returns a bool, which
    // does not tell a full history from an error.
    const auto send = [&] { return writer->write(&wire, *instance); };
    if (!Retry(send, "write", stop, DeadlineIn(timeout))) {
      return WriteResult::kNotSent;
    }
    written.fetch_add(1, std::memory_order_relaxed);
    return WriteResult::kSent;
  }

  void Dispose(const Message& message) {
    const MutexLock lock(mutex);
    const auto found = instances.find(KeyOf(message));
    if (found == instances.end()) {
      return;
    }
    Traits::EncodeKey(message, wire);
    const auto send = [&] {
      return writer->dispose(&wire, found->second.handle);
    };
    if (!Retry(send, "dispose", {}, Clock::now() + kDisposeTimeout)) {
      throw TransportError("dispose: the readers are behind",
                           NumberOf(return_code::RETCODE_TIMEOUT));
    }
  }

  void Unregister(const Message& message) {
    const MutexLock lock(mutex);
    UnregisterLocked(message);
  }

  // The number of the last message of this instance; 0: none.
  std::uint64_t LastWriteOf(const Message& message) {
    const MutexLock lock(mutex);
    const auto found = instances.find(KeyOf(message));
    return found == instances.end() ? 0 : found->second.last_write;
  }

  // The number of the last message of all.
  std::uint64_t last_write() {
    const MutexLock lock(mutex);
    return writes;
  }

  bool WaitForReaders(int count, std::chrono::milliseconds timeout) const {
    return matched.WaitFor(count, timeout);
  }

  bool WaitForAcknowledged(std::chrono::milliseconds timeout) {
    return writer->wait_for_acknowledgments(Until(DeadlineIn(timeout))) ==
           return_code::RETCODE_OK;
  }

  PublisherStatus status() const {
    constexpr auto kOrder = std::memory_order_relaxed;
    return {written.load(kOrder), retries.load(kOrder), refused.load(kOrder),
            incompatible.load(kOrder), readers()};
  }
  int readers() const { return matched.count(); }
  // Since the start, including those that have left.
  int total_readers() const { return total_matched.load(); }

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

  // The library keeps the last samples of valves that are silent. The numbers
  // written since are a hole in its history, which a new reader has to be told
  // of with each heartbeat, and keeps number by number; one that nobody told
  // asks for 256 numbers at a time. It would be kept waiting for minutes. A
  // history of a stream that reaches far back is emptied: by a live writer
  // while a reader is new, by a lossless one once everything is acknowledged.
  // Live, the other readers may miss what was sent within their round trip.
  void ForgetSilentValves() REQUIRES(mutex) {
    const bool comes = has_newcomer.exchange(false);
    if (comes) {
      newcomer_until = Clock::now() + kNewcomer;
    }
    if (!forgets || (!comes && writes % kWritesBetweenLooks != 0) ||
        (!lossless && Clock::now() >= newcomer_until) ||
        SpanOfHistory() < kMaxSpan) {
      return;
    }
    if (!lossless || WaitForAcknowledged(std::chrono::milliseconds(0))) {
      std::size_t removed = 0;
      writer->clear_history(&removed);
      forgotten = writes;
    }
  }

  // Number of messages since the oldest one that the history may have.
  std::uint64_t SpanOfHistory() const REQUIRES(mutex) {
    std::uint64_t oldest = writes;
    for (const auto& [key, each] : instances) {
      if (each.last_write > forgotten) {
        oldest = std::min(oldest, each.last_write);
      }
    }
    return writes - oldest;
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
    UnregisterLocked(ended);
  }

  // The library frees the place once all readers have acknowledged the end.
  void UnregisterLocked(const Message& ended) REQUIRES(mutex) {
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
    if (status.current_count_change > 0) {
      has_newcomer.store(true);
    }
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
  std::uint64_t forgotten GUARDED_BY(mutex){0};  // Writes before are not kept.
  bool forgets{false};                           // EndpointQos::is_stream.
  std::atomic<bool> has_newcomer{false};
  Clock::time_point newcomer_until GUARDED_BY(mutex);
  typename Traits::Wire wire GUARDED_BY(mutex);
};

// Samples, on both versions of their topic.
//
// A valve stays on version 1 until its first sample with a PV, and on version 2
// from then on, also with samples that have none: the order of two topics is
// not kept. Before it changes, what it has on version 1 is acknowledged.
//
// Where version 2 has no reader and version 1 has, which is a monitor of an
// earlier version or one whose key is too old, samples go to that one without
// PV. Likewise where our own key does not permit version 2.
class SampleWriter {
 public:
  SampleWriter(Participant& participant, const PublisherOptions& options)
      : bus_(participant.impl()),
        first_(participant, options),
        second_(bus_.PermitsPv(Second::Traits::kTopic)
                    ? std::make_unique<Second>(participant, options)
                    : nullptr) {}

  WriteResult Write(const ValveSampleMessage& message,
                    const std::stop_token& stop,
                    std::chrono::milliseconds timeout) {
    switch (VersionFor(message)) {
      case Version::kFirst:
        return first_.Write(message, stop, timeout);
      case Version::kSecond:
        return second_->Write(message, stop, timeout);
      case Version::kFirstWithoutPv:
        break;
    }
    ValveSampleMessage plain = message;
    Sample& sample = plain.sample;
    sample.present = static_cast<SignalMask>(
        sample.present & ~(MaskOf(Signal::kPv) | MaskOf(Signal::kSp)));
    sample.quality[Index(Signal::kPv)] = SignalQuality::kGood;
    return first_.Write(plain, stop, timeout);
  }

  // A reader hears of the end from the writer that it heard of last.
  void Dispose(const ValveSampleMessage& message) {
    ForEach([&](auto& writer) { writer.Dispose(message); });
  }
  void Unregister(const ValveSampleMessage& message) {
    ForEach([&](auto& writer) { writer.Unregister(message); });
    const MutexLock lock(mutex_);
    changed_.erase(message.valve_id);
  }

  // A reader of samples has both versions, and is found on both within
  // milliseconds: Write() waits for that.
  bool WaitForReaders(int count, std::chrono::milliseconds timeout) const {
    const Clock::time_point deadline = DeadlineIn(timeout);
    constexpr milliseconds kLook{20};
    while (readers() < count) {
      if (Clock::now() >= deadline) {
        return false;
      }
      first_.WaitForReaders(count, std::min(kLook, LeftUntil(deadline)));
    }
    return true;
  }

  bool WaitForAcknowledged(std::chrono::milliseconds timeout) {
    const Clock::time_point deadline = DeadlineIn(timeout);
    return first_.WaitForAcknowledged(timeout) &&
           (second_ == nullptr ||
            second_->WaitForAcknowledged(LeftUntil(deadline)));
  }

  PublisherStatus status() const {
    PublisherStatus status = first_.status();
    if (second_) {
      const PublisherStatus more = second_->status();
      status.written += more.written;
      status.retries += more.retries;
      status.refused += more.refused;
      status.incompatible = std::max(status.incompatible, more.incompatible);
    }
    status.matched = readers();
    return status;
  }
  int readers() const {
    return std::max(first_.readers(), second_ ? second_->readers() : 0);
  }

 private:
  using milliseconds = std::chrono::milliseconds;
  using Second = TopicWriter<ValveSampleMessage, 2>;
  enum class Version { kFirst, kSecond, kFirstWithoutPv };
  // For the discovery of readers of version 2, and for acknowledgements.
  static constexpr milliseconds kLongestChange{1000};

  static milliseconds LeftUntil(Clock::time_point deadline) {
    return std::chrono::duration_cast<milliseconds>(
        std::max(deadline - Clock::now(), Clock::duration::zero()));
  }

  void ForEach(const auto& call) {
    if (second_) {
      call(*second_);
    }
    call(first_);
  }

  Version VersionFor(const ValveSampleMessage& message) {
    const bool has_pv = message.sample.Has(Signal::kPv);
    const MutexLock lock(mutex_);
    if (!has_pv && (changed_.empty() || !changed_.contains(message.valve_id))) {
      return Version::kFirst;
    }
    if (second_ == nullptr) {
      return Version::kFirstWithoutPv;
    }
    AwaitSameReaders();
    if (second_->readers() == 0 && first_.readers() > 0) {
      if (!std::exchange(told_, true)) {
        bus_.Log(LogLevel::kWarning,
                 std::string("pv_unread topic=") + Second::Traits::kTopic +
                     " effect=\"samples go out without PV\"");
      }
      return has_pv ? Version::kFirstWithoutPv : Version::kFirst;
    }
    if (changed_.insert(message.valve_id).second &&
        first_.LastWriteOf(message) > acknowledged_) {
      const std::uint64_t written = first_.last_write();
      first_.WaitForAcknowledged(kLongestChange);
      acknowledged_ = written;
    }
    return Version::kSecond;
  }

  // A reader that is new on version 1 is found on version 2 in a moment.
  void AwaitSameReaders() REQUIRES(mutex_) {
    const int found = first_.total_readers();
    if (second_->readers() < first_.readers() &&
        std::exchange(awaited_, found) != found) {
      second_->WaitForReaders(first_.readers(), kLongestChange);
    }
  }

  Participant::Impl& bus_;
  TopicWriter<ValveSampleMessage> first_;
  std::unique_ptr<Second> second_;  // Null: not permitted.
  Mutex mutex_;
  std::unordered_set<std::string> changed_ GUARDED_BY(mutex_);  // To version 2.
  std::uint64_t acknowledged_ GUARDED_BY(mutex_){0};            // By first_.
  int awaited_ GUARDED_BY(mutex_){0};  // Readers of first_.
  bool told_ GUARDED_BY(mutex_){false};
};

template <typename Message>
struct WriterOf {
  using Type = TopicWriter<Message>;
};
template <>
struct WriterOf<ValveSampleMessage> {
  using Type = SampleWriter;
};

}  // namespace

template <typename Message>
struct Publisher<Message>::Impl : WriterOf<Message>::Type {
  using WriterOf<Message>::Type::Type;
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
  return impl_->Write(message, stop, timeout);
}

template <typename Message>
void Publisher<Message>::Dispose(const Message& message) {
  impl_->Dispose(message);
}

template <typename Message>
void Publisher<Message>::Unregister(const Message& message) {
  impl_->Unregister(message);
}

template <typename Message>
bool Publisher<Message>::WaitForReaders(
    int count, std::chrono::milliseconds timeout) const {
  return impl_->WaitForReaders(count, timeout);
}

template <typename Message>
bool Publisher<Message>::WaitForAcknowledged(
    std::chrono::milliseconds timeout) {
  return impl_->WaitForAcknowledged(timeout);
}

template <typename Message>
PublisherStatus Publisher<Message>::status() const {
  return impl_->status();
}

template <typename Message>
int Publisher<Message>::matched() const {
  return impl_->readers();
}

template class Publisher<ValveSampleMessage>;
template class Publisher<DecisionMessage>;
template class Publisher<DecisionBatchMessage>;
template class Publisher<FaultEvent>;
template class Publisher<ValveStateMessage>;
template class Publisher<ModelSetInfoMessage>;
template class Publisher<MonitorStatusMessage>;
template class Publisher<MonitorShare>;

}  // namespace fdi::idl
