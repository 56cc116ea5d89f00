#pragma once

#include <cstddef>
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
  /// Publish() ends with `gate`, which passes what it lets through to beyond(),
  /// now or later: the steps added after it.
  void AddGate(EventSink& gate) {
    Add(gate);
    gate_ = steps_.size();
  }
  EventSink& beyond() { return beyond_; }

  bool Publish(const FaultEvent& event, bool persisted) override {
    return Run(0, gate_ == 0 ? steps_.size() : gate_, event, persisted);
  }

 private:
  struct Step {
    std::string name;
    Tell tell;
    EventSink* sink;  // Instead of `tell`.
  };
  struct Beyond : EventSink {
    explicit Beyond(AfterCommit& all) : list(all) {}
    bool Publish(const FaultEvent& event, bool persisted) override {
      return list.Run(list.gate_, list.steps_.size(), event, persisted);
    }
    AfterCommit& list;
  };

  bool Run(std::size_t from, std::size_t to, const FaultEvent& event,
           bool persisted) {
    bool sent = true;
    for (std::size_t i = from; i < to; ++i) {
      if (steps_[i].sink != nullptr) {
        sent = steps_[i].sink->Publish(event, persisted) && sent;
      } else {
        Guarded(counters_, log_, steps_[i].name,
                [&] { steps_[i].tell(event, persisted); });
      }
    }
    return sent;
  }

  Counters& counters_;
  ThrottledLog& log_;
  std::vector<Step> steps_;
  std::size_t gate_{0};  // Steps up to the gate; 0: there is none.
  Beyond beyond_{*this};
};

}  // namespace fdi::monitor
