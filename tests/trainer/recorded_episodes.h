#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/valve_engine.h"
#include "storage/history.h"
#include "storage/run_types.h"

namespace fdi::trainer {

/// Records the episodes that `models` finds in `run`, with a trace of all that
/// went before them, as a monitor does. @returns their ids.
/// @param held no fault is named.
inline std::vector<std::string> RecordEpisodes(
    const std::filesystem::path& history,
    const std::shared_ptr<const ModelSet>& models,
    const storage::StoredRun& run, bool held = false) {
  storage::HistoryWriter writer(history);
  writer.BeginSession(run.info.run.start_ns, "test", "");
  ValveEngine engine(models);
  engine.HoldIsolation(held);
  std::vector<std::string> ids;
  std::vector<storage::TraceInstant> trace;
  std::uint64_t episode = 0;
  for (const storage::StoredSample& stored : run.samples) {
    const Verdict& verdict = engine.Step(stored.sample);
    trace.push_back(storage::MakeTraceInstant(stored, verdict, *models));
    for (const Transition& transition : verdict.Transitions()) {
      const storage::NewEvent event{
          run.info.run.valve_id, stored.sample.source_id, transition,
          models.get(),          transition.stamp_ns,     {}};
      writer.Record(event);
      if (transition.kind == TransitionKind::kDetected) {
        episode = storage::EpisodeIdOf(event);
        ids.push_back(storage::EpisodeIdText(episode));
      }
    }
    if (verdict.detected) {
      writer.AppendTrace(episode, trace);
      trace.clear();
    }
  }
  writer.EndSession(run.samples.back().sample.stamp_ns, true);
  return ids;
}

}  // namespace fdi::trainer
