#include "monitor/event_outbox.h"

#include <exception>
#include <string>
#include <utility>

namespace fdi::monitor {

EventOutbox::EventOutbox(EventSink& sink, Counters& counters, ThrottledLog& log,
                         std::chrono::milliseconds patience,
                         std::function<void(const EpisodeEvent&)> on_sent)
    : sink_(sink),
      counters_(counters),
      log_(log),
      patience_(patience),
      on_sent_(std::move(on_sent)),
      thread_([this] { Run(); }) {}

EventOutbox::~EventOutbox() {
  Stop();
}

std::shared_ptr<PendingEvent> EventOutbox::Add(EpisodeEvent event) {
  auto pending = std::make_shared<PendingEvent>(
      std::move(event), PendingEvent::Clock::now() + patience_);
  const std::lock_guard lock(mutex_);
  pending_.push_back(pending);
  changed_.notify_all();
  return pending;
}

void EventOutbox::Settle(PendingEvent& pending, bool stored) {
  const std::lock_guard lock(mutex_);
  pending.stage_ =
      stored ? PendingEvent::Stage::kStored : PendingEvent::Stage::kFailed;
  changed_.notify_all();
}

void EventOutbox::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) {
    thread_.join();
  }
}

void EventOutbox::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || !pending_.empty(); });
    if (pending_.empty()) {
      return;
    }
    const std::shared_ptr<PendingEvent> next = pending_.front();
    changed_.wait_until(lock, next->deadline, [this, &next] {
      return stopping_ || next->stage_ != PendingEvent::Stage::kWaiting;
    });
    const bool persisted = next->stage_ == PendingEvent::Stage::kStored;
    pending_.pop_front();
    lock.unlock();
    Publish(*next, persisted);
    lock.lock();
  }
}

void EventOutbox::Publish(const PendingEvent& pending, bool persisted) {
  const EpisodeEvent& event = pending.event;
  bool sent = false;
  std::string reason = "refused";
  try {
    sent = sink_.Publish(event, persisted);
  } catch (const std::exception& error) {
    reason = error.what();
  }
  const auto fields = [&] {
    return "valve=" + event.valve_id +
           " transition=" + std::string(TransitionName(event.transition.kind));
  };
  if (!persisted) {
    counters_.Add(Counter::kEventsUnpersisted);
    log_.Report(LogId::kUnpersisted, "event_unpersisted", fields);
  }
  if (sent) {
    counters_.Add(Counter::kEvents);
    on_sent_(event);
  } else {
    counters_.Add(Counter::kEventsUnsent);
    log_.Report(LogId::kUnsent, "publication_failed", [&] {
      return "topic=FaultEvent " + fields() + " reason=\"" + reason + "\"";
    });
  }
}

}  // namespace fdi::monitor
