#include "monitor/app/history_store.h"

#include <algorithm>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "monitor/app/shadow.h"
#include "storage/cli/logging.h"
#include "storage/models.h"

namespace fdi::monitor {
namespace {

constexpr std::size_t kMaxUnsent = 100'000;

OpenEpisode ToOpenEpisode(const storage::Episode& stored) {
  OpenEpisode episode;
  episode.valve_id = stored.valve_id;
  episode.source_id = stored.source_id;
  episode.episode_id = stored.id;
  episode.detection_stamp_ns = stored.detected_ns;
  episode.last_stamp_ns =
      std::max({stored.detected_ns, stored.isolated_ns.value_or(0),
                stored.trace_end_ns.value_or(0)});
  episode.isolated = stored.isolated_ns.has_value();
  episode.faults = stored.fault_bits;
  for (std::size_t bit = 0; bit < stored.faults.size(); ++bit) {
    if ((stored.fault_bits >> bit & 1U) != 0) {
      episode.candidates.push_back({ParseFault(stored.faults[bit]).value_or(0),
                                    stored.peak_factor, stored.strength, true});
    }
  }
  const storage::ModelReference reference =
      storage::ParseModelReference(stored.model_set);
  episode.model_set = reference.name;
  episode.model_version = reference.version.value_or(0);
  episode.model_hash = stored.model_hash;
  return episode;
}

storage::TraceInstant ToInstant(const TracePoint& point) {
  storage::TraceInstant instant;
  instant.received.sample = point.sample;
  instant.received.intake = point.intake;
  instant.received.initialised = point.initialised;
  instant.quality = point.quality;
  instant.state = point.state;
  instant.isolated = point.isolated;
  instant.normal_factor = point.normal_factor;
  instant.residuals = point.residuals;
  instant.fault_factors = point.factors;
  return instant;
}

}  // namespace

HistoryStore::HistoryStore(const std::filesystem::path& path,
                           const std::string& software,
                           const std::string& config, Clock utc_now_ns,
                           LogSink log)
    : writer_(path), utc_now_ns_(std::move(utc_now_ns)), log_(std::move(log)) {
  const std::int64_t now_ns = utc_now_ns_();
  const storage::SessionStart start =
      writer_.BeginSession(now_ns, software, config);
  if (start.died_ns) {
    log_(LogLevel::kWarning,
         "session_died outage_s=" +
             std::to_string((now_ns - *start.died_ns) / 1'000'000'000));
    writer_.AddGap({"", *start.died_ns, now_ns, "monitor_down"});
    writer_.Commit(now_ns);
  }
}

std::vector<OpenEpisode> HistoryStore::OpenEpisodes() {
  std::vector<OpenEpisode> episodes;
  for (const storage::Episode& episode : writer_.OpenEpisodes()) {
    episodes.push_back(ToOpenEpisode(episode));
  }
  return episodes;
}

std::vector<Accumulator> HistoryStore::Accumulators() {
  std::vector<Accumulator> accumulators;
  for (storage::StoredAccumulator& stored : writer_.Accumulators()) {
    accumulators.push_back({stored.valve_id, stored.source_id,
                            stored.model_hash, stored.stamp_ns,
                            std::move(stored.bytes)});
  }
  return accumulators;
}

void HistoryStore::Keep(const Checkpoint& checkpoint) {
  std::vector<storage::CoverageCount> counts;
  for (const CoverageDay& day : checkpoint.coverage) {
    counts.push_back({day.valve_id, day.day, day.period_s, day.samples});
  }
  std::vector<storage::StoredAccumulator> accumulators;
  for (const Accumulator& a : checkpoint.accumulators) {
    accumulators.push_back(
        {a.valve_id, a.source_id, a.model_hash, a.stamp_ns, a.bytes});
  }
  KeepShadow(writer_.database(), checkpoint);  // First: it may come twice.
  writer_.Keep(counts, accumulators, checkpoint.health);
}

std::vector<Accumulator> HistoryStore::ShadowAccumulators() {
  return monitor::ShadowAccumulators(writer_.database());
}

std::vector<storage::UnsentEvent> HistoryStore::UnsentEvents() {
  return writer_.UnsentEvents();
}

void HistoryStore::MarkResent(const storage::UnsentEvent& event) {
  writer_.MarkSent(event.event_id);
}

HistoryStore::EventKey HistoryStore::KeyOf(const EpisodeEvent& event) {
  return {event.episode_id, event.transition.kind, event.transition.stamp_ns};
}

void HistoryStore::Together(const std::function<void()>& records) {
  recorded_.clear();
  cause_changes_.clear();
  writer_.Together(records);
  if (unsent_.size() >= kMaxUnsent) {
    unsent_.clear();  // They are sent again at the next start.
  }
  for (const auto& [key, event_id] : std::exchange(recorded_, {})) {
    unsent_[key] = event_id;
  }
  TellCauses();
}

void HistoryStore::Record(const EpisodeEvent& event) {
  Tolerate("record", [&] {
    const std::int64_t now_ns = utc_now_ns_();
    const std::optional<std::int64_t> id =
        event.models != nullptr
            ? writer_.Record({event.valve_id, event.source_id, event.transition,
                              event.models.get(), now_ns, event.episode_id})
            : writer_.Close(event.episode_id, event.transition.stamp_ns,
                            event.transition.reason, now_ns);
    if (id) {
      recorded_.emplace_back(KeyOf(event), *id);
    }
    LookForCauses(event);
  });
}

void HistoryStore::WatchCauses(
    std::vector<storage::CauseGroup> groups,
    std::function<void(const storage::CauseChange&)> told) {
  causes_.emplace(writer_.database(), std::move(groups));
  cause_told_ = std::move(told);
  writer_.Together([this] { cause_changes_ = causes_->EndThoseThatAreOver(); });
  TellCauses();
}

// Within the transaction that records the event.
void HistoryStore::LookForCauses(const EpisodeEvent& event) {
  if (!causes_) {
    return;
  }
  const std::string episode_id = storage::EpisodeIdText(event.episode_id);
  std::vector<storage::CauseChange> changes;
  if (event.transition.kind == TransitionKind::kIsolated ||
      event.transition.kind == TransitionKind::kReisolated) {
    changes = causes_->Isolated(episode_id, event.valve_id,
                                event.transition.stamp_ns);
  } else if (event.transition.kind == TransitionKind::kClosed) {
    changes = causes_->Ended(episode_id);
  }
  cause_changes_.insert(cause_changes_.end(), changes.begin(), changes.end());
}

void HistoryStore::TellCauses() {
  for (const storage::CauseChange& change : std::exchange(cause_changes_, {})) {
    const storage::CommonCause& cause = change.cause;
    log_(LogLevel::kWarning,
         cli::EventLine("common_cause",
                        {{"kind", std::string(CauseChangeName(change.kind))},
                         {"cause", cause.cause_id},
                         {"group", cause.group},
                         {"episodes", std::to_string(cause.members.size())}}));
    cause_told_(change);
  }
}

void HistoryStore::Resume(std::uint64_t episode_id, std::int64_t stamp_ns) {
  Tolerate("resume",
           [&] { writer_.Resume(episode_id, stamp_ns, utc_now_ns_()); });
}

void HistoryStore::AddTrace(const EpisodeTrace& trace) {
  Tolerate("trace", [&] {
    std::vector<storage::TraceInstant> instants;
    for (const TracePoint& point : trace.trace.Unpack()) {
      instants.push_back(ToInstant(point));
    }
    if (!instants.empty()) {
      writer_.AppendTrace(trace.episode_id, instants);
    }
    if (trace.complete) {
      writer_.EndTrace(trace.episode_id);
    }
  });
}

void HistoryStore::AddGap(const DataGap& gap) {
  writer_.AddGap({gap.valve_id, gap.from_ns, gap.to_ns, gap.reason});
}

void HistoryStore::MarkSent(const EpisodeEvent& event) {
  if (const auto found = unsent_.find(KeyOf(event)); found != unsent_.end()) {
    writer_.MarkSent(found->second);
    unsent_.erase(found);
  }
}

void HistoryStore::Commit() {
  writer_.Commit(utc_now_ns_());
}

void HistoryStore::EndSession() {
  writer_.EndSession(utc_now_ns_(), true);
}

void HistoryStore::Tolerate(const char* operation,
                            const std::function<void()>& call) {
  try {
    call();
  } catch (const NotFoundError& error) {
    log_(LogLevel::kError,
         cli::EventLine("history_refused",
                        {{"operation", operation}, {"reason", error.what()}}));
  }
}

}  // namespace fdi::monitor
