#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <thread>

#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>

#include "idl/checked_type.h"
#include "idl/codec.h"
#include "idl/deadline.h"
#include "idl/endpoint.h"
#include "idl/matched.h"
#include "idl/participant_impl.h"
#include "idl/qos.h"

namespace fdi::idl {
namespace {

namespace dds = eprosima::fastdds::dds;
using Clock = std::chrono::steady_clock;

// A full history often answers at once instead of blocking; this keeps the
// retries from taking the processor that the reader needs.
constexpr auto kBackOff = std::chrono::microseconds(100);
constexpr auto kDisposeTimeout = std::chrono::seconds(5);

bool IsFull(const ReturnCode& code) {
  return code == ReturnCode::RETCODE_TIMEOUT ||
         code == ReturnCode::RETCODE_OUT_OF_RESOURCES;
}

eprosima::fastrtps::Duration_t Until(Clock::time_point deadline) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::max(deadline - Clock::now(), Clock::duration::zero()));
  return {static_cast<std::int32_t>(left.count() / 1000),
          static_cast<std::uint32_t>(left.count() % 1000) * 1000000U};
}

}  // namespace

template <typename Message>
class Publisher<Message>::Impl : private dds::DataWriterListener {
 public:
  using Traits = Codec<Message>;

  Impl(Participant& participant, const PublisherOptions& options)
      : participant_(participant.impl()),
        lossless_(options.profile == Profile::kLossless) {
    const int valves =
        options.valves > 0 ? options.valves : participant.options().max_valves;
    dds::Topic* topic = participant_.TopicOf(
        Traits::kTopic,
        dds::TypeSupport(new CheckedType<typename Traits::Type>()));
    const EndpointQos ours = QosFor<Message>(options.profile, valves);
    dds::PublisherQos publisher_qos;
    if (!ours.partition.empty()) {
      publisher_qos.partition().push_back(ours.partition.c_str());
    }
    publisher_ = NotNull(participant_->create_publisher(publisher_qos),
                         "create_publisher");
    try {
      const dds::DataWriterQos qos = MakeQos(ours);
      policies_ = Describe(qos);
      writer_ = NotNull(publisher_->create_datawriter(
                            topic, qos, this,
                            dds::StatusMask::publication_matched()
                                << dds::StatusMask::offered_incompatible_qos()),
                        std::string("create_datawriter of ") + Traits::kTopic);
    } catch (...) {
      participant_->delete_publisher(publisher_);
      throw;
    }
  }

  ~Impl() override {
    writer_->set_listener(nullptr);
    // Deleting a writer frees its changes while its heartbeat may still walk
    // through them, for ever if a dead reader has not acknowledged them.
    std::size_t removed = 0;
    writer_->clear_history(&removed);
    publisher_->delete_datawriter(writer_);
    participant_->delete_publisher(publisher_);
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  WriteResult Write(const Message& message, const std::stop_token& stop,
                    std::chrono::milliseconds timeout) {
    const std::lock_guard lock(mutex_);
    Traits::Encode(message, wire_);
    const dds::InstanceHandle_t* instance = InstanceOf(message);
    if (instance == nullptr) {
      refused_.fetch_add(1, std::memory_order_relaxed);
      return WriteResult::kTooManyValves;
    }
    const auto send = [&] { return writer_->write(&wire_, *instance); };
    if (!Retry(send, "write", stop, DeadlineIn(timeout))) {
      return WriteResult::kNotSent;
    }
    written_.fetch_add(1, std::memory_order_relaxed);
    return WriteResult::kSent;
  }

  void Dispose(const Message& message) {
    const std::lock_guard lock(mutex_);
    const auto found = instances_.find(Traits::KeyOf(message));
    if (found == instances_.end()) {
      return;
    }
    Traits::EncodeKey(message, wire_);
    const auto send = [&] { return writer_->dispose(&wire_, found->second); };
    if (!Retry(send, "dispose", {}, Clock::now() + kDisposeTimeout)) {
      throw TransportError("dispose: the readers are behind",
                           static_cast<int>(ReturnCode::RETCODE_TIMEOUT));
    }
  }

  bool WaitForReaders(int count, std::chrono::milliseconds timeout) const {
    return matched_.WaitFor(count, timeout);
  }

  bool WaitForAcknowledged(std::chrono::milliseconds timeout) {
    return writer_->wait_for_acknowledgments(Until(DeadlineIn(timeout))) ==
           ReturnCode::RETCODE_OK;
  }

  int matched() const { return matched_.count(); }

  PublisherStatus status() const {
    PublisherStatus status;
    status.written = written_.load(std::memory_order_relaxed);
    status.retries = retries_.load(std::memory_order_relaxed);
    status.refused = refused_.load(std::memory_order_relaxed);
    status.incompatible = incompatible_.load(std::memory_order_relaxed);
    status.matched = matched_.count();
    return status;
  }

 private:
  dds::DataWriterQos MakeQos(const EndpointQos& ours) const {
    dds::DataWriterQos qos = ours.writer;
    const std::string name = ours.name + "_writer";
    if (const auto* policies = participant_.profiles().Writer(name)) {
      dds::DataWriterQos stated;
      Check(publisher_->get_datawriter_qos_from_profile(name, stated),
            "get_datawriter_qos_from_profile " + name);
      Override(stated, *policies, qos);
    }
    return qos;
  }

  // The instance of the message that stands in wire_; nullptr beyond the limit.
  const dds::InstanceHandle_t* InstanceOf(const Message& message) {
    auto& instance = instances_[Traits::KeyOf(message)];
    if (!instance.isDefined()) {
      instance = writer_->register_instance(&wire_);
    }
    if (instance.isDefined()) {
      return &instance;
    }
    instances_.erase(Traits::KeyOf(message));
    return nullptr;
  }

  template <typename Send>
  bool Retry(Send send, const char* operation, const std::stop_token& stop,
             Clock::time_point deadline) {
    while (true) {
      const ReturnCode code = send();
      if (code == ReturnCode::RETCODE_OK) {
        return true;
      }
      if (!IsFull(code)) {
        Check(code, std::string(operation) + " on " + Traits::kTopic);
      }
      retries_.fetch_add(1, std::memory_order_relaxed);
      if (!lossless_ || stop.stop_requested() || Clock::now() >= deadline) {
        return false;
      }
      std::this_thread::sleep_for(kBackOff);
    }
  }

  void on_publication_matched(
      dds::DataWriter* /*writer*/,
      const dds::PublicationMatchedStatus& status) override {
    matched_.Set(status.current_count);
  }

  void on_offered_incompatible_qos(
      dds::DataWriter* /*writer*/,
      const dds::OfferedIncompatibleQosStatus& status) override {
    incompatible_.store(status.total_count, std::memory_order_relaxed);
    participant_.ReportIncompatible(Traits::kTopic, false,
                                    status.last_policy_id, policies_);
  }

  Participant::Impl& participant_;
  const bool lossless_;
  dds::Publisher* publisher_{nullptr};
  dds::DataWriter* writer_{nullptr};
  PolicyTexts policies_;
  Matched matched_;
  std::atomic<std::uint64_t> written_{0};
  std::atomic<std::uint64_t> retries_{0};
  std::atomic<std::uint64_t> refused_{0};
  std::atomic<std::uint64_t> incompatible_{0};
  std::mutex mutex_;  // Guards what follows.
  std::map<typename Traits::Key, dds::InstanceHandle_t> instances_;
  typename Traits::Wire wire_;
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
  return impl_->matched();
}

template class Publisher<ValveSampleMessage>;
template class Publisher<DecisionMessage>;
template class Publisher<FaultEventMessage>;
template class Publisher<ModelSetInfoMessage>;
template class Publisher<MonitorStatusMessage>;

}  // namespace fdi::idl
