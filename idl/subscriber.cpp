#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "base/bounded_queue.h"
#include "base/mutex.h"
#include "idl/codec.h"
#include "idl/endpoint.h"
#include "idl/gap_counter.h"
#include "idl/participant_impl.h"

namespace fdi::idl {
namespace {

constexpr std::size_t kRefusedLimit = 65536;

// Messages queued for Take(): as many as fit into 8 MB; another 8 MB may have
// been taken from the queue and not handed out yet. They are queued here and
// not in the library, which scans its history at every release.
template <typename Message>
constexpr std::size_t QueueCapacity() {
  std::size_t bytes = sizeof(Message);
  if constexpr (requires(Message m) { m.vectors; }) {
    bytes += kMaxBatch * sizeof(DecisionMessage);
  }
  return std::clamp<std::size_t>((8U << 20U) / bytes, 16, 32768);
}

constexpr std::chrono::hours kMaxWait{1};  // Avoids overflow of the clock.
constexpr std::chrono::milliseconds kMaxFinalDrain{500};

struct HandleHash {
  std::size_t operator()(const dds::InstanceHandle_t& handle) const {
    std::size_t hash = 0;  // An MD5 sum: any part will do.
    std::memcpy(&hash, static_cast<const rtps::octet*>(handle.value),
                sizeof hash);
    return hash;
  }
};

// 64-bit FNV-1a over the first bytes of the writer's GUID: 12 for the
// participant, 16 with the entity.
std::uint64_t HashOf(const dds::InstanceHandle_t& writer, std::size_t bytes) {
  std::uint64_t hash = 14695981039346656037U;
  for (std::size_t i = 0; i < bytes; ++i) {
    hash = (hash ^ writer.value[i]) * 1099511628211U;
  }
  return hash;
}

}  // namespace

namespace {

template <typename Message>
struct Item {
  Message message;
  Reception reception;
  bool ended{false};
};

// The part of a reader that moves messages from the library to the queue of its
// Subscriber.
template <typename Message>
class Source {
 public:
  enum class Taken { kNothing, kMessage, kUndecodable };

  Source(dds::DataReader& reader, std::size_t max_keys)
      : reader_(reader), max_keys_(max_keys) {}
  virtual ~Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;

  // The next message that the library has.
  Taken Take(Item<Message>& item) {
    dds::SampleInfo info;
    if (TakeWire(info) != return_code::RETCODE_OK) {
      return Taken::kNothing;
    }
    item.reception = {UtcOfStamp(info.source_timestamp.to_ns()),
                      UtcOfStamp(info.reception_timestamp.to_ns()),
                      HashOf(info.publication_handle, 16),
                      HashOf(info.publication_handle, 12)};
    item.ended = !info.valid_data;
    // Counted before it is decoded: what cannot be decoded was not lost on the
    // way.
    gaps_.Count(item.reception.writer_id,
                info.sample_identity.sequence_number().to64long(),
                item.reception.sent_ns);
    if (item.ended ? !FindKey(info.instance_handle, item.message)
                   : !Decode(item.message)) {
      return Taken::kUndecodable;
    }
    if (!item.ended && !keys_.contains(info.instance_handle)) {
      // Once forgotten, the end of an instance that sends no more is
      // undecodable.
      if (keys_.size() >= max_keys_) {
        keys_.clear();  // Bounds the memory if ids keep changing.
      }
      keys_.emplace(info.instance_handle, CopyOf(KeyOf(item.message)));
    }
    return Taken::kMessage;
  }

  // A writer that removes a reader drops what the reader has not acknowledged.
  // In Fast DDS 2.9.1 it then deadlocks if its thread is sending at that
  // moment, as when it retransmits what had no room here (matched_reader_remove
  // against the flow controller, upstream pull request 3468). Hence a reader
  // with a backlog takes and acknowledges everything before it leaves, within
  // kMaxFinalDrain. This does not help against a writer that never pauses.
  void LetWritersFinish() {
    const Duration two_heartbeats{0, 100'000'000};
    const auto end = std::chrono::steady_clock::now() + kMaxFinalDrain;
    dds::SampleInfo info;
    const auto take = [&] { return TakeWire(info) == return_code::RETCODE_OK; };
    bool behind = take();
    while (behind && std::chrono::steady_clock::now() < end) {
      behind = take() || reader_.wait_for_unread_message(two_heartbeats);
    }
  }

  std::uint64_t missing() const { return gaps_.missing(); }

 protected:
  dds::DataReader& reader() { return reader_; }

 private:
  virtual ReturnCode TakeWire(dds::SampleInfo& info) = 0;
  virtual bool Decode(Message& message) = 0;

  // Sets the key of the disposed instance. A dispose carries only the instance
  // handle, an MD5 sum of the key, which `keys_` maps back.
  bool FindKey(const dds::InstanceHandle_t& handle, Message& message) {
    const auto found = keys_.find(handle);
    if (found == keys_.end()) {
      return false;
    }
    KeyOf(message) = found->second;
    keys_.erase(found);
    return true;
  }

  dds::DataReader& reader_;
  const std::size_t max_keys_;
  GapCounter gaps_{NowNs()};
  std::unordered_map<dds::InstanceHandle_t, Key<Message>, HandleHash> keys_;
};

template <typename Message, int kVersion>
class SourceOf : public Source<Message> {
 public:
  using Source<Message>::Source;

 private:
  ReturnCode TakeWire(dds::SampleInfo& info) override {
    return this->reader().take_next_sample(&wire_, &info);
  }
  bool Decode(Message& message) override {
    return Codec<Message, kVersion>::Decode(wire_, message);
  }

  typename Codec<Message, kVersion>::Wire wire_;
};

// The reader of one topic, with the library's facts about it: all but its
// messages.
class TopicReader : public dds::DataReaderListener {
 public:
  // @param type counts the messages that cannot be deserialized.
  // @param on_data called when messages have arrived, after Enable().
  TopicReader(Participant::Impl& bus, const char* topic,
              const dds::TypeSupport& type, const EndpointQos& ours,
              const std::vector<std::string>& partitions,
              std::function<void()> on_data)
      : bus_(bus), topic_(topic), on_data_(std::move(on_data)) {
    dds::Topic* handle = bus_.TopicOf(topic_, type);
    // Another endpoint may have made the topic, and registered its own type,
    // first. The registered one is that which counts refusals.
    type_ = bus_->find_type(handle->get_type_name());
    // Enabled only after everything is set, because callbacks use it.
    dds::SubscriberQos subscriber_qos;
    subscriber_qos.entity_factory().autoenable_created_entities = false;
    for (const std::string& partition : partitions) {
      subscriber_qos.partition().push_back(partition.c_str());
    }
    subscriber_ = {
        NotNull(bus_->create_subscriber(subscriber_qos), "create_subscriber"),
        [this](dds::Subscriber* each) { bus_->delete_subscriber(each); }};
    const dds::DataReaderQos qos = bus_.profiles().Override(
        ours.name + "_reader", ours.reader, *subscriber_);
    policies_ = Describe(qos);
    has_lease_ = qos.liveliness().lease_duration != kForever;
    reader_ = NotNull(subscriber_->create_datareader(handle, qos, this, Mask()),
                      std::string("create_datareader of ") + topic_);
  }

  ~TopicReader() override { subscriber_->delete_datareader(reader_); }
  TopicReader(const TopicReader&) = delete;
  TopicReader& operator=(const TopicReader&) = delete;

  void Enable() { Check(reader_->enable(), "enable a reader"); }
  // No callback comes any more.
  void Silence() { reader_->set_listener(nullptr); }

  dds::DataReader& handle() { return *reader_; }
  const Matched& matched() const { return matched_; }

  void CountUndecodable() { Add(&SubscriberStatus::undecodable); }
  void CountLost() { Add(&SubscriberStatus::lost); }
  void SetMissing(std::uint64_t missing) {
    const MutexLock lock(mutex_);
    missing_ = missing;
  }

  // All but what a Subscriber counts itself.
  // @param refused_bytes messages that could not be deserialized.
  SubscriberStatus status(std::uint64_t refused_bytes) const {
    const MutexLock lock(mutex_);
    SubscriberStatus status = counted_;
    status.undecodable += refused_bytes;
    // Numbers that were never received include the messages that are counted
    // above as rejected or refused. The larger figure counts: the library
    // leaves out what a writer overwrote, the numbers what came before the
    // first one received.
    const std::uint64_t explained = status.rejected_instances + refused_bytes;
    status.lost =
        std::max(missing_ - std::min(missing_, explained), status.lost);
    status.matched = matched_.count();
    // With an infinite lease the library reports no liveliness of writers.
    if (!has_lease_) {
      status.alive = status.matched;
    }
    status.refused_valves = refused_valves_.size();
    return status;
  }
  const dds::TypeSupport& type() const { return type_; }

 private:
  static dds::StatusMask Mask() {
    return dds::StatusMask::data_available()
           << dds::StatusMask::subscription_matched()
           << dds::StatusMask::requested_incompatible_qos()
           << dds::StatusMask::sample_lost()
           << dds::StatusMask::sample_rejected()
           << dds::StatusMask::liveliness_changed();
  }

  void Add(std::uint64_t SubscriberStatus::*count, std::uint64_t more = 1) {
    const MutexLock lock(mutex_);
    counted_.*count += more;
  }

  void on_data_available(dds::DataReader* /*reader*/) override { on_data_(); }

  void on_subscription_matched(
      dds::DataReader* /*reader*/,
      const dds::SubscriptionMatchedStatus& status) override {
    matched_.Set(status.current_count);
  }

  void on_liveliness_changed(
      dds::DataReader* /*reader*/,
      const dds::LivelinessChangedStatus& status) override {
    const MutexLock lock(mutex_);
    counted_.alive = status.alive_count;
  }

  void on_requested_incompatible_qos(
      dds::DataReader* /*reader*/,
      const dds::RequestedIncompatibleQosStatus& status) override {
    {
      const MutexLock lock(mutex_);
      counted_.incompatible = status.total_count;
    }
    bus_.ReportIncompatible(topic_, true, status.last_policy_id, policies_);
  }

  void on_sample_lost(dds::DataReader* /*reader*/,
                      const dds::SampleLostStatus& status) override {
    Add(&SubscriberStatus::lost,
        static_cast<std::uint64_t>(status.total_count_change));
  }

  void on_sample_rejected(dds::DataReader* /*reader*/,
                          const dds::SampleRejectedStatus& status) override {
    // Thousands a second may come under back-pressure: they are counted, never
    // logged one by one.
    if (status.last_reason != dds::REJECTED_BY_INSTANCES_LIMIT) {
      Add(&SubscriberStatus::rejected_samples, status.total_count_change);
      return;
    }
    Add(&SubscriberStatus::rejected_instances, status.total_count_change);
    const MutexLock lock(mutex_);
    if (refused_valves_.size() < kRefusedLimit) {
      refused_valves_.insert(status.last_instance_handle);
    }
  }

  Participant::Impl& bus_;
  const std::string topic_;
  const std::function<void()> on_data_;
  dds::TypeSupport type_;
  std::unique_ptr<dds::Subscriber, std::function<void(dds::Subscriber*)>>
      subscriber_;
  dds::DataReader* reader_{nullptr};
  PolicyTexts policies_;
  bool has_lease_{false};
  Matched matched_;

  mutable Mutex mutex_;
  // Its `lost` is the library's count, `missing_` that of the numbers.
  SubscriberStatus counted_ GUARDED_BY(mutex_);
  std::uint64_t missing_ GUARDED_BY(mutex_){0};
  std::set<dds::InstanceHandle_t> refused_valves_ GUARDED_BY(mutex_);
};

}  // namespace

// Samples have a reader of each version of their topic, all others one. The
// readers share a queue, in which messages are in the order of their arrival.
template <typename Message>
struct Subscriber<Message>::Impl {
  Impl(Participant& participant, Profile profile, Overflow overflow,
       const std::vector<std::string>& partitions)
      : bus(participant.impl()),
        holds_receipt(overflow == Overflow::kOnTheWay) {
    AddReader<1>(profile, partitions);
    if constexpr (std::is_same_v<Message, ValveSampleMessage>) {
      if (bus.PermitsPv(TopicOf<Message, 2>::kTopic)) {
        AddReader<2>(profile, partitions);
      }
    }
    for (const auto& reader : readers) {
      reader->Enable();
    }
  }

  ~Impl() {
    // Closing comes first: the receiving thread may be waiting for room, with
    // the library's locks held that deleting the reader needs.
    queue.Close();
    for (const auto& reader : readers) {
      reader->Silence();
    }
    if (!holds_receipt) {  // Otherwise nothing was rejected.
      const MutexLock lock(drain_mutex);
      for (const auto& source : sources) {
        source->LetWritersFinish();
      }
    }
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  template <int kVersion>
  void AddReader(Profile profile, const std::vector<std::string>& partitions) {
    using Traits = Codec<Message, kVersion>;
    using Type = CheckedType<typename Traits::Type>;
    const int valves = bus.options().max_valves;
    readers.push_back(std::make_unique<TopicReader>(
        bus, Traits::kTopic, dds::TypeSupport(new Type()),
        QosFor<Message>(profile, valves), partitions,
        [this] { Drain(holds_receipt); }));
    const dds::TypeSupport& type = readers.back()->type();
    refused_bytes.push_back([checked = dynamic_cast<const Type*>(type.get())] {
      return checked == nullptr ? 0 : checked->refused();
    });
    const std::size_t max_keys = 4 * static_cast<std::size_t>(valves) + 1024;
    const MutexLock lock(drain_mutex);
    sources.push_back(std::make_unique<SourceOf<Message, kVersion>>(
        readers.back()->handle(), max_keys));
  }

  // Called by the taking thread. Waits for the first message only.
  int HandOut(const Handlers<Message>& handlers,
              std::chrono::milliseconds timeout, int limit) {
    int handed = 0;
    while (handed < limit) {
      if (next == batch.size()) {
        next = 0;
        queue.PopAll(batch, handed == 0 ? std::min<std::chrono::milliseconds>(
                                              timeout, kMaxWait)
                                        : std::chrono::milliseconds(0));
        // While the queue was full, the callback left messages in the library,
        // which calls it again only when another one arrives.
        if (queue.Reopened()) {
          Drain(false);
        }
        if (batch.empty()) {
          break;
        }
      }
      // Before the handler runs, because it may throw: the next call goes on
      // behind this message.
      const Item<Message>& item = batch[next++];
      ++handed;
      (item.ended ? ended : received).fetch_add(1, std::memory_order_relaxed);
      const auto& handler =
          item.ended ? handlers.on_ended : handlers.on_message;
      if (handler) {
        handler(item.message, item.reception);
      }
    }
    return handed;
  }

  // Moves messages from the library to `queue` while there is room. Called by
  // the receiving thread, which holds locks of the library and may wait for the
  // taking thread only with holds_receipt, and by the taking thread after it
  // made room. If both call it, the second one leaves the work to the first.
  void Drain(bool waits) noexcept {
    // No request is lost: `pending` is set before the attempt to lock and read
    // after the unlocking. If the attempt fails, the other thread is still to
    // read it, and drains once more.
    pending.store(true);
    while (pending.load()) {
      if (!drain_mutex.try_lock()) {
        return;
      }
      const MutexLock lock(drain_mutex, std::adopt_lock);
      pending.store(false);
      DrainLocked(waits);
    }
  }

  // Version 1 first: a publisher goes on with version 2 once it knows that what
  // it sent on version 1 is in the library.
  void DrainLocked(bool waits) noexcept REQUIRES(drain_mutex) {
    for (std::size_t i = 0; i < sources.size(); ++i) {
      while (waits ? queue.WaitForRoom() : queue.HasRoom()) {
        if (!TakeOne(*sources[i], *readers[i])) {
          // Only now, because numbers that are still in the library look
          // missing: after a backlog it returns messages valve by valve, not in
          // the order of writing.
          readers[i]->SetMissing(sources[i]->missing());
          break;
        }
      }
    }
  }

  // @returns false if there is none.
  bool TakeOne(Source<Message>& source, TopicReader& reader) noexcept {
    using Taken = typename Source<Message>::Taken;
    try {
      Item<Message> item;
      const Taken taken = source.Take(item);
      if (taken == Taken::kUndecodable) {
        reader.CountUndecodable();
      } else if (taken == Taken::kMessage) {
        queue.TryPush(std::move(item));  // There is room, or it is closed.
      }
      return taken != Taken::kNothing;
    } catch (const std::exception&) {  // Out of memory.
      reader.CountLost();
      return true;
    }
  }

  bool WaitForWriters(int count, std::chrono::milliseconds timeout) const {
    const auto deadline = DeadlineIn(timeout);
    constexpr std::chrono::milliseconds kLook{20};
    while (status().matched < count) {
      const auto now = std::chrono::steady_clock::now();
      if (now >= deadline) {
        return false;
      }
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(deadline - now);
      readers.front()->matched().WaitFor(
          count, readers.size() == 1 ? left : std::min(kLook, left));
    }
    return true;
  }

  // A publisher has a writer of each version: writers are counted on the
  // version that has more.
  SubscriberStatus status() const {
    SubscriberStatus sum;
    for (std::size_t i = 0; i < readers.size(); ++i) {
      const SubscriberStatus one = readers[i]->status(refused_bytes[i]());
      sum.lost += one.lost;
      sum.undecodable += one.undecodable;
      sum.rejected_instances += one.rejected_instances;
      sum.rejected_samples += one.rejected_samples;
      sum.refused_valves += one.refused_valves;
      sum.incompatible = std::max(sum.incompatible, one.incompatible);
      sum.matched = std::max(sum.matched, one.matched);
      sum.alive = std::max(sum.alive, one.alive);
    }
    sum.received = received.load(std::memory_order_relaxed);
    sum.ended = ended.load(std::memory_order_relaxed);
    sum.waiting = queue.size();
    return sum;
  }

  Participant::Impl& bus;
  const bool holds_receipt;
  BoundedQueue<Item<Message>> queue{QueueCapacity<Message>()};
  std::vector<Item<Message>> batch;  // From `queue`; handed out up to `next`.
  std::size_t next{0};
  std::atomic<bool> pending{false};
  std::atomic<std::uint64_t> received{0};  // Handed out; likewise `ended`.
  std::atomic<std::uint64_t> ended{0};

  Mutex drain_mutex;
  std::vector<std::unique_ptr<Source<Message>>> sources
      GUARDED_BY(drain_mutex);  // By version.
  // Likewise; last, because their callbacks use what is above.
  std::vector<std::unique_ptr<TopicReader>> readers;
  std::vector<std::function<std::uint64_t()>> refused_bytes;
};

template <typename Message>
Subscriber<Message>::Subscriber(Participant& participant, Profile profile,
                                Overflow overflow,
                                const std::vector<std::string>& partitions)
    : impl_(
          std::make_unique<Impl>(participant, profile, overflow, partitions)) {}

template <typename Message>
Subscriber<Message>::~Subscriber() = default;

template <typename Message>
int Subscriber<Message>::Take(const Handlers<Message>& handlers,
                              std::chrono::milliseconds timeout, int limit) {
  return impl_->HandOut(handlers, timeout, limit);
}

template <typename Message>
void Subscriber<Message>::Interrupt() {
  impl_->queue.Interrupt();
}

template <typename Message>
bool Subscriber<Message>::WaitForWriters(
    int count, std::chrono::milliseconds timeout) const {
  return impl_->WaitForWriters(count, timeout);
}

template <typename Message>
SubscriberStatus Subscriber<Message>::status() const {
  return impl_->status();
}

template class Subscriber<ValveSampleMessage>;
template class Subscriber<DecisionMessage>;
template class Subscriber<DecisionBatchMessage>;
template class Subscriber<FaultEvent>;
template class Subscriber<ValveStateMessage>;
template class Subscriber<ModelSetInfoMessage>;
template class Subscriber<MonitorStatusMessage>;
template class Subscriber<MonitorShare>;

}  // namespace fdi::idl
