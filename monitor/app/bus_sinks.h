#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "diagnosis/log.h"
#include "idl/endpoint.h"
#include "monitor/sinks.h"
#include "storage/history/episode.h"

namespace fdi::monitor {

/// Decision vectors over DDS. What nobody listens to is not sent; who comes
/// gets the last vector of every valve first. The stream of batches, if asked
/// for, is a second one, which has every vector: a slow subscriber of it makes
/// Publish() and Flush() wait, until `stop` is requested.
class BusDecisionSink : public DecisionSink {
 public:
  /// @param batches_of the monitor as subscribers of batches see it; empty: no
  ///   batches.
  /// @param partitions where subscribers read, and a monitor that stands in
  ///   for us; none: the usual one.
  BusDecisionSink(idl::Participant& participant, const std::string& batches_of,
                  std::stop_token stop,
                  const std::vector<std::string>& partitions = {});

  bool Publish(const std::string& valve_id, const ModelSet* models,
               const Verdict& verdict) override;
  std::uint64_t Flush() override;
  bool WantsLast() override;
  void PublishLast(const std::string& valve_id, const ModelSet* models,
                   const Verdict& verdict) override;

  /// What Publish() sends.
  static void Fill(const std::string& valve_id, const ModelSet* models,
                   const Verdict& verdict, idl::DecisionMessage& message);
  /// As Publish().
  bool Send(const idl::DecisionMessage& message);
  /// Who comes from now on gets nothing that was sent before.
  void Forget() { live_.Forget(); }
  /// Subscribers so far; see idl::Publisher.
  int came() const { return live_.came(); }

  /// Waits until all readers have what was published.
  bool WaitForAcknowledged(std::chrono::milliseconds timeout);
  /// Of both streams; `written` without batches.
  idl::PublisherStatus status() const;

 private:
  bool ToLive();
  bool ToBatches() const { return batches_ && batches_->matched() > 0; }
  void AddToBatch(const idl::DecisionMessage& message);
  void SendBatch();

  idl::Publisher<idl::DecisionMessage> live_;
  std::optional<idl::Publisher<idl::DecisionBatchMessage>> batches_;
  std::stop_token stop_;
  idl::DecisionBatchMessage batch_;
  std::size_t batch_bytes_{0};
  std::uint64_t unsent_{0};  // Of batches, since the last Flush().
  idl::DecisionMessage message_;
  bool unheard_{false};  // Vectors of some valve were not sent.
};

/// Fault events over DDS; each is a line of the log as well.
class BusEventSink : public EventSink {
 public:
  /// @param partitions as of BusDecisionSink.
  BusEventSink(idl::Participant& participant, LogSink log,
               const std::vector<std::string>& partitions = {});

  bool Publish(const FaultEvent& event, bool persisted) override;
  /// For subscribers that came after `event` was published by another one.
  void Repeat(const FaultEvent& event) { publisher_.Write(event); }
  int came() const { return publisher_.came(); }

  bool WaitForAcknowledged(std::chrono::milliseconds timeout) {
    return publisher_.WaitForAcknowledged(timeout);
  }

 private:
  bool Send(const FaultEvent& message);

  idl::Publisher<FaultEvent> publisher_;
  LogSink log_;
};

}  // namespace fdi::monitor
