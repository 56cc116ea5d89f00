#include "console/console_part.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/time_text.h"
#include "base/time_units.h"
#include "diagnosis/records/valve_glob.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"

namespace fdi::console {
namespace {

using Type = monitor::Measure::Type;

std::vector<monitor::Measure> StreamMeasures(const StreamCounts& streams,
                                             std::uint64_t board_bytes) {
  constexpr std::string_view kStreams = "fdi_console_streams_total";
  return {
      {"", "fdi_console_streams", Type::kGauge, "Live streams now", "", "",
       streams.clients},
      {"", kStreams, Type::kCounter,
       "Live streams opened, refused because all places were taken, or "
       "dropped because the client did not keep up",
       "outcome", "admitted", streams.admitted},
      {"", kStreams, Type::kCounter, "", "outcome", "refused", streams.refused},
      {"", kStreams, Type::kCounter, "", "outcome", "dropped", streams.dropped},
      {"", "fdi_console_bytes", Type::kGauge,
       "Memory of the trends that the console shows", "", "", board_bytes}};
}

}  // namespace

ConsolePart::ConsolePart(const ConsoleOptions& options, std::string valves,
                         const report::GlobalOptions& global, LogSink log)
    : valves_(std::move(valves)), console_(options, global, std::move(log)) {}

void ConsolePart::Start(const monitor::PartContext& context) {
  data_ = context.data;
  console_.Start({data_.history(), data_.models(), context.software,
                  context.started_ns, context.facts, NowNs});
  constexpr std::int64_t kMonthNs = 30 * kNsPerDay;
  std::int64_t newest_ns = 0;
  for (const auto& [valve_id, stamp_ns] : context.seen) {
    newest_ns = std::max(newest_ns, stamp_ns);
  }
  for (const auto& [valve_id, stamp_ns] : context.seen) {
    if (stamp_ns >= newest_ns - kMonthNs) {
      Expect(valve_id, stamp_ns);
    }
  }
  // A valve whose stream ended has left nothing but its alarm.
  storage::HistoryReader reader(data_.history());
  constexpr std::int64_t kAll = std::numeric_limits<std::int64_t>::max();
  for (const storage::Alarm& alarm : reader.AlarmList(NowNs(), kAll)) {
    const storage::Episode& episode = alarm.episode;
    Expect(episode.valve_id,
           episode.unconfirmed_ns.value_or(episode.detected_ns));
  }
}

void ConsolePart::OnAssigned(const std::vector<std::string>& valves) {
  for (const std::string& valve_id : valves) {
    Expect(valve_id, 0);
  }
  storage::ModelStore store(data_.models());
  for (const storage::PlantLoop& loop : store.Loops()) {
    Expect(loop.name, 0);
  }
}

void ConsolePart::Expect(const std::string& valve_id, std::int64_t stamp_ns) {
  if (GlobMatches(valves_, valve_id)) {
    console_.live().Expect(valve_id, stamp_ns);
  }
}

void ConsolePart::AddMetrics(monitor::Exposition& page) const {
  page.Add(StreamMeasures(console_.streams(), console_.board_bytes()));
  const AdmissionCounts counts = console_.admissions();
  page.Family("fdi_console_actions_total", Type::kCounter,
              "What people did at the console");
  for (const auto& [action, count] : counts.actions) {
    page.Value(count, {"action", action});
  }
  page.Family("fdi_console_refused_total", Type::kCounter,
              "Requests that the console refused, by reason");
  for (const auto& [reason, count] : counts.refused) {
    page.Value(count, {"reason", reason});
  }
}

}  // namespace fdi::console
