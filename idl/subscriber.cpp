#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <functional>
#include <set>
#include <unordered_map>
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

template <typename Message>
struct Subscriber<Message>::Impl : dds::DataReaderListener {
  using Traits = Codec<Message>;
  using Type = CheckedType<typename Traits::Type>;

  struct Item {
    Message message;
    Reception reception;
    bool ended{false};
  };

  Impl(Participant& participant, Profile profile, Overflow overflow,
       const std::vector<std::string>& partitions)
      : bus(participant.impl()),
        holds_receipt(overflow == Overflow::kOnTheWay),
        max_keys(4 * static_cast<std::size_t>(bus.options().max_valves) +
                 1024) {
    dds::Topic* topic =
        bus.TopicOf(Traits::kTopic, dds::TypeSupport(new Type()));
    // Another endpoint may have made the topic, and registered its own type,
    // first. The registered one is that which counts refusals.
    type = bus->find_type(topic->get_type_name());
    const EndpointQos ours = QosFor<Message>(profile, bus.options().max_valves);
    // Enabled only after `reader` is set, because callbacks use it.
    dds::SubscriberQos subscriber_qos;
    subscriber_qos.entity_factory().autoenable_created_entities = false;
    for (const std::string& partition : partitions) {
      subscriber_qos.partition().push_back(partition.c_str());
    }
    subscriber = {
        NotNull(bus->create_subscriber(subscriber_qos), "create_subscriber"),
        [this](dds::Subscriber* handle) { bus->delete_subscriber(handle); }};
    const dds::DataReaderQos qos = bus.profiles().Override(
        ours.name + "_reader", ours.reader, *subscriber);
    policies = Describe(qos);
    has_lease = qos.liveliness().lease_duration != kForever;
    reader = NotNull(subscriber->create_datareader(topic, qos, this, Mask()),
                     std::string("create_datareader of ") + Traits::kTopic);
    Check(reader->enable(), "enable a reader");
  }

  ~Impl() override {
    // Closing comes first: the receiving thread may be waiting for room, with
    // the library's locks held that deleting the reader needs.
    queue.Close();
    reader->set_listener(nullptr);
    if (!holds_receipt) {  // Otherwise nothing was rejected.
      LetWritersFinish();
    }
    subscriber->delete_datareader(reader);
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  static dds::StatusMask Mask() {
    return dds::StatusMask::data_available()
           << dds::StatusMask::subscription_matched()
           << dds::StatusMask::requested_incompatible_qos()
           << dds::StatusMask::sample_lost()
           << dds::StatusMask::sample_rejected()
           << dds::StatusMask::liveliness_changed();
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
    const MutexLock lock(drain_mutex);
    dds::SampleInfo info;
    const auto take = [&]() REQUIRES(drain_mutex) {
      return reader->take_next_sample(&wire, &info) == return_code::RETCODE_OK;
    };
    bool behind = take();
    while (behind && std::chrono::steady_clock::now() < end) {
      behind = take() || reader->wait_for_unread_message(two_heartbeats);
    }
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
      const Item& item = batch[next++];
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

  void DrainLocked(bool waits) noexcept REQUIRES(drain_mutex) {
    dds::SampleInfo info;
    while (waits ? queue.WaitForRoom() : queue.HasRoom()) {
      if (reader->take_next_sample(&wire, &info) != return_code::RETCODE_OK) {
        // Only now, because numbers that are still in the library look missing:
        // after a backlog it returns messages valve by valve, not in the order
        // of writing.
        const MutexLock lock(status_mutex);
        missing = gaps.missing();
        return;
      }
      try {
        Accept(info);
      } catch (const std::exception&) {  // Out of memory.
        Add(&SubscriberStatus::lost);
      }
    }
  }

  void Accept(const dds::SampleInfo& info) REQUIRES(drain_mutex) {
    Item item;
    item.reception = {info.source_timestamp.to_ns(),
                      info.reception_timestamp.to_ns(),
                      HashOf(info.publication_handle, 16),
                      HashOf(info.publication_handle, 12)};
    item.ended = !info.valid_data;
    // Counted before it is decoded: what cannot be decoded was not lost on the
    // way.
    gaps.Count(item.reception.writer_id,
               info.sample_identity.sequence_number().to64long(),
               item.reception.sent_ns);
    if (item.ended ? !FindKey(info.instance_handle, item.message)
                   : !Traits::Decode(wire, item.message)) {
      Add(&SubscriberStatus::undecodable);
      return;
    }
    if (!item.ended && !keys.contains(info.instance_handle)) {
      // Once forgotten, the end of an instance that sends no more is
      // undecodable.
      if (keys.size() >= max_keys) {
        keys.clear();  // Bounds the memory if ids keep changing.
      }
      keys.emplace(info.instance_handle, CopyOf(KeyOf(item.message)));
    }
    queue.TryPush(std::move(item));  // There is room, or it is closed.
  }

  // Sets the key of the disposed instance. A dispose carries only the instance
  // handle, an MD5 sum of the key, which `keys` maps back.
  bool FindKey(const dds::InstanceHandle_t& handle, Message& message)
      REQUIRES(drain_mutex) {
    const auto found = keys.find(handle);
    if (found == keys.end()) {
      return false;
    }
    KeyOf(message) = found->second;
    keys.erase(found);
    return true;
  }

  void Add(std::uint64_t SubscriberStatus::*count, std::uint64_t more = 1) {
    const MutexLock lock(status_mutex);
    counted.*count += more;
  }

  void on_data_available(dds::DataReader* /*reader*/) override {
    Drain(holds_receipt);
  }

  void on_subscription_matched(
      dds::DataReader* /*reader*/,
      const dds::SubscriptionMatchedStatus& status) override {
    matched.Set(status.current_count);
  }

  void on_liveliness_changed(
      dds::DataReader* /*reader*/,
      const dds::LivelinessChangedStatus& status) override {
    const MutexLock lock(status_mutex);
    counted.alive = status.alive_count;
  }

  void on_requested_incompatible_qos(
      dds::DataReader* /*reader*/,
      const dds::RequestedIncompatibleQosStatus& status) override {
    {
      const MutexLock lock(status_mutex);
      counted.incompatible = status.total_count;
    }
    bus.ReportIncompatible(Traits::kTopic, true, status.last_policy_id,
                           policies);
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
    const MutexLock lock(status_mutex);
    if (refused_valves.size() < kRefusedLimit) {
      refused_valves.insert(status.last_instance_handle);
    }
  }

  Participant::Impl& bus;
  const bool holds_receipt;
  const std::size_t max_keys;
  dds::TypeSupport type;
  std::unique_ptr<dds::Subscriber, std::function<void(dds::Subscriber*)>>
      subscriber;
  dds::DataReader* reader{nullptr};
  PolicyTexts policies;
  bool has_lease{false};
  Matched matched;
  BoundedQueue<Item> queue{QueueCapacity<Message>()};
  std::vector<Item> batch;  // Taken from `queue`; handed out up to `next`.
  std::size_t next{0};
  std::atomic<bool> pending{false};
  std::atomic<std::uint64_t> received{0};  // Handed out; likewise `ended`.
  std::atomic<std::uint64_t> ended{0};

  mutable Mutex status_mutex;
  SubscriberStatus counted
      GUARDED_BY(status_mutex);  // Its `lost` is the library's count,
  std::uint64_t missing GUARDED_BY(status_mutex){0};  // this is that of `gaps`.
  std::set<dds::InstanceHandle_t> refused_valves GUARDED_BY(status_mutex);

  Mutex drain_mutex;
  GapCounter gaps GUARDED_BY(drain_mutex){NowNs()};
  typename Traits::Wire wire GUARDED_BY(drain_mutex);
  std::unordered_map<dds::InstanceHandle_t, Key<Message>, HandleHash> keys
      GUARDED_BY(drain_mutex);
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
  return impl_->matched.WaitFor(count, timeout);
}

template <typename Message>
SubscriberStatus Subscriber<Message>::status() const {
  const Impl& impl = *impl_;
  const auto* type = dynamic_cast<const typename Impl::Type*>(impl.type.get());
  const std::uint64_t refused_bytes = type == nullptr ? 0 : type->refused();
  const MutexLock lock(impl.status_mutex);
  SubscriberStatus status = impl.counted;
  status.received = impl.received.load(std::memory_order_relaxed);
  status.ended = impl.ended.load(std::memory_order_relaxed);
  status.undecodable += refused_bytes;
  // Numbers that were never received include the messages that are counted
  // above as rejected or refused. The larger figure counts: the library leaves
  // out what a writer overwrote, the numbers what came before the first one
  // received.
  const std::uint64_t explained = status.rejected_instances + refused_bytes;
  status.lost =
      std::max(impl.missing - std::min(impl.missing, explained), status.lost);
  status.waiting = impl.queue.size();
  status.matched = impl.matched.count();
  // With an infinite lease the library reports no liveliness of writers.
  if (!impl.has_lease) {
    status.alive = status.matched;
  }
  status.refused_valves = impl.refused_valves.size();
  return status;
}

template class Subscriber<ValveSampleMessage>;
template class Subscriber<DecisionMessage>;
template class Subscriber<DecisionBatchMessage>;
template class Subscriber<FaultEvent>;
template class Subscriber<ModelSetInfoMessage>;
template class Subscriber<MonitorStatusMessage>;
template class Subscriber<PairState>;
template class Subscriber<OperatorAction>;
template class Subscriber<MonitorShare>;

}  // namespace fdi::idl
