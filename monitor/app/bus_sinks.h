#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>

#include "diagnosis/log.h"
#include "idl/endpoint.h"
#include "monitor/sinks.h"
#include "storage/history/episode.h"

namespace fdi::monitor {

/// Decision vectors over DDS. What nobody listens to is not sent; who comes
/// gets the last vector of every valve first. The lossless stream, if asked
/// for, is a second one: a slow subscriber of it makes Publish() wait, until
/// `stop` is requested.
class BusDecisionSink : public DecisionSink {
 public:
  BusDecisionSink(idl::Participant& participant, bool lossless,
                  std::stop_token stop);

  bool Publish(const std::string& valve_id, const ModelSet* models,
               const Verdict& verdict) override;
  bool WantsLast() override;
  void PublishLast(const std::string& valve_id, const ModelSet* models,
                   const Verdict& verdict) override;

  /// Waits until all readers have what was published.
  bool WaitForAcknowledged(std::chrono::milliseconds timeout);
  /// Of both streams; `written` of the one that was written more to.
  idl::PublisherStatus status() const;

 private:
  void Fill(const std::string& valve_id, const ModelSet* models,
            const Verdict& verdict);

  idl::Publisher<idl::DecisionMessage> live_;
  std::optional<idl::Publisher<idl::DecisionMessage>> lossless_;
  std::stop_token stop_;
  idl::DecisionMessage message_;
  bool unheard_{false};  // Vectors of some valve were not sent.
};

/// Fault events over DDS; each is a line of the log as well.
class BusEventSink : public EventSink {
 public:
  BusEventSink(idl::Participant& participant, LogSink log);

  bool Publish(const FaultEvent& event, bool persisted) override;

  bool WaitForAcknowledged(std::chrono::milliseconds timeout) {
    return publisher_.WaitForAcknowledged(timeout);
  }

 private:
  bool Send(const FaultEvent& message);

  idl::Publisher<FaultEvent> publisher_;
  LogSink log_;
};

}  // namespace fdi::monitor
