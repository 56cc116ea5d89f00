#include <algorithm>
#include <atomic>
#include <mutex>
#include <set>
#include <unordered_map>

#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "idl/bounded_queue.h"
#include "idl/checked_type.h"
#include "idl/codec.h"
#include "idl/deadline.h"
#include "idl/endpoint.h"
#include "idl/gap_counter.h"
#include "idl/matched.h"
#include "idl/participant_impl.h"
#include "idl/qos.h"
#include "idl/reception.h"

namespace fdi::idl {
namespace {

namespace dds = eprosima::fastdds::dds;

constexpr std::size_t kRefusedLimit = 65536;

// Messages that wait for Take(), so many as fit into 16 MB. They wait here and
// not in the library, which searches its history at every release.
constexpr std::size_t QueueCapacity(std::size_t item_bytes) {
  return std::clamp<std::size_t>((16U << 20U) / item_bytes, 1024, 65536);
}

}  // namespace

template <typename Message>
class Subscriber<Message>::Impl : private dds::DataReaderListener {
 public:
  using Traits = Codec<Message>;
  using Type = CheckedType<typename Traits::Type>;

  Impl(Participant& participant, Profile profile, Overflow overflow)
      : participant_(participant.impl()),
        holds_receipt_(overflow == Overflow::kOnTheWay),
        max_keys_(
            4 * static_cast<std::size_t>(participant.options().max_valves) +
            1024) {
    dds::Topic* topic =
        participant_.TopicOf(Traits::kTopic, dds::TypeSupport(new Type()));
    type_ = participant_->find_type(topic->get_type_name());
    // The reader is enabled once reader_ is set: callbacks use it.
    dds::SubscriberQos subscriber_qos;
    subscriber_qos.entity_factory().autoenable_created_entities = false;
    const EndpointQos ours =
        QosFor<Message>(profile, participant.options().max_valves);
    if (!ours.partition.empty()) {
      subscriber_qos.partition().push_back(ours.partition.c_str());
    }
    subscriber_ = NotNull(participant_->create_subscriber(subscriber_qos),
                          "create_subscriber");
    try {
      const dds::DataReaderQos qos = MakeQos(ours);
      policies_ = Describe(qos);
      has_lease_ =
          qos.liveliness().lease_duration != eprosima::fastrtps::c_TimeInfinite;
      reader_ =
          NotNull(subscriber_->create_datareader(topic, qos, this, Mask()),
                  std::string("create_datareader of ") + Traits::kTopic);
    } catch (...) {
      participant_->delete_subscriber(subscriber_);
      throw;
    }
    Check(reader_->enable(), "enable a reader");
  }

  ~Impl() override {
    queue_.Close();
    reader_->set_listener(nullptr);
    subscriber_->delete_datareader(reader_);
    participant_->delete_subscriber(subscriber_);
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  int Take(const Handlers<Message>& handlers, std::chrono::milliseconds timeout,
           int limit) {
    int handed = HandOut(handlers, limit);
    if (handed == 0) {
      queue_.Wait(DeadlineIn(timeout));
      handed = HandOut(handlers, limit);
    }
    return handed;
  }

  void Interrupt() { queue_.Interrupt(); }

  bool WaitForWriters(int count, std::chrono::milliseconds timeout) const {
    return matched_.WaitFor(count, timeout);
  }

  SubscriberStatus status() const {
    SubscriberStatus status;
    status.received = received_.load(std::memory_order_relaxed);
    status.ended = ended_.load(std::memory_order_relaxed);
    status.undecodable = undecodable_.load(std::memory_order_relaxed);
    const auto* type = dynamic_cast<const Type*>(type_.get());
    const std::uint64_t refused_bytes = type == nullptr ? 0 : type->refused();
    status.undecodable += refused_bytes;
    status.rejected_instances =
        rejected_instances_.load(std::memory_order_relaxed);
    // Messages refused for a reason of their own are missing, too.
    const std::uint64_t missing = missing_.load(std::memory_order_relaxed);
    const std::uint64_t explained = status.rejected_instances + refused_bytes;
    status.lost = std::max(missing - std::min(missing, explained),
                           lost_.load(std::memory_order_relaxed));
    status.rejected_samples = rejected_samples_.load(std::memory_order_relaxed);
    status.incompatible = incompatible_.load(std::memory_order_relaxed);
    status.matched = matched_.count();
    status.alive =
        has_lease_ ? alive_.load(std::memory_order_relaxed) : status.matched;
    const std::lock_guard lock(refused_mutex_);
    status.refused_valves = refused_valves_.size();
    return status;
  }

 private:
  struct Item {
    Message message;
    Reception reception;
    bool ended{false};
  };

  static dds::StatusMask Mask() {
    return dds::StatusMask::data_available()
           << dds::StatusMask::subscription_matched()
           << dds::StatusMask::requested_incompatible_qos()
           << dds::StatusMask::sample_lost()
           << dds::StatusMask::sample_rejected()
           << dds::StatusMask::liveliness_changed();
  }

  dds::DataReaderQos MakeQos(const EndpointQos& ours) const {
    dds::DataReaderQos qos = ours.reader;
    const std::string name = ours.name + "_reader";
    if (const auto* policies = participant_.profiles().Reader(name)) {
      dds::DataReaderQos stated;
      Check(subscriber_->get_datareader_qos_from_profile(name, stated),
            "get_datareader_qos_from_profile " + name);
      Override(stated, *policies, qos);
    }
    return qos;
  }

  int HandOut(const Handlers<Message>& handlers, int limit) {
    int handed = 0;
    while (handed < limit) {
      auto [item, opened] = queue_.Pop();
      if (opened) {
        Drain(false);
      }
      if (!item) {
        break;
      }
      ++handed;
      if (item->ended) {
        ended_.fetch_add(1, std::memory_order_relaxed);
      } else {
        received_.fetch_add(1, std::memory_order_relaxed);
      }
      const auto& handler =
          item->ended ? handlers.on_ended : handlers.on_message;
      if (handler) {
        handler(item->message, item->reception);
      }
    }
    return handed;
  }

  // Moves from the library to queue_ while its gate is open. Called by the
  // thread that receives, which holds locks of the library and so must not
  // wait for the thread that takes but with holds_receipt_, and by the thread
  // that opens the gate: who comes second leaves the work to the first.
  void Drain(bool waits) noexcept {
    pending_.store(true);
    while (pending_.load()) {
      const std::unique_lock lock(drain_mutex_, std::try_to_lock);
      if (!lock.owns_lock()) {
        return;
      }
      pending_.store(false);
      DrainLocked(waits);
    }
  }

  void DrainLocked(bool waits) noexcept {
    dds::SampleInfo info;
    while (waits ? queue_.WaitUntilOpen() : queue_.open()) {
      if (reader_->take_next_sample(&wire_, &info) != ReturnCode::RETCODE_OK) {
        missing_.store(gaps_.missing(), std::memory_order_relaxed);
        return;
      }
      try {
        Accept(info);
      } catch (const std::exception&) {  // Out of memory.
        lost_.fetch_add(1, std::memory_order_relaxed);
      }
    }
  }

  void Accept(const dds::SampleInfo& info) {
    Item item;
    item.reception = ReceptionOf(info);
    item.ended = !info.valid_data;
    gaps_.Count(item.reception.writer_id,
                info.sample_identity.sequence_number().to64long(),
                item.reception.sent_ns);
    if (item.ended) {
      // An end carries a hash of the key: keys_ knows what it stands for.
      const auto found = keys_.find(info.instance_handle);
      if (found == keys_.end()) {
        return;
      }
      Traits::SetKey(found->second, item.message);
      keys_.erase(found);
    } else if (!Traits::Decode(wire_, item.message)) {
      undecodable_.fetch_add(1, std::memory_order_relaxed);
      return;
    } else if (!keys_.contains(info.instance_handle)) {
      if (keys_.size() >= max_keys_) {
        keys_.clear();  // Ids that come and go for ever must not fill memory.
      }
      keys_.emplace(info.instance_handle, Traits::KeyOf(item.message));
    }
    queue_.Push(std::move(item));
  }

  void on_data_available(dds::DataReader* /*reader*/) override {
    Drain(holds_receipt_);
  }

  void on_subscription_matched(
      dds::DataReader* /*reader*/,
      const dds::SubscriptionMatchedStatus& status) override {
    matched_.Set(status.current_count);
  }

  void on_liveliness_changed(
      dds::DataReader* /*reader*/,
      const dds::LivelinessChangedStatus& status) override {
    alive_.store(status.alive_count, std::memory_order_relaxed);
  }

  void on_requested_incompatible_qos(
      dds::DataReader* /*reader*/,
      const dds::RequestedIncompatibleQosStatus& status) override {
    incompatible_.store(status.total_count, std::memory_order_relaxed);
    participant_.ReportIncompatible(Traits::kTopic, true, status.last_policy_id,
                                    policies_);
  }

  void on_sample_lost(dds::DataReader* /*reader*/,
                      const dds::SampleLostStatus& status) override {
    lost_.fetch_add(static_cast<std::uint64_t>(status.total_count_change),
                    std::memory_order_relaxed);
  }

  void on_sample_rejected(dds::DataReader* /*reader*/,
                          const dds::SampleRejectedStatus& status) override {
    if (status.last_reason != dds::REJECTED_BY_INSTANCES_LIMIT) {
      rejected_samples_.fetch_add(status.total_count_change,
                                  std::memory_order_relaxed);
      return;
    }
    rejected_instances_.fetch_add(status.total_count_change,
                                  std::memory_order_relaxed);
    const std::lock_guard lock(refused_mutex_);
    if (refused_valves_.size() < kRefusedLimit) {
      refused_valves_.insert(status.last_instance_handle);
    }
  }

  Participant::Impl& participant_;
  const bool holds_receipt_;
  const std::size_t max_keys_;
  dds::TypeSupport type_;
  dds::Subscriber* subscriber_{nullptr};
  dds::DataReader* reader_{nullptr};
  PolicyTexts policies_;
  bool has_lease_{false};
  Matched matched_;
  std::atomic<int> alive_{0};
  std::atomic<std::uint64_t> received_{0};
  std::atomic<std::uint64_t> ended_{0};
  std::atomic<std::uint64_t> lost_{0};     // As the library counts,
  std::atomic<std::uint64_t> missing_{0};  // as gaps_ does.
  std::atomic<std::uint64_t> undecodable_{0};
  std::atomic<std::uint64_t> rejected_instances_{0};
  std::atomic<std::uint64_t> rejected_samples_{0};
  std::atomic<std::uint64_t> incompatible_{0};
  mutable std::mutex refused_mutex_;
  std::set<dds::InstanceHandle_t> refused_valves_;
  BoundedQueue<Item> queue_{QueueCapacity(sizeof(Item))};
  std::atomic<bool> pending_{false};
  std::mutex drain_mutex_;  // Guards what follows.
  GapCounter gaps_{NowNs()};
  typename Traits::Wire wire_;
  std::unordered_map<dds::InstanceHandle_t, typename Traits::Key, HandleHash>
      keys_;
};

template <typename Message>
Subscriber<Message>::Subscriber(Participant& participant, Profile profile,
                                Overflow overflow)
    : impl_(std::make_unique<Impl>(participant, profile, overflow)) {}

template <typename Message>
Subscriber<Message>::~Subscriber() = default;

template <typename Message>
int Subscriber<Message>::Take(const Handlers<Message>& handlers,
                              std::chrono::milliseconds timeout, int limit) {
  return impl_->Take(handlers, timeout, limit);
}

template <typename Message>
void Subscriber<Message>::Interrupt() {
  impl_->Interrupt();
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
template class Subscriber<FaultEventMessage>;
template class Subscriber<ModelSetInfoMessage>;
template class Subscriber<MonitorStatusMessage>;

}  // namespace fdi::idl
