#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "console/console.h"
#include "monitor/service/service_part.h"

namespace fdi::console {

/// The page as a part of a running monitor.
class ConsolePart : public monitor::ServicePart {
 public:
  /// Binds the address; serves nothing yet.
  /// @param valves glob of those that the monitor serves.
  /// @throws as Console
  ConsolePart(const ConsoleOptions& options, std::string valves,
              const report::GlobalOptions& global, LogSink log);

  std::string_view name() const override { return "console"; }
  monitor::ValveListener* listener() override { return &console_.live(); }
  /// Lists also the valves that ought to be there: heard of in the last month,
  /// or in alarm.
  void Start(const monitor::PartContext& context) override;
  /// Those, and the valves of the plant's table.
  void OnAssigned(const std::vector<std::string>& valves) override;
  void OnCommitted(const FaultEvent& event, bool persisted) override {
    console_.OnCommitted(event, persisted);
  }
  void Leave() override { console_.Stop(); }
  void Close() override { console_.Close(); }
  void AddMetrics(monitor::Exposition& page) const override;

 private:
  void Expect(const std::string& valve_id, std::int64_t stamp_ns);

  const std::string valves_;
  Console console_;
  storage::DataDirectory data_;
};

}  // namespace fdi::console
