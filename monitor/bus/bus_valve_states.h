#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "base/mutex.h"
#include "idl/endpoint.h"
#include "monitor/sinks.h"
#include "report/fault_texts.h"
#include "report/findings/finding.h"

namespace fdi::monitor {

/// Keeps the present state of every valve on the bus, where a late reader finds
/// it, too (idl::ValveStateMessage).
///
/// A verdict tells whether the valve is judged, an event what its alarm is. An
/// alarm whose data ended, or that an earlier session left active, is not
/// confirmed until the valve is found abnormal again, and goes when the valve
/// is found normal, or when the history says that somebody has acknowledged its
/// end.
///
/// The diagnosis thread calls what ValveListener has, the publisher OnEvent(),
/// and the thread of the service the others.
class BusValveStates : public ValveListener {
 public:
  /// @param monitor as in its MonitorStatus.
  BusValveStates(idl::Participant& participant, std::string monitor,
                 report::FaultTexts texts);

  /// An alarm that was active when this session began. Before all else.
  void Recover(const storage::Episode& episode);
  void OnEvent(const FaultEvent& event);
  /// The episodes of the alarms that no data confirm.
  std::vector<std::uint64_t> Unconfirmed() const;
  /// Drops those of the Unconfirmed() alarms whose `episodes` are over.
  void EndUnconfirmed(const std::vector<std::uint64_t>& episodes);

  std::string_view name() const override { return "states"; }
  void OnVerdict(const std::string& valve_id, const Sample& sample,
                 const ValveOutcome& outcome) override;
  void OnSilence(const std::string& valve_id, Silence silence) override;
  void OnRemoved(const std::string& valve_id, Checkpoint& last) override;

 private:
  struct Valve {
    std::optional<findings::Finding> alarm;
    // The finding of the audit that the alarm took over (Episode::audit).
    std::optional<std::string> audit;
    bool left{false};                 // No data confirm the alarm.
    std::int64_t normal_ns{0};        // The valve was found normal then.
    const ModelSet* models{nullptr};  // Not read: its name is below.
    std::string model_set;
    Quality quality{Quality::kStale};
    State state{State::kNormal};
    bool partly{false};
    bool silent{true};
    std::optional<std::int64_t> unjudged_ns;  // As in ValveOutcome,
    std::string why;                          // and why.
    std::int64_t as_of_ns{0};
    idl::ValveStateMessage told;
  };
  idl::ValveStateMessage StateOf(const std::string& valve_id,
                                 const Valve& valve) const;
  void Tell(const std::string& valve_id, Valve& valve) REQUIRES(mutex_);

  const std::string monitor_;
  const report::FaultTexts texts_;
  idl::Publisher<idl::ValveStateMessage> publisher_;
  mutable Mutex mutex_;
  std::unordered_map<std::string, Valve> valves_ GUARDED_BY(mutex_);
};

}  // namespace fdi::monitor
