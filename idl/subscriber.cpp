#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>
#include <set>
#include <unordered_map>

#include <fastdds/dds/core/LoanableSequence.hpp>
#include <fastdds/dds/core/condition/GuardCondition.hpp>
#include <fastdds/dds/core/condition/StatusCondition.hpp>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "idl/checked_type.h"
#include "idl/codec.h"
#include "idl/endpoint.h"
#include "idl/matched.h"
#include "idl/participant_impl.h"
#include "idl/qos.h"

namespace fdi::idl {
namespace {

namespace dds = eprosima::fastdds::dds;
using Clock = std::chrono::steady_clock;

constexpr int kBatch = 256;
constexpr std::size_t kRefusedLimit = 65536;

struct HandleHash {
  std::size_t operator()(const dds::InstanceHandle_t& handle) const {
    std::size_t hash = 0;  // The handle is an MD5 sum: any part will do.
    std::memcpy(
        &hash,
        static_cast<const eprosima::fastrtps::rtps::octet*>(handle.value),
        sizeof hash);
    return hash;
  }
};

// 64-bit FNV-1a over the 16 bytes of the writer's GUID.
std::uint64_t WriterId(const dds::InstanceHandle_t& writer) {
  std::uint64_t hash = 14695981039346656037U;
  for (std::size_t i = 0; i < 16; ++i) {
    hash = (hash ^ writer.value[i]) * 1099511628211U;
  }
  return hash;
}

Reception ReceptionOf(const dds::SampleInfo& info) {
  return {info.source_timestamp.to_ns(), info.reception_timestamp.to_ns(),
          WriterId(info.publication_handle)};
}

eprosima::fastrtps::Duration_t ToDuration(Clock::duration time) {
  const auto count = std::max<std::int64_t>(
      0, std::chrono::duration_cast<std::chrono::nanoseconds>(time).count());
  return {static_cast<std::int32_t>(count / 1000000000),
          static_cast<std::uint32_t>(count % 1000000000)};
}

}  // namespace

template <typename Message>
class Subscriber<Message>::Impl : private dds::DataReaderListener {
 public:
  using Traits = Codec<Message>;
  using Type = CheckedType<typename Traits::Type>;

  Impl(Participant& participant, Profile profile)
      : participant_(participant.impl()),
        max_keys_(
            4 * static_cast<std::size_t>(participant.options().max_valves) +
            1024),
        values_(kBatch),
        infos_(kBatch) {
    dds::Topic* topic =
        participant_.TopicOf(Traits::kTopic, dds::TypeSupport(new Type()));
    type_ = participant_->find_type(topic->get_type_name());
    subscriber_ =
        NotNull(participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT),
                "create_subscriber");
    try {
      const dds::DataReaderQos qos =
          MakeQos(profile, participant.options().max_valves);
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
    reader_->get_statuscondition().set_enabled_statuses(
        dds::StatusMask::data_available());
    waits_.attach_condition(reader_->get_statuscondition());
    waits_.attach_condition(interrupt_);
  }

  ~Impl() override {
    waits_.detach_condition(reader_->get_statuscondition());
    waits_.detach_condition(interrupt_);
    reader_->set_listener(nullptr);
    subscriber_->delete_datareader(reader_);
    participant_->delete_subscriber(subscriber_);
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  int Take(const Handlers<Message>& handlers, std::chrono::milliseconds timeout,
           int limit) {
    const auto longest = std::chrono::hours(24);
    const Clock::time_point deadline =
        Clock::now() + std::min<std::chrono::milliseconds>(timeout, longest);
    int handed = TakeRound(handlers, limit);
    while (handed == 0) {
      dds::ConditionSeq triggered;
      const ReturnCode code =
          waits_.wait(triggered, ToDuration(deadline - Clock::now()));
      if (code == ReturnCode::RETCODE_TIMEOUT) {
        break;
      }
      Check(code, "wait on a WaitSet");
      if (interrupt_.get_trigger_value()) {
        interrupt_.set_trigger_value(false);
        return TakeRound(handlers, limit);
      }
      handed = TakeRound(handlers, limit);
      if (handed == 0 && Clock::now() >= deadline) {
        break;
      }
    }
    return handed;
  }

  void Interrupt() { interrupt_.set_trigger_value(true); }

  bool WaitForWriters(int count, std::chrono::milliseconds timeout) const {
    return matched_.WaitFor(count, timeout);
  }

  SubscriberStatus status() const {
    SubscriberStatus status;
    status.received = received_.load(std::memory_order_relaxed);
    status.ended = ended_.load(std::memory_order_relaxed);
    status.lost = lost_.load(std::memory_order_relaxed);
    status.undecodable = undecodable_.load(std::memory_order_relaxed);
    if (const auto* type = dynamic_cast<const Type*>(type_.get())) {
      status.undecodable += type->refused();
    }
    status.rejected_instances =
        rejected_instances_.load(std::memory_order_relaxed);
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
  static dds::StatusMask Mask() {
    return dds::StatusMask::subscription_matched()
           << dds::StatusMask::requested_incompatible_qos()
           << dds::StatusMask::sample_lost()
           << dds::StatusMask::sample_rejected()
           << dds::StatusMask::liveliness_changed();
  }

  dds::DataReaderQos MakeQos(Profile profile, int valves) const {
    const EndpointQos ours = QosFor<Message>(profile, valves);
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

  // Takes from instance after instance, beginning behind the one where the last
  // round ended, so that no valve starves another; once around at most.
  int TakeRound(const Handlers<Message>& handlers, int limit) {
    int handed = 0;
    while (handed < limit) {
      values_.length(0);
      infos_.length(0);
      const ReturnCode code = reader_->take_next_instance(
          values_, infos_, std::min(kBatch, limit - handed), position_);
      if (code == ReturnCode::RETCODE_OK) {
        position_ = infos_[infos_.length() - 1].instance_handle;
        handed += HandOut(handlers);
      } else if (code != ReturnCode::RETCODE_NO_DATA) {
        Check(code, std::string("take from ") + Traits::kTopic);
      } else if (position_.isDefined()) {
        position_ = dds::InstanceHandle_t();
        if (handed > 0) {
          break;
        }
      } else {
        break;
      }
    }
    return handed;
  }

  int HandOut(const Handlers<Message>& handlers) {
    int handed = 0;
    const int count = infos_.length();
    int i = 0;
    try {
      for (; i < count; ++i) {
        if (infos_[i].valid_data) {
          handed += HandOutMessage(handlers, values_[i], infos_[i]);
        } else {
          handed += HandOutEnd(handlers, infos_[i]);
        }
      }
    } catch (...) {
      lost_.fetch_add(static_cast<std::uint64_t>(count - i - 1),
                      std::memory_order_relaxed);
      throw;
    }
    return handed;
  }

  int HandOutMessage(const Handlers<Message>& handlers,
                     const typename Traits::Wire& wire,
                     const dds::SampleInfo& info) {
    if (!Traits::Decode(wire, message_)) {
      undecodable_.fetch_add(1, std::memory_order_relaxed);
      return 0;
    }
    if (!keys_.contains(info.instance_handle)) {
      if (keys_.size() >= max_keys_) {
        keys_.clear();  // Ids that come and go for ever must not fill memory.
      }
      keys_.emplace(info.instance_handle, Traits::KeyOf(message_));
    }
    received_.fetch_add(1, std::memory_order_relaxed);
    if (handlers.on_message) {
      handlers.on_message(message_, ReceptionOf(info));
    }
    return 1;
  }

  // An end carries a hash of the key only: keys_ knows what it stands for.
  int HandOutEnd(const Handlers<Message>& handlers,
                 const dds::SampleInfo& info) {
    const auto found = keys_.find(info.instance_handle);
    if (found == keys_.end()) {
      return 0;
    }
    Message message;
    Traits::SetKey(found->second, message);
    keys_.erase(found);
    ended_.fetch_add(1, std::memory_order_relaxed);
    if (handlers.on_ended) {
      handlers.on_ended(message, ReceptionOf(info));
    }
    return 1;
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
  const std::size_t max_keys_;
  dds::TypeSupport type_;
  dds::Subscriber* subscriber_{nullptr};
  dds::DataReader* reader_{nullptr};
  dds::GuardCondition interrupt_;
  dds::WaitSet waits_;
  PolicyTexts policies_;
  bool has_lease_{false};
  Matched matched_;
  std::atomic<int> alive_{0};
  std::atomic<std::uint64_t> received_{0};
  std::atomic<std::uint64_t> ended_{0};
  std::atomic<std::uint64_t> lost_{0};
  std::atomic<std::uint64_t> undecodable_{0};
  std::atomic<std::uint64_t> rejected_instances_{0};
  std::atomic<std::uint64_t> rejected_samples_{0};
  std::atomic<std::uint64_t> incompatible_{0};
  mutable std::mutex refused_mutex_;
  std::set<dds::InstanceHandle_t> refused_valves_;
  // Of the thread that takes.
  dds::LoanableSequence<typename Traits::Wire> values_;
  dds::SampleInfoSeq infos_;
  dds::InstanceHandle_t position_;
  std::unordered_map<dds::InstanceHandle_t, typename Traits::Key, HandleHash>
      keys_;
  Message message_;
};

template <typename Message>
Subscriber<Message>::Subscriber(Participant& participant, Profile profile)
    : impl_(std::make_unique<Impl>(participant, profile)) {}

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
