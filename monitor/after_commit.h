#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "monitor/guard.h"
#include "monitor/sinks.h"

namespace fdi::monitor {

/// The steps for a fault event after its commit, in the order in
/// which they were added, for new events and for those of an earlier session
/// (FaultEvent::resent) alike.
///
/// A step fails for itself: its exception is counted and logged, and the next
/// one is taken. Add all steps before the first event.
class AfterCommit : public EventSink {
 public:
  using Tell = std::function<void(const FaultEvent& event, bool persisted)>;

  AfterCommit(Counters& counters, ThrottledLog& log)
      : counters_(counters), log_(log) {}

  void Add(std::string name, Tell tell) {
    steps_.push_back({std::move(name), std::move(tell), nullptr});
  }
  /// A step without which the event is not sent.
  void Add(EventSink& sink) { steps_.push_back({"bus", {}, &sink}); }

  bool Publish(const FaultEvent& event, bool persisted) override {
    bool sent = true;
    for (const Step& step : steps_) {
      bool done = step.sink == nullptr;
      Guarded(counters_, log_, step.name, [&] {
        if (step.sink != nullptr) {
          done = step.sink->Publish(event, persisted);
        } else {
          step.tell(event, persisted);
        }
      });
      sent = sent && done;
    }
    return sent;
  }

 private:
  struct Step {
    std::string name;
    Tell tell;
    EventSink* sink;  // Instead of `tell`.
  };

  Counters& counters_;
  ThrottledLog& log_;
  std::vector<Step> steps_;
};

}  // namespace fdi::monitor
