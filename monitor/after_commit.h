#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "monitor/guard.h"
#include "monitor/sinks.h"

namespace fdi::monitor {

/// What becomes of a fault event after its commit: the steps in the order in
/// which they were added, for new events and for those of an earlier session
/// (FaultEvent::resent) alike.
///
/// A step that only tells somebody fails for itself: that is counted and
/// logged, and the next one is taken. Add all steps before the first event.
class AfterCommit : public EventSink {
 public:
  using Tell = std::function<void(const FaultEvent& event, bool persisted)>;

  AfterCommit(Counters& counters, ThrottledLog& log)
      : counters_(counters), log_(log) {}

  void Add(std::string name, Tell tell) {
    steps_.push_back({std::move(name), std::move(tell), nullptr});
  }
  /// A step whose result, and error, is that of Publish().
  void Add(EventSink& sink) { steps_.push_back({"", {}, &sink}); }

  bool Publish(const FaultEvent& event, bool persisted) override {
    bool sent = true;
    for (const Step& step : steps_) {
      if (step.sink != nullptr) {
        sent = step.sink->Publish(event, persisted) && sent;
      } else {
        Guarded(counters_, log_, step.name,
                [&] { step.tell(event, persisted); });
      }
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
