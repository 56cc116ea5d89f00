#include "monitor/clock_watch.h"

#include <cstdlib>
#include <utility>

#include "base/printable.h"
#include "base/time_text.h"
#include "base/time_units.h"

namespace fdi::monitor {
namespace {

// A replay at fifty times real time is that far ahead after a minute: only the
// first sample of a source is compared.
constexpr std::int64_t kFarNs = 3600 * kNsPerSecond;

}  // namespace

ClockWatch::ClockWatch(std::function<std::int64_t()> utc_now_ns, LogSink log)
    : utc_now_ns_(std::move(utc_now_ns)), log_(std::move(log)) {}

void ClockWatch::OnVerdict(const std::string& valve_id, const Sample& sample,
                           const ValveOutcome& outcome) {
  if (OutOfOrder(outcome.verdict.intake)) {
    return;  // A publisher that was superseded may go on for long.
  }
  const auto [known, fresh] = sources_.try_emplace(valve_id, sample.source_id);
  if (!fresh &&
      std::exchange(known->second, sample.source_id) == sample.source_id) {
    return;
  }
  const std::int64_t now_ns = utc_now_ns_();
  if (std::abs(now_ns - sample.stamp_ns) > kFarNs) {
    log_(LogLevel::kWarning,
         "stamps_far_from_clock valve=" + LogValue(valve_id) +
             " stamp=" + FormatTime(sample.stamp_ns, true) +
             " clock=" + FormatTime(now_ns, true));
  }
}

void ClockWatch::OnRemoved(const std::string& valve_id, Checkpoint& /*last*/) {
  sources_.erase(valve_id);
}

}  // namespace fdi::monitor
