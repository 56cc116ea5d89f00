#include "monitor/bus/bus_sinks.h"

#include <algorithm>
#include <utility>

#include "base/log.h"
#include "diagnosis/decision/certainty.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/models/models.h"

namespace fdi::monitor {
namespace {

// A UDP datagram holds at most 64 kB, part of which goes to the security
// header.
constexpr std::size_t kMaxBatchBytes = 48'000;

// Upper bound of the CDR size of one vector.
std::size_t BytesOf(const idl::DecisionMessage& message) {
  constexpr std::size_t kFixed = 128;
  const int values =
      message.channel_count + 2 * message.fault_count + message.observer_count;
  return kFixed + message.valve_id.size() +
         sizeof(double) * static_cast<std::size_t>(values);
}

std::string IsolatedNames(const FaultEvent& message) {
  const std::string names = IsolatedFaults(message);
  return names.empty() ? "unknown" : names;
}

}  // namespace

BusDecisionSink::BusDecisionSink(idl::Participant& participant,
                                 const std::string& batches_of,
                                 std::stop_token stop)
    : live_(participant, {.replaces = true}), stop_(std::move(stop)) {
  if (!batches_of.empty()) {
    batches_.emplace(participant,
                     idl::PublisherOptions{idl::Profile::kLossless, 0});
    batch_.monitor = batches_of;
  }
}

void BusDecisionSink::Fill(const std::string& valve_id, const ModelSet* models,
                           const Verdict& verdict) {
  message_.valve_id = valve_id;
  message_.model_hash = models != nullptr ? models->content_hash : 0;
  message_.channel_count =
      models != nullptr ? static_cast<int>(models->channels.size()) : 0;
  message_.fault_count =
      models != nullptr ? static_cast<int>(models->faults.size()) : 0;
  message_.observer_count =
      models != nullptr ? static_cast<int>(models->observers.size()) : 0;
  message_.verdict = verdict;
}

// While nobody reads, vectors are not even filled in. Whoever comes then gets
// the last one of each valve first; `skipped_` stands until that is done
// (LastValuesDue).
bool BusDecisionSink::ToLive() {
  skipped_ = skipped_ || live_.matched() == 0;
  return !skipped_;
}

bool BusDecisionSink::Publish(const std::string& valve_id,
                              const ModelSet* models, const Verdict& verdict) {
  if (!ToLive() && !ToBatches()) {
    return true;
  }
  Fill(valve_id, models, verdict);
  if (ToBatches()) {
    AddToBatch(message_);
  }
  return !ToLive() || live_.Write(message_) == idl::WriteResult::kSent;
}

void BusDecisionSink::AddToBatch(const idl::DecisionMessage& message) {
  const std::size_t bytes = BytesOf(message);
  if (batch_.vectors.size() >= idl::kMaxBatch ||
      batch_bytes_ + bytes > kMaxBatchBytes) {
    SendBatch();
  }
  batch_.vectors.push_back(message);
  batch_bytes_ += bytes;
}

void BusDecisionSink::SendBatch() {
  // A write into a full history blocks for 50 ms, even after a stop.
  if (stop_.stop_requested() ||
      batches_->Write(batch_, stop_) != idl::WriteResult::kSent) {
    unsent_ += batch_.vectors.size();
  }
  batch_.vectors.clear();
  batch_bytes_ = 0;
}

std::uint64_t BusDecisionSink::Flush() {
  if (!batch_.vectors.empty()) {
    SendBatch();
  }
  return std::exchange(unsent_, 0);
}

bool BusDecisionSink::LastValuesDue() {
  if (!skipped_ || live_.matched() == 0) {
    return false;
  }
  skipped_ = false;
  return true;
}

void BusDecisionSink::PublishLast(const std::string& valve_id,
                                  const ModelSet* models,
                                  const Verdict& verdict) {
  Fill(valve_id, models, verdict);
  live_.Write(message_);
}

void BusDecisionSink::Remove(const std::string& valve_id) {
  message_.valve_id = valve_id;
  live_.Unregister(message_);
}

bool BusDecisionSink::WaitForAcknowledged(std::chrono::milliseconds timeout) {
  return live_.WaitForAcknowledged(timeout) &&
         (!batches_ || batches_->WaitForAcknowledged(timeout));
}

idl::PublisherStatus BusDecisionSink::status() const {
  idl::PublisherStatus status = live_.status();
  if (batches_) {
    const idl::PublisherStatus other = batches_->status();
    status.retries += other.retries;
    status.refused = std::max(status.refused, other.refused);
    status.incompatible += other.incompatible;
    status.matched += other.matched;
  }
  return status;
}

BusEventSink::BusEventSink(idl::Participant& participant, LogSink log)
    : publisher_(participant, {.replaces = true}), log_(std::move(log)) {}

// The log names the transition itself. On the bus a kind that its type does not
// know goes by an older one (OnTheBus).
bool BusEventSink::Publish(const FaultEvent& event, bool persisted) {
  if (event.transition.notice) {
    return true;
  }
  FaultEvent message = event;
  message.persisted = persisted;
  if (log_) {
    const Transition& transition = message.transition;
    log_(
        LogLevel::kInfo,
        EventLine("fault_event",
                  {{"valve", message.valve_id},
                   {"transition", std::string(TransitionName(transition.kind))},
                   {"faults", IsolatedNames(message)},
                   {"reason", std::string(EndReasonName(transition.reason))},
                   {"episode", storage::EpisodeIdText(message.episode_id)},
                   {"persisted", message.persisted ? "true" : "false"}}));
  }
  message.transition.kind =
      OnTheBus(message.transition.kind, message.transition.faults != 0);
  return publisher_.Write(message) == idl::WriteResult::kSent;
}

}  // namespace fdi::monitor
