#include "monitor/service/history_store.h"

#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "base/log.h"
#include "monitor/trace.h"

namespace fdi::monitor {
namespace {

// Runs `call` and tells values that cannot be stored from a file that does not
// answer now. @throws RecordError, or what `call` throws.
void TellApart(const std::function<void()>& call) {
  try {
    call();
  } catch (const storage::SqliteError& error) {
    if (error.IsOfValues()) {
      throw RecordError(error.what());
    }
    throw;
  } catch (const DataError& error) {
    throw RecordError(error.what());
  } catch (const std::invalid_argument& error) {
    throw RecordError(error.what());
  }
}

}  // namespace

HistoryStore::HistoryStore(const std::filesystem::path& path, Clock utc_now_ns,
                           LogSink log)
    : writer_(path), utc_now_ns_(std::move(utc_now_ns)), log_(std::move(log)) {}

void HistoryStore::BeginSession(
    const std::string& software, const std::string& config,
    const std::map<std::string, std::string>& fault_names) {
  session_ = Session{software, config, fault_names};
  BeginSession(*session_);
}

void HistoryStore::BeginSession(const Session& session) {
  const std::int64_t now_ns = utc_now_ns_();
  const storage::SessionStart start = writer_.BeginSession(
      now_ns, session.software, session.config, session.fault_names);
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
  OnCurrentFile([&] { writer_.CommitBatch(batch); });
}

void HistoryStore::CommitCheckpoint(const Checkpoint& checkpoint) {
  OnCurrentFile([&] { writer_.CommitCheckpoint(checkpoint); });
}

void HistoryStore::Commit() {
  OnCurrentFile([&] { writer_.Commit(utc_now_ns_()); });
}

// Runs `call` on the file that has the name of ours.
void HistoryStore::OnCurrentFile(const std::function<void()>& call) {
  moved_ = writer_.Refresh() || moved_;
  if (!moved_) {
    TellApart(call);
    return;
  }
  if (session_) {
    BeginSession(*session_);
  }
  try {
    TellApart([&] {
      writer_.CommitBatch([&] {
        for (const auto& [id, events] : open_) {
          for (const FaultEvent& event : events) {
            writer_.Record(event, utc_now_ns_());
          }
        }
      });
    });
  } catch (const RecordError& error) {
    log_(LogLevel::kError,
         EventLine("history_refused",
                   {{"operation", "reopen"}, {"reason", error.what()}}));
  }
  for (const auto& [id, events] : open_) {
    for (const FaultEvent& event : events) {
      writer_.MarkSent(event);
    }
  }
  moved_ = false;
  throw std::runtime_error(writer_.database().path().string() +
                           " was deleted or replaced: the file that has its "
                           "name now lacks what only the old one had");
}

bool HistoryStore::Record(const FaultEvent& event) {
  bool stored = false;
  SkipIfNotFound("record", [&] {
    stored = writer_.Record(event, utc_now_ns_()) || writer_.Has(event);
  });
  const TransitionKind kind = event.transition.kind;
  if (kind == TransitionKind::kClosed) {
    open_.erase(event.episode_id);
  } else if (stored) {
    std::vector<FaultEvent>& events = open_[event.episode_id];
    if (kind != TransitionKind::kChanged && kind != TransitionKind::kSecond &&
        kind != TransitionKind::kRaised && kind != TransitionKind::kCleared) {
      events.clear();
    } else if (events.size() > 1) {
      events.pop_back();
    }
    events.push_back(event);
  }
  return stored;
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
    TellApart(call);
  } catch (const NotFoundError& error) {
    log_(LogLevel::kError,
         EventLine("history_refused",
                   {{"operation", operation}, {"reason", error.what()}}));
  }
}

}  // namespace fdi::monitor
