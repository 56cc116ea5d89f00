#include "monitor/service/event_hook.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "base/log.h"
#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/decision/certainty.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/findings/finding.h"
#include "storage/history/episode.h"

namespace fdi::monitor {
namespace {

constexpr std::chrono::milliseconds kTick{100};

// "f3|f6". Without a model set the names come from the candidates, which hold
// fault numbers.
std::string FaultsOf(const FaultEvent& event) {
  if (event.models != nullptr && event.transition.faults != 0) {
    return FaultSetName(*event.models, event.transition.faults);
  }
  std::vector<int> faults;
  for (const FaultCandidate& candidate : event.candidates) {
    if (candidate.isolated) {
      faults.push_back(candidate.fault);
    }
  }
  std::ranges::sort(faults);
  return JoinText(faults, "|", FaultName);
}

}  // namespace

report::Json EventJson(const FaultEvent& event, bool persisted,
                       const report::FaultTexts& texts,
                       const std::vector<storage::Shelf>& shelves,
                       const ValveIdentity& about) {
  const Transition& t = event.transition;
  const std::string fault = FaultsOf(event);
  // For an event without a fault the catalogue says "unlike any known fault",
  // which is wrong while known faults may still explain it.
  const bool named = !fault.empty() || t.unknown == Unknown::kOutsideKnown;
  const report::FaultWords words =
      texts.Words(fault, t.strength, PriorityOf(t.severity));
  const bool closed = t.kind == TransitionKind::kClosed;
  report::Json second;
  if (t.kind == TransitionKind::kSecond && event.models != nullptr) {
    second =
        SecondValue(t.second, FaultSetName(*event.models, t.second.faults));
  }
  storage::Episode episode;
  episode.valve_id = event.valve_id;
  episode.fault = fault.empty() ? std::nullopt : std::optional(fault);
  const bool shelved = std::ranges::any_of(
      shelves, [&episode](const auto& s) { return Covers(s, episode); });
  return {
      {"kind", std::string(TransitionName(t.kind))},
      {"valve_id", event.valve_id},
      {"about", findings::AboutJson(about)},
      {"episode_id", storage::EpisodeIdText(event.episode_id)},
      {"stamp_utc", FormatTime(t.stamp_ns, true)},
      {"fault", fault.empty() ? report::Json() : report::Json(fault)},
      {"second", second},
      {"name", named ? report::Json(words.name) : report::Json()},
      {"certainty", CertaintyName(CertaintyOf(event))},
      {"look_alikes", LookAlikesOf(event)},
      {"severity", std::string(SeverityName(words.severity))},
      {"priority", PriorityOf(words.severity)},
      {"discipline", words.discipline},
      {"namur", std::string(NamurName(words.namur))},
      {"check", named ? report::Json(words.check) : report::Json()},
      {"factor", t.factor},
      {"strength", fault.empty() ? report::Json() : report::Json(t.strength)},
      {"reason", closed ? report::Json(std::string(EndReasonName(t.reason)))
                        : report::Json()},
      {"model_set",
       event.model_set + "@" + std::to_string(event.model_version)},
      {"persisted", persisted},
      {"shelved", shelved}};
}

EventHook::EventHook(std::unique_ptr<EventDelivery> delivery,
                     EventHookOptions options, LogSink log)
    : delivery_(std::move(delivery)),
      options_(std::move(options)),
      log_(std::move(log)),
      tokens_(options_.per_minute),
      filled_(options_.now()) {}

EventHook::~EventHook() {
  try {
    Stop(std::chrono::milliseconds(0));
  } catch (...) {
    // The error is reported only to those who call Stop() themselves.
  }
}

void EventHook::Start() {
  worker_.Start([this] { Run(); });
}

void EventHook::Notify(report::Json event) {
  const MutexLock lock(mutex_);
  if (stopping_) {
    return;
  }
  if (newest_ || waiting_.size() >= options_.max_waiting ||
      !TakeToken(options_.now())) {
    if (newest_) {
      ++left_out_;
      ++counts_.left_out;
    }
    newest_ = std::move(event);
  } else {
    Enqueue(std::move(event));
  }
  changed_.notify_one();
}

void EventHook::Enqueue(report::Json event) {
  event["left_out"] = std::exchange(left_out_, 0);
  waiting_.push_back(std::move(event));
}

bool EventHook::TakeToken(TimePoint now) {
  const std::chrono::duration<double> since = now - filled_;
  filled_ = now;
  tokens_ =
      std::min<double>(options_.per_minute,
                       tokens_ + since.count() * options_.per_minute / 60.0);
  if (tokens_ < 1.0) {
    return false;
  }
  tokens_ -= 1.0;
  return true;
}

void EventHook::Run() {
  MutexLock lock(mutex_);
  while (true) {
    changed_.wait_for(lock, kTick, [this]() REQUIRES(mutex_) {
      return stopping_ || !waiting_.empty();
    });
    if (newest_ && waiting_.size() < options_.max_waiting &&
        TakeToken(options_.now())) {
      Enqueue(*std::exchange(newest_, std::nullopt));
    }
    if (waiting_.empty()) {
      if (stopping_) {
        return;
      }
      continue;
    }
    const std::string text = report::JsonText(waiting_.front()) + "\n";
    waiting_.pop_front();
    busy_ = true;
    lock.unlock();
    std::optional<std::string> failure;
    try {
      failure = delivery_->Deliver(text);
    } catch (const std::exception& error) {  // Out of threads or memory.
      failure = error.what();
    }
    lock.lock();
    busy_ = false;
    RecordResult(failure);
    changed_.notify_all();
  }
}

void EventHook::RecordResult(const std::optional<std::string>& failure) {
  if (!failure) {
    ++counts_.delivered;
    return;
  }
  ++counts_.failed;
  log_(LogLevel::kWarning,
       EventLine("event_hook_failed",
                 {{"reason", *failure},
                  {"failed", std::to_string(counts_.failed)},
                  {"delivered", std::to_string(counts_.delivered)}}));
}

void EventHook::Stop(std::chrono::milliseconds patience) {
  if (!worker_.started()) {
    return;
  }
  {
    MutexLock lock(mutex_);
    changed_.wait_for(lock, patience, [this]() REQUIRES(mutex_) {
      return waiting_.empty() && !busy_;
    });
    stopping_ = true;
    counts_.left_out += waiting_.size() + (newest_ ? 1 : 0);
    waiting_.clear();
    newest_.reset();
    changed_.notify_all();
  }
  delivery_->Interrupt();
  worker_.Join();
  const Counts last = counts();
  log_(LogLevel::kInfo,
       EventLine("event_hook_stopped",
                 {{"delivered", std::to_string(last.delivered)},
                  {"failed", std::to_string(last.failed)},
                  {"left_out", std::to_string(last.left_out)}}));
}

EventHook::Counts EventHook::counts() const {
  const MutexLock lock(mutex_);
  return counts_;
}

}  // namespace fdi::monitor
