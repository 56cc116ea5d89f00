#pragma once

#include <deque>
#include <functional>
#include <string>
#include <unordered_map>

#include "base/printable.h"
#include "monitor/bus/bus_view.h"
#include "report/json_output.h"

namespace fdi::monitor {

/// A message from the bus as one JSON object and as one line of text.
struct WatchRecord {
  report::Json object;
  std::string line;
};

/// Turns messages into records. Decision vectors are arrays, whose meaning
/// ModelSetInfo gives. It is a topic of its own and may arrive after the first
/// vectors, so these wait for it, in order, for at most kPatience; after that,
/// factors and residuals are named by position: "#2".
class WatchRecords {
 public:
  using Clock = std::chrono::steady_clock;
  using Sink = std::function<void(const WatchRecord&)>;
  static constexpr std::chrono::seconds kPatience{2};

  /// @param utc show times in UTC instead of the local zone.
  WatchRecords(bool utc, const Sink& sink)
      : utc_(utc), sink_([sink](WatchRecord record) {
          record.line = Printable(record.line);
          sink(record);
        }) {}

  void Add(const idl::DecisionMessage& message, Clock::time_point now);
  void Add(const FaultEvent& message, Clock::time_point now);
  void Add(const idl::MonitorStatusMessage& message, Clock::time_point now);
  void Add(const idl::ValveStateMessage& message, Clock::time_point now);
  void Add(const idl::ModelSetInfoMessage& message, Clock::time_point now);

  /// Emits the waiting vectors that are due.
  void Flush(Clock::time_point now);

 private:
  WatchRecord RecordOf(const idl::DecisionMessage& message) const;
  TransitionKind KindOf(const FaultEvent& message);
  std::string Start(std::int64_t stamp_ns, const std::string& who) const;

  bool utc_;
  const std::function<void(WatchRecord)> sink_;
  ModelNames names_;
  std::unordered_map<std::uint64_t, FaultSet> names_of_episodes_;  // Open ones.
  std::deque<std::pair<Clock::time_point, idl::DecisionMessage>> waiting_;
};

}  // namespace fdi::monitor
