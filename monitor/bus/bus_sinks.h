#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/log.h"
#include "idl/endpoint.h"
#include "monitor/sinks.h"
#include "storage/history/episode.h"

namespace fdi::monitor {

/// Publishes decision vectors over DDS. While there is no subscriber nothing is
/// sent; a new subscriber first gets the last vector of every valve. The
/// optional batch stream carries every vector: a slow subscriber of it blocks
/// Publish() and Flush() until `stop` is requested.
class BusDecisionSink : public DecisionSink {
 public:
  /// @param batches_of monitor name in the batches; empty: no batches.
  BusDecisionSink(idl::Participant& participant, const std::string& batches_of,
                  std::stop_token stop);

  bool Publish(const std::string& valve_id, const ModelSet* models,
               const Verdict& verdict) override;
  std::uint64_t Flush() override;
  bool LastValuesDue() override;
  void PublishLast(const std::string& valve_id, const ModelSet* models,
                   const Verdict& verdict) override;
  void Remove(const std::string& valve_id) override;

  /// Waits until all subscribers have acknowledged what was published.
  bool WaitForAcknowledged(std::chrono::milliseconds timeout);
  /// Combined status of both streams; `written` excludes batches.
  idl::PublisherStatus status() const;

 private:
  bool ToLive();
  bool ToBatches() const { return batches_ && batches_->matched() > 0; }
  void Fill(const std::string& valve_id, const ModelSet* models,
            const Verdict& verdict);
  void AddToBatch(const idl::DecisionMessage& message);
  void SendBatch();

  idl::Publisher<idl::DecisionMessage> live_;
  std::optional<idl::Publisher<idl::DecisionBatchMessage>> batches_;
  std::stop_token stop_;
  idl::DecisionBatchMessage batch_;
  std::size_t batch_bytes_{0};
  std::uint64_t unsent_{0};  // Vectors in batches since the last Flush().
  idl::DecisionMessage message_;
  bool skipped_{false};  // Vectors were dropped for lack of subscribers.
};

/// Publishes fault events over DDS, and logs one line for each.
class BusEventSink : public EventSink {
 public:
  BusEventSink(idl::Participant& participant, LogSink log);

  bool Publish(const FaultEvent& event, bool persisted) override;

  bool WaitForAcknowledged(std::chrono::milliseconds timeout) {
    return publisher_.WaitForAcknowledged(timeout);
  }

 private:
  idl::Publisher<FaultEvent> publisher_;
  LogSink log_;
};

}  // namespace fdi::monitor
