#include "monitor/service/history_store.h"

#include <utility>

#include "base/error.h"
#include "base/log.h"
#include "monitor/trace.h"

namespace fdi::monitor {

HistoryStore::HistoryStore(const std::filesystem::path& path, Clock utc_now_ns,
                           LogSink log)
    : writer_(path), utc_now_ns_(std::move(utc_now_ns)), log_(std::move(log)) {}

void HistoryStore::BeginSession(const std::string& software,
                                const std::string& config) {
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
  std::vector<std::string> damaged;
  auto episodes = writer_.OpenEpisodes(&damaged);
  ReportDamage(damaged);
  return episodes;
}

std::vector<FaultEvent> HistoryStore::UnsentEvents() {
  std::vector<std::string> damaged;
  auto events = writer_.UnsentEvents(&damaged);
  ReportDamage(damaged);
  return events;
}

void HistoryStore::ReportDamage(const std::vector<std::string>& damaged) {
  for (const std::string& reason : damaged) {
    log_(LogLevel::kError, EventLine("history_damaged", {{"reason", reason}}));
  }
}

void HistoryStore::CommitBatch(const std::function<void()>& batch) {
  cause_changes_.clear();
  writer_.CommitBatch(batch);
  PublishCauses();
}

void HistoryStore::Record(const FaultEvent& event) {
  SkipIfNotFound("record", [&] {
    writer_.Record(event, utc_now_ns_());
    DetectCauses(event);
  });
}

void HistoryStore::WatchCauses(
    std::vector<storage::CauseGroup> groups,
    std::function<void(const storage::CauseChange&)> on_change) {
  causes_.emplace(writer_.database(), std::move(groups));
  on_cause_change_ = std::move(on_change);
  writer_.CommitBatch([this] { cause_changes_ = causes_->EndFinished(); });
  PublishCauses();
}

// Called within the transaction that records the event.
void HistoryStore::DetectCauses(const FaultEvent& event) {
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

void HistoryStore::PublishCauses() {
  for (const storage::CauseChange& change : std::exchange(cause_changes_, {})) {
    const storage::CommonCause& cause = change.cause;
    log_(LogLevel::kWarning,
         EventLine("common_cause",
                   {{"kind", std::string(CauseChangeName(change.kind))},
                    {"cause", cause.cause_id},
                    {"group", cause.group},
                    {"episodes", std::to_string(cause.members.size())}}));
    on_cause_change_(change);
  }
}

void HistoryStore::Resume(std::uint64_t episode_id, std::int64_t stamp_ns) {
  SkipIfNotFound("resume",
                 [&] { writer_.Resume(episode_id, stamp_ns, utc_now_ns_()); });
}

void HistoryStore::StoreLook(const EpisodeLook& look) {
  SkipIfNotFound("second_look", [&] { writer_.StoreLook(look); });
}

void HistoryStore::StoreStrength(const StrengthPoint& point) {
  SkipIfNotFound("strength", [&] { writer_.StoreStrength(point); });
}

void HistoryStore::AddTrace(const EpisodeTrace& trace) {
  SkipIfNotFound("trace", [&] {
    const std::vector<TracePoint> instants = trace.trace.Unpack();
    if (!instants.empty()) {
      writer_.AppendTrace(trace.episode_id, instants);
    }
    if (trace.complete) {
      writer_.EndTrace(trace.episode_id);
    }
  });
}

void HistoryStore::SkipIfNotFound(const char* operation,
                                  const std::function<void()>& call) {
  try {
    call();
  } catch (const NotFoundError& error) {
    log_(LogLevel::kError,
         EventLine("history_refused",
                   {{"operation", operation}, {"reason", error.what()}}));
  }
}

}  // namespace fdi::monitor
