#include "monitor/episode_names.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>

namespace fdi::monitor {
namespace {

bool IsIsolation(const Transition& transition) {
  return transition.kind == TransitionKind::kIsolated ||
         transition.kind == TransitionKind::kReisolated;
}

void DropIsolations(Verdict& verdict) {
  const auto begin = verdict.transitions.begin();
  const auto kept =
      std::remove_if(begin, begin + verdict.transition_count, IsIsolation);
  verdict.transition_count = static_cast<int>(kept - begin);
}

}  // namespace

EpisodeNames::EpisodeNames(std::string valve_id,
                           std::shared_ptr<const ModelSet> models,
                           LookWorker::Physics physics, LookWorker& worker)
    : valve_id_(std::move(valve_id)),
      models_(std::move(models)),
      physics_(std::move(physics)),
      worker_(&worker),
      looks_(std::in_place, *physics_) {}

const Verdict& EpisodeNames::Step(const Sample& sample, const Verdict& engine,
                                  bool held) {
  // A late sample must not date a change of the name.
  if (!OutOfOrder(engine.intake)) {
    stamp_ns_ = sample.stamp_ns;
  }
  // The looks see the verdict of the engine, not the name that counts: their
  // own answers would otherwise become what the observers say.
  auto due = looks_->Step(sample, engine);
  for (const Transition& transition : engine.Transitions()) {
    detection_ns_ = transition.detection_stamp_ns;
  }
  if (due && !held) {
    RequestLook(std::move(*due));
  }
  CollectAnswers();
  CollectGrowth();
  suspects_ = looks_->suspects() && !held;
  const simulator::LookAnswer* answer = AnswerTo(engine, held);
  const auto named =
      answer != nullptr
          ? simulator::NamesOf(
                *answer, simulator::ObserversName(*models_, engine.isolated))
          : std::optional<std::vector<int>>();
  const bool inherited = inherited_ && engine.detected && !held;
  const FaultSet observed =
      held ? engine.isolated : looks_->Observed(*models_, engine.isolated);
  // Usually nothing differs from the engine, and its verdict of 2.5 kB is not
  // copied. Once the name has differed, the transitions of the engine no longer
  // describe what was reported, so they are replaced until the episode ends
  // (own_).
  if (!named && !inherited && !own_ && observed == engine.isolated) {
    faults_ = engine.isolated;
    layer_ = Layer::kObservers;
    return engine;
  }
  verdict_ = engine;
  DropIsolations(verdict_);
  if (!engine.detected) {  // It ends under the name that it had.
    for (const auto& [bit, strength] : strengths_) {
      verdict_.strengths[bit] = strength;
    }
    for (Transition& transition : verdict_.transitions) {
      WriteName(transition);
    }
    Reset();
    return verdict_;
  }
  own_ = true;
  by_physics_ = named || inherited;
  strengths_.clear();
  if (named) {
    Name(*answer, *named);
    // An answer counts until the next one does, but is recorded once.
    if (std::exchange(look_ns_, answer->stamp_ns) != answer->stamp_ns) {
      look_ = RecordOf(*answer);
      RecordStrengths(*answer);
    }
  } else if (inherited) {
    SetName(*inherited_, Unknown::kTooEarly);
  } else if (observed != engine.isolated) {
    SetName(observed, Unknown::kTooEarly);
  }
  EmitNameChange();
  return verdict_;
}

// The one that counts at this sample, if any.
const simulator::LookAnswer* EpisodeNames::AnswerTo(const Verdict& engine,
                                                    bool held) {
  if (!engine.detected || held) {
    return nullptr;
  }
  const simulator::LookAnswer* answer = looks_->Answer();
  if (answer != nullptr) {
    inherited_.reset();
  }
  return answer;
}

// The rows, up to 27 kB, go to the worker; only what Enter() needs is kept.
void EpisodeNames::RequestLook(simulator::LookTask task) {
  simulator::LookTask key;
  key.occasion = task.occasion;
  key.stamp_ns = task.stamp_ns;
  key.window.detection = task.window.detection;
  key.detection_stamp_ns = task.detection_stamp_ns;
  pending_looks_.push_back(
      {std::move(key), worker_->Submit(valve_id_, physics_, std::move(task))});
}

// No sample waits for a simulation: wait_for(0) only asks. LookBook compares
// each look with the earlier ones; the worker takes the looks at an episode in
// their order, but a routine look that was asked for before them may come after
// them.
void EpisodeNames::CollectAnswers() {
  using std::future_status;
  static constexpr std::chrono::seconds kNow{0};
  std::erase_if(pending_looks_, [this](PendingLook& look) {
    if (look.answer.wait_for(kNow) != future_status::ready) {
      return false;
    }
    if (LookWorker::Answer answer = look.answer.get()) {
      looks_->Enter(look.task, std::move(*answer));
    }
    return true;
  });
}

void EpisodeNames::RequestGrowth() {
  if (known_.empty()) {
    return;
  }
  if (auto task = looks_->GrowthTask(known_)) {
    const auto rows = static_cast<std::int64_t>(task->window.rows.size());
    // The strength is fitted as constant over the rows.
    const std::int64_t middle_ns = task->stamp_ns - (rows - 1) * PeriodNs() / 2;
    pending_growth_.push_back(
        {middle_ns, look_ns_,
         worker_->Submit(valve_id_, physics_, std::move(*task))});
  }
}

void EpisodeNames::CollectGrowth() {
  using std::future_status;
  constexpr std::chrono::seconds kNow{0};
  while (!pending_growth_.empty() && pending_growth_.front().answer.wait_for(
                                         kNow) == future_status::ready) {
    const LookWorker::Answer answer = pending_growth_.front().answer.get();
    if (answer && answer->outcome == simulator::LookOutcome::kNamed) {
      for (const simulator::Explanation& e : answer->faults) {
        RecordStrength(e, pending_growth_.front().middle_ns);
      }
      // The next one begins where this one ended.
      if (pending_growth_.front().look_ns == look_ns_) {
        known_ = answer->faults;
      }
    }
    pending_growth_.pop_front();
  }
}

// Of a look that gives a name. An early one does so by a few seconds of data.
void EpisodeNames::RecordStrengths(const simulator::LookAnswer& answer) {
  known_.clear();
  if (answer.outcome != simulator::LookOutcome::kNamed) {
    return;
  }
  known_ = answer.faults;
  std::erase_if(known_, [this](const simulator::Explanation& e) {
    return FaultIndex(*models_, e.fault) < 0;
  });
  const auto rows = static_cast<std::int64_t>(answer.simulated.size());
  const std::int64_t first_ns = answer.stamp_ns - (rows - 1) * PeriodNs();
  for (const simulator::Explanation& e : known_) {
    // A growing fault has its strength at the end of the window. Another one
    // has had it since it began, so the middle stands for it.
    const std::int64_t begins_ns =
        std::max(first_ns, detection_ns_ + e.start * PeriodNs());
    if (!answer.early) {
      RecordStrength(e, e.growing ? answer.stamp_ns
                                  : std::midpoint(begins_ns, answer.stamp_ns));
    }
  }
}

void EpisodeNames::RecordStrength(const simulator::Explanation& e,
                                  std::int64_t stamp_ns) {
  StrengthPoint& point = strength_points_.emplace_back();
  point.stamp_ns = stamp_ns;
  point.fault = e.fault;
  point.strength = e.strength;
  point.lowest = e.lowest;
  point.highest = e.highest;
  point.layer = Layer::kPhysics;
}

std::int64_t EpisodeNames::PeriodNs() const {
  return std::llround(models_->sample_period_s * 1e9);
}

// Faults that the model set does not have cannot be recorded and stay out.
void EpisodeNames::Name(const simulator::LookAnswer& answer,
                        const std::vector<int>& faults) {
  FaultSet set = 0;
  for (const simulator::Explanation& e : answer.faults) {
    const int index = FaultIndex(*models_, e.fault);
    if (index >= 0 && std::ranges::count(faults, e.fault) > 0) {
      const auto bit = static_cast<std::size_t>(index);
      strengths_.emplace_back(bit, e.strength);
      verdict_.strengths[bit] = e.strength;
      set |= FaultSet{1} << bit;
    }
  }
  // Without a name, either no hypothesis fits, or more than four faults do.
  const bool outside = answer.outcome == simulator::LookOutcome::kNoneFits;
  SetName(set, outside ? Unknown::kOutsideKnown : Unknown::kTooEarly);
}

EpisodeLook EpisodeNames::RecordOf(const simulator::LookAnswer& answer) const {
  EpisodeLook look;
  look.period_ns = PeriodNs();
  const auto rows = static_cast<std::int64_t>(answer.simulated.size());
  look.first_ns = answer.stamp_ns - (rows - 1) * look.period_ns;
  look.misfit = answer.misfit;
  if (answer.outcome != simulator::LookOutcome::kNoneFits) {
    for (const simulator::Explanation& e : answer.faults) {
      const std::int64_t begins_ns = detection_ns_ + e.start * look.period_ns;
      look.faults.push_back({e.fault, e.strength, e.lowest, e.highest,
                             std::max(begins_ns, look.first_ns), e.growing});
    }
  }
  for (const simulator::RecordAnswer& row : answer.simulated) {
    look.x_pct.push_back(row.x_pct);
    look.flow.push_back(row.flow);
  }
  return look;
}

// `unknown`: why there is none, if there is none.
void EpisodeNames::SetName(FaultSet faults, Unknown unknown) {
  verdict_.isolated = faults;
  verdict_.state = faults != 0 ? State::kIsolated : State::kDetected;
  verdict_.unknown = faults != 0 ? Unknown::kNone : unknown;
}

// Another name than before is a transition.
void EpisodeNames::EmitNameChange() {
  if (verdict_.isolated == faults_) {
    return;
  }
  Transition changed;
  changed.kind =
      faults_ == 0 ? TransitionKind::kIsolated : TransitionKind::kReisolated;
  changed.stamp_ns = stamp_ns_;
  changed.detection_stamp_ns = detection_ns_;
  changed.unknown = verdict_.unknown;
  faults_ = verdict_.isolated;
  layer_ = by_physics_ ? Layer::kPhysics : Layer::kObservers;
  WriteName(changed);
  verdict_.transitions[static_cast<std::size_t>(verdict_.transition_count++)] =
      changed;
}

void EpisodeNames::WriteName(Transition& transition) const {
  transition.faults = faults_;
  transition.unknown = faults_ != 0 ? Unknown::kNone : transition.unknown;
  transition.layer = layer_;
  transition.factor = 0.0;
  transition.strength = 0.0;
  for (std::size_t i = 0; i < models_->faults.size(); ++i) {
    if ((faults_ == 0 || (faults_ >> i & 1U) != 0) &&
        verdict_.fault_factors[i] >= transition.factor) {
      transition.factor = verdict_.fault_factors[i];
      transition.strength = faults_ == 0 ? 0.0 : verdict_.strengths[i];
    }
  }
  if (by_physics_ && !strengths_.empty()) {
    transition.strength = strengths_.front().second;
  }
}

Transition EpisodeNames::End(Transition closed) {
  if (own_) {
    WriteName(closed);
  }
  // ValveLooks learns of an end from verdicts, and this one is in none. Unlike
  // those of std::async, the futures of promises do not block in their
  // destructors.
  looks_.emplace(*physics_);
  suspects_ = false;
  pending_looks_.clear();
  Reset();
  return closed;
}

// pending_looks_ stays: ValveLooks ignores answers to an episode that has
// ended, and routine looks go on. Answers for growth carry no episode and would
// be recorded with the next one.
void EpisodeNames::Reset() {
  own_ = false;
  by_physics_ = false;
  faults_ = 0;
  layer_ = Layer::kObservers;
  strengths_.clear();
  look_ns_ = 0;
  look_.reset();
  known_.clear();
  pending_growth_.clear();
  strength_points_.clear();
  inherited_.reset();
}

}  // namespace fdi::monitor
