#include "diagnosis/decision/valve_looks.h"

#include <utility>

#include "diagnosis/decision/look_answer.h"

namespace fdi {

ValveLooks::ValveLooks(const LookSimulation& simulation, const ModelSet* models)
    : looks_(simulation, models != nullptr && models->position_as_command),
      models_(models),
      trained_(models != nullptr ? TrainedSignals(*models) : TrainedSignals()),
      period_ns_(LookPeriodNs(simulation)) {}

std::optional<LookTask> ValveLooks::Step(const Sample& sample,
                                         const Verdict& verdict) {
  // Answers count by the stamps of the samples: late ones must not set this
  // clock back.
  if (!OutOfOrder(verdict.intake)) {
    stamp_ns_ = sample.stamp_ns;
  }
  const LookAnswer* found = suspicion_.found();
  auto due = looks_.Step(trained_.Of(sample), verdict, found != nullptr);
  open_ = verdict.detected;
  second_ns_ = verdict.second.open ? verdict.second.detection_stamp_ns : 0;
  if (due && due->occasion == LookOccasion::kSecond) {
    // Without a set the bits of its faults mean nothing.
    due->window.standing =
        models_ != nullptr ? models_->faults[verdict.second.standing_bit] : 0;
  }
  for (const Transition& transition : verdict.Transitions()) {
    detection_ns_ = transition.detection_stamp_ns;
    if (transition.kind == TransitionKind::kDetected && found != nullptr) {
      // The routine look names the episode at once: its answer has waited for
      // kRoutineDelayNs, longer than kLookDelayNs.
      LookTask task;
      task.stamp_ns = found->stamp_ns;
      task.detection_stamp_ns = detection_ns_;
      EnterInBook(task, *found);
    }
  }
  // Not earlier: it may destroy what `found` points to.
  suspicion_.Advance(stamp_ns_);
  return due;
}

// Row `detection` of the window, from which its explanations count, need not be
// that of the detection: that may lie before the window, or behind it where a
// routine look opened the episode.
void ValveLooks::EnterInBook(const LookTask& task, LookAnswer answer) {
  const auto behind = static_cast<std::int64_t>(answer.simulated.size()) - 1 -
                      static_cast<std::int64_t>(task.window.detection);
  const std::int64_t from_ns = task.stamp_ns - behind * period_ns_;
  for (Explanation& e : answer.faults) {
    e.start += static_cast<int>((from_ns + task.set_back_ns - detection_ns_) /
                                period_ns_);
  }
  book_.Enter(task, std::move(answer));
}

void ValveLooks::Enter(const LookTask& task, LookAnswer answer) {
  if (models_ != nullptr) {
    BindGroups(models_->groups, answer);
  }
  if (task.occasion == LookOccasion::kSecond) {
    if (task.detection_stamp_ns == second_ns_) {
      second_book_.Enter(task, std::move(answer));
    }
  } else if (task.occasion != LookOccasion::kEpisode) {
    suspicion_.Enter(task.stamp_ns, std::move(answer));
  } else if (task.detection_stamp_ns == detection_ns_) {
    if (answer.outcome == LookOutcome::kNothing && !answer.early) {
      suspicion_.Dismiss();
    }
    EnterInBook(task, std::move(answer));
  }
}

const LookAnswer* ValveLooks::Answer() const {
  return open_ ? book_.At(detection_ns_, stamp_ns_) : nullptr;
}

const LookAnswer* ValveLooks::SecondAnswer() const {
  return open_ && second_ns_ != 0 ? second_book_.At(second_ns_, stamp_ns_)
                                  : nullptr;
}

}  // namespace fdi
