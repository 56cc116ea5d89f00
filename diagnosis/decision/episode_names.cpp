#include "diagnosis/decision/episode_names.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

namespace fdi {
namespace {

// Smaller changes of a strength are not worth a row of the history.
constexpr double kMinMove = 0.02;

// The distance of an explanation is the difference in −2 ln likelihood from the
// best one, with the errors of that one, or those of the models where these are
// larger (SecondLook). Over the number of readings it is the difference of
// their mean square errors.
std::optional<LookRival> RivalOf(const LookAnswer& answer) {
  for (const Explanation& e : answer.others) {
    if (!Explains(answer.faults, e.fault) && answer.misfit > 0.0 &&
        answer.readings > 0.0) {
      const double more =
          e.distance * std::max(1.0, answer.misfit) / answer.readings;
      return LookRival{e.fault, (answer.misfit + more) / answer.misfit};
    }
  }
  return std::nullopt;
}

}  // namespace

EpisodeNames::EpisodeNames(std::shared_ptr<const ModelSet> models,
                           std::shared_ptr<const LookSimulation> simulation,
                           std::shared_ptr<const SeverityCatalogue> severities)
    : models_(std::move(models)),
      simulation_(std::move(simulation)),
      name_(models_, std::move(severities)) {
  Reset();
}

const Verdict& EpisodeNames::Step(const Sample& sample, const Verdict& engine,
                                  bool held) {
  held_ = held;
  for (const Transition& transition : engine.Transitions()) {
    detection_ns_ = transition.detection_stamp_ns;
    if (transition.kind == TransitionKind::kDetected) {
      ForgetEpisode();
    }
  }
  open_ = engine.detected;
  EpisodeName::Inputs inputs{engine, {}, simulation_ != nullptr, {}};
  const bool in_order = !OutOfOrder(engine.intake);
  if (looks_) {
    StepLooks(sample, engine);
    if (open_ && !held && in_order) {
      inputs.look = TakeAnswer(engine);
      inputs.on_top =
          SecondThatCounts(engine, *models_, looks_->SecondAnswer());
    }
  }
  overruled_ = inputs.look.has_value();
  name_.Step(inputs);
  if (!open_) {
    ForgetEpisode();
  }
  if (in_order) {
    FollowStrengths(engine);
  }
  return name_.verdict();
}

// The looks see the verdict of the engine, not the name that counts: their own
// answers would otherwise become those of the observers.
void EpisodeNames::StepLooks(const Sample& sample, const Verdict& engine) {
  auto due = looks_->Step(sample, engine);
  if (due && !held_) {
    due_.push_back(std::move(*due));
  }
}

void EpisodeNames::Answer(const LookTask& task, LookAnswer answer) {
  if (task.occasion == LookOccasion::kGrowth) {
    AnswerGrowth(task, answer);
  } else if (looks_) {
    looks_->Enter(task, std::move(answer));
  }
}

// An answer counts until the next one does, but is recorded once.
std::optional<EpisodeName::Look> EpisodeNames::TakeAnswer(
    const Verdict& engine) {
  const LookAnswer* answer = looks_->Answer();
  auto look = LookThatCounts(engine, *models_, answer);
  if (look && std::exchange(look_ns_, answer->stamp_ns) != answer->stamp_ns) {
    look_ = RecordOf(*answer);
    for (std::size_t i = 0; i < models_->faults.size(); ++i) {
      if (Has(engine.isolated, i) && IsFault(models_->faults[i])) {
        look_->observers.push_back(models_->faults[i]);
      }
    }
    RecordStrengths(*answer);
  }
  return look;
}

// Strengths are stored at their times, and where a fault has
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
  told_ = std::exchange(strength_points_, {});
}

// True if a fault of the name is no longer as strong as it is said to be.
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

void EpisodeNames::RequestGrowth() {
  if (known_.empty() || name_.verdict().second.open) {
    return;  // A strength that explains both faults is that of neither.
  }
  if (auto task = looks_->GrowthTask(known_)) {
    const auto rows = static_cast<std::int64_t>(task->window.rows.size());
    // The strength is fitted as constant over the rows.
    task->middle_ns = task->stamp_ns - (rows - 1) * PeriodNs() / 2;
    task->named_ns = look_ns_;
    due_.push_back(std::move(*task));
  }
}

void EpisodeNames::AnswerGrowth(const LookTask& task,
                                const LookAnswer& answer) {
  if (!open_ || task.detection_stamp_ns != detection_ns_ ||
      answer.outcome != LookOutcome::kNamed) {
    return;
  }
  for (const Explanation& e : answer.faults) {
    RecordStrength(e, task.middle_ns);
  }
  // The next one begins where this one ended.
  if (task.named_ns == look_ns_) {
    known_ = answer.faults;
  }
}

// An early look gives a name by a few seconds of data, too little for a point.
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
    look.rival = RivalOf(answer);
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
void EpisodeNames::Reset() {
  if (simulation_) {
    looks_.emplace(*simulation_, models_.get());
  }
  open_ = false;
  due_.clear();
  strengths_ = {};
  ForgetEpisode();
}

// Looks that are due stay: ValveLooks ignores answers to an episode that has
// ended, and routine looks go on.
void EpisodeNames::ForgetEpisode() {
  look_ns_ = 0;
  look_.reset();
  known_.clear();
  strength_points_.clear();
  told_.clear();
}

}  // namespace fdi
