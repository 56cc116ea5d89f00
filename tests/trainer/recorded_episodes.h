#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/decision/valve_engine.h"
#include "storage/history/history_database.h"
#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"
#include "storage/runs/runs.h"

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
  std::vector<TracePoint> trace;
  std::uint64_t episode = 0;
  for (const storage::StoredSample& stored : run.samples) {
    const Verdict& verdict = engine.Step(stored.sample);
    TracePoint& point = trace.emplace_back();
    point.sample = stored.sample;
    point.intake = stored.intake;
    point.initialised = stored.initialised;
    point.quality = verdict.quality;
    point.state = verdict.state;
    point.isolated = verdict.isolated;
    point.normal_factor = verdict.normal_factor;
    const auto head = [](const auto& values, std::size_t count) {
      const auto length = static_cast<std::ptrdiff_t>(count);
      return std::vector<double>(values.begin(), values.begin() + length);
    };
    point.residuals = head(verdict.residuals, models->channels.size());
    point.factors = head(verdict.fault_factors, models->faults.size());
    for (const Transition& transition : verdict.Transitions()) {
      FaultEvent event;
      event.valve_id = run.info.run.valve_id;
      event.source_id = stored.sample.source_id;
      event.transition = transition;
      event.models = models;
      event.episode_id = EpisodeId(event.valve_id, event.source_id,
                                   transition.detection_stamp_ns);
      writer.Record(event, transition.stamp_ns);
      if (transition.kind == TransitionKind::kDetected) {
        episode = event.episode_id;
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
