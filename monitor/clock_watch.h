#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <unordered_map>

#include "base/log.h"
#include "monitor/sinks.h"

namespace fdi::monitor {

/// Reports valves with stamps that are more than an hour off this host's clock,
/// from a publisher without a battery (1970), one set wrong, or because of this
/// host. Their samples are diagnosed as they are, but listed where they were
/// stamped. Once for each source.
class ClockWatch : public ValveListener {
 public:
  ClockWatch(std::function<std::int64_t()> utc_now_ns, LogSink log);

  std::string_view name() const override { return "clock_watch"; }
  void OnVerdict(const std::string& valve_id, const Sample& sample,
                 const ValveOutcome& outcome) override;
  void OnRemoved(const std::string& valve_id, Checkpoint& last) override;

 private:
  const std::function<std::int64_t()> utc_now_ns_;
  const LogSink log_;
  std::unordered_map<std::string, std::uint64_t> sources_;  // Compared.
};

}  // namespace fdi::monitor
