#pragma once

#include <cstdint>
#include <stop_token>
#include <string>

#include "diagnosis/log.h"
#include "idl/endpoint.h"
#include "monitor/sinks.h"
#include "storage/history_types.h"

namespace fdi::monitor {

/// Decision vectors over DDS. With the lossless profile a slow subscriber makes
/// Publish() wait, until `stop` is requested.
class BusDecisionSink : public DecisionSink {
 public:
  BusDecisionSink(idl::Participant& participant, idl::Profile profile,
                  std::stop_token stop);

  bool Publish(const std::string& valve_id, const ModelSet* models,
               const Verdict& verdict) override;

  /// Waits until all readers have what was published.
  bool WaitForAcknowledged(std::chrono::milliseconds timeout) {
    return publisher_.WaitForAcknowledged(timeout);
  }
  idl::PublisherStatus status() const { return publisher_.status(); }

 private:
  idl::Publisher<idl::DecisionMessage> publisher_;
  std::stop_token stop_;
  idl::DecisionMessage message_;
};

/// Fault events over DDS, each also a line of the log.
class BusEventSink : public EventSink {
 public:
  BusEventSink(idl::Participant& participant, LogSink log);

  bool Publish(const EpisodeEvent& event, bool persisted) override;

  /// Sends an event of an earlier session again.
  bool Resend(const storage::UnsentEvent& event);

  bool WaitForAcknowledged(std::chrono::milliseconds timeout) {
    return publisher_.WaitForAcknowledged(timeout);
  }

 private:
  bool Send(const idl::FaultEventMessage& message);

  idl::Publisher<idl::FaultEventMessage> publisher_;
  LogSink log_;
};

}  // namespace fdi::monitor
