#include "monitor/names/episode_names.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numeric>

namespace fdi::monitor {
namespace {

// Smaller changes of a strength are not worth a row of the history.
constexpr double kMinMove = 0.02;

}  // namespace

EpisodeNames::EpisodeNames(std::string valve_id,
                           std::shared_ptr<const ModelSet> models,
                           LookWorker::Physics physics, LookWorker* worker,
                           std::shared_ptr<const SeverityCatalogue> severities)
    : valve_id_(std::move(valve_id)),
      models_(std::move(models)),
      physics_(std::move(physics)),
      worker_(worker),
      name_(models_, std::move(severities)) {
  Reset();
}

const Verdict& EpisodeNames::Step(const Sample& sample, const Verdict& engine,
                                  bool held) {
  for (const Transition& transition : engine.Transitions()) {
    detection_ns_ = transition.detection_stamp_ns;
    if (transition.kind == TransitionKind::kDetected) {
      ForgetEpisode();
    }
  }
  EpisodeName::Inputs inputs{
      engine, engine.isolated, {}, physics_ != nullptr, {}};
  const bool in_order = !OutOfOrder(engine.intake);
  if (looks_) {
    StepLooks(sample, engine, held);
    if (engine.detected && !held && in_order) {
      inputs.look = TakeAnswer(engine);
      inputs.remembered = looks_->Observed(*models_, engine.isolated);
      inputs.on_top =
          SecondThatCounts(engine, *models_, looks_->SecondAnswer());
    }
  }
  name_.Step(inputs);
  if (!engine.detected) {
    ForgetEpisode();
  }
  if (in_order) {
    FollowStrengths(engine);
  }
  return name_.verdict();
}

// The looks see the verdict of the engine, not the name that counts: their own
// answers would otherwise become what the observers say.
void EpisodeNames::StepLooks(const Sample& sample, const Verdict& engine,
                             bool held) {
  auto due = looks_->Step(sample, engine);
  if (due && !held) {
    RequestLook(std::move(*due));
  }
  if (!OutOfOrder(engine.intake)) {
    CollectAnswers();
    CollectGrowth();
  }
  suspects_ = looks_->suspects() && !held;
}

// An answer counts until the next one does, but is recorded once.
std::optional<EpisodeName::Look> EpisodeNames::TakeAnswer(
    const Verdict& engine) {
  const LookAnswer* answer = looks_->Answer();
  auto look = LookThatCounts(engine, *models_, answer);
  if (look && std::exchange(look_ns_, answer->stamp_ns) != answer->stamp_ns) {
    look_ = RecordOf(*answer);
    RecordStrengths(*answer);
  }
  return look;
}

// What is told of the strengths is stored: at its times, and where a fault has
// moved since. Looks tell those of a name that is theirs.
void EpisodeNames::FollowStrengths(const Verdict& engine) {
  const EpisodeNow& now = name_.now();
  const bool by_look = now.source == NameSource::kLook ||
                       (now.source == NameSource::kRestart && looks_ &&
                        now.layer == Layer::kPhysics);
  // An estimate of a fault that the observers do not name says nothing.
  const bool unseen =
      now.source == NameSource::kRestart && (engine.isolated & now.faults) == 0;
  const StrengthDue due = strengths_.Step(
      engine, now.faults, engine.detected && !by_look && !unseen);
  if (by_look && due == StrengthDue::kPoint) {
    RequestGrowth();
  } else if (!by_look && due != StrengthDue::kNothing) {
    auto points = strengths_.Observed(*models_);
    if (due == StrengthDue::kPoint || HasMoved(points)) {
      std::ranges::move(points, std::back_inserter(strength_points_));
    }
  }
  name_.Follow(strength_points_);
}

// Whether a fault of the name is not as strong any more as it is said to be.
bool EpisodeNames::HasMoved(const std::vector<StrengthPoint>& points) const {
  return std::ranges::any_of(points, [this](const StrengthPoint& point) {
    const auto& named = name_.now().estimates;
    const auto found = std::ranges::find_if(named, [&](const NamedFault& n) {
      return models_->faults[n.bit] == point.fault;
    });
    return found != named.end() &&
           std::abs(point.strength - found->estimate.strength) >= kMinMove &&
           (point.strength < found->estimate.lowest ||
            point.strength > found->estimate.highest ||
            !found->estimate.has_interval());
  });
}

// The rows, up to 27 kB, go to the worker; only what Enter() needs is kept.
void EpisodeNames::RequestLook(LookTask task) {
  LookTask key;
  key.occasion = task.occasion;
  key.stamp_ns = task.stamp_ns;
  key.window.detection = task.window.detection;
  key.detection_stamp_ns = task.detection_stamp_ns;
  key.set_back_ns = task.set_back_ns;
  key.slowness = task.slowness;
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
  if (known_.empty() || name_.verdict().second.open) {
    return;  // A strength that explains both faults is that of neither.
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
    if (answer && answer->outcome == LookOutcome::kNamed) {
      for (const Explanation& e : answer->faults) {
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
void EpisodeNames::RecordStrengths(const LookAnswer& answer) {
  known_.clear();
  if (answer.outcome != LookOutcome::kNamed) {
    return;
  }
  known_ = answer.faults;
  std::erase_if(known_, [this](const Explanation& e) {
    return FaultIndex(*models_, e.fault) < 0;
  });
  const auto rows = static_cast<std::int64_t>(answer.simulated.size());
  const std::int64_t first_ns = answer.stamp_ns - (rows - 1) * PeriodNs();
  for (const Explanation& e : known_) {
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

void EpisodeNames::RecordStrength(const Explanation& e, std::int64_t stamp_ns) {
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

EpisodeLook EpisodeNames::RecordOf(const LookAnswer& answer) const {
  EpisodeLook look;
  look.period_ns = PeriodNs();
  const auto rows = static_cast<std::int64_t>(answer.simulated.size());
  look.first_ns = answer.stamp_ns - (rows - 1) * look.period_ns;
  look.misfit = answer.misfit;
  if (answer.outcome != LookOutcome::kNoneFits) {
    for (const Explanation& e : answer.faults) {
      const std::int64_t begins_ns = detection_ns_ + e.start * look.period_ns;
      look.faults.push_back({e.fault, e.strength, e.lowest, e.highest,
                             std::max(begins_ns, look.first_ns), e.growing});
    }
  }
  for (const RecordAnswer& row : answer.simulated) {
    look.x_pct.push_back(row.x_pct);
    look.flow.push_back(row.flow);
  }
  return look;
}

Transition EpisodeNames::End(Transition closed) {
  closed = name_.End(closed);
  Reset();
  return closed;
}

// ValveLooks learns of an end from verdicts, and one from outside is in none.
// Unlike those of std::async, the futures of promises do not block in their
// destructors.
void EpisodeNames::Reset() {
  if (physics_) {
    looks_.emplace(*physics_, models_.get());
  }
  suspects_ = false;
  pending_looks_.clear();
  strengths_ = {};
  ForgetEpisode();
}

// pending_looks_ stays: ValveLooks ignores answers to an episode that has
// ended, and routine looks go on. Answers for growth carry no episode and would
// be recorded with the next one.
void EpisodeNames::ForgetEpisode() {
  look_ns_ = 0;
  look_.reset();
  known_.clear();
  pending_growth_.clear();
  strength_points_.clear();
}

}  // namespace fdi::monitor
