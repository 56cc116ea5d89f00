#include "diagnosis/decision/episode_looks.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "base/time_units.h"

namespace fdi {
namespace {

constexpr std::size_t kRowsBefore = 120;   // the detection
constexpr std::size_t kMaxLookRows = 420;  // in all
constexpr std::ptrdiff_t kMinMeasuredRows = 20;
constexpr std::int64_t kRoutineNs = 300 * kNsPerSecond;
constexpr std::ptrdiff_t kRoutineMeasured = 300;  // of its rows

// For a sample a second.
std::int64_t AgeAfter(std::int64_t age_ns) {
  return age_ns < kFirstLookAge    ? kFirstLookAge
         : age_ns < kMiddleLookAge ? kMiddleLookAge
         : age_ns < kLastLookAge   ? kLastLookAge
                                   : 2 * age_ns;
}

// Rows in which the valve's answer was measured: X, or F of a valve without a
// position transmitter.
std::ptrdiff_t MeasuredRows(const LookWindow& window) {
  const bool has_x = (window.signals & MaskOf(Signal::kX)) != 0;
  return std::ranges::count_if(
      window.rows, has_x ? &RecordRow::x_measured : &RecordRow::flow_measured);
}

}  // namespace

std::int64_t LookPeriodNs(const LookSimulation& simulation) {
  return std::llround(simulation.usual().period_s * kNsPerSecond);
}

EpisodeLooks::EpisodeLooks(const LookSimulation& simulation, bool at_position)
    : simulation_(simulation),
      period_ns_(LookPeriodNs(simulation)),
      slowness_(SlownessOf(simulation.usual().period_s)),
      at_position_(at_position) {}

// One row per period. Up to three missing ones are held. The rows start over
// after a longer gap or with other signals, as all rows of a window share them.
void EpisodeLooks::AddRow(const Sample& sample) {
  constexpr std::int64_t kMaxHeldSteps = 3;
  const std::int64_t step =
      rows_.empty()
          ? 1
          : (sample.stamp_ns - rows_.back().stamp_ns + period_ns_ / 2) /
                period_ns_;
  if (step < 1 || step > 1 + kMaxHeldSteps || sample.present != signals_) {
    BeginRows(sample.stamp_ns);
  }
  signals_ = sample.present;
  // The simulation needs all inputs. One that is not measured is taken as
  // usual; it has no share in the cost of a fault. A transmitter that fails may
  // read less than the simulation takes, or more.
  const UsualValve& usual = simulation_.usual();
  const auto value = [&](Signal signal, double instead, double least,
                         double most) {
    return sample.Has(signal) ? std::clamp(sample[signal], least, most)
                              : instead;
  };
  constexpr double kMaxPressureKpa = 2e4;
  const SignalMask uncertain = sample.uncertain();
  // A command is needed as much as a position, to compare that with. Without a
  // position, the flow is compared with it.
  const bool has_x = sample.Has(Signal::kX);
  const bool follows = sample.Has(Signal::kCv) && has_x;
  const bool flows =
      has_x || (sample.Has(Signal::kCv) && sample.Has(Signal::kF));
  const RecordRow row{{sample[Signal::kCv],
                       value(Signal::kP1, usual.p1_kpa, 0.0, kMaxPressureKpa),
                       value(Signal::kP2, usual.p2_kpa, 0.0, kMaxPressureKpa),
                       value(Signal::kT1, usual.t1_degc, usual.coldest_degc,
                             usual.hottest_degc)},
                      sample[Signal::kX],
                      sample.Has(Signal::kF) ? sample[Signal::kF] : 0.0,
                      follows && (uncertain & MaskOf(Signal::kX)) == 0,
                      flows && (uncertain & MaskOf(Signal::kF)) == 0};
  for (std::int64_t held = 1; !rows_.empty() && held < step; ++held) {
    rows_.push_back({rows_.back().stamp_ns + period_ns_, rows_.back().row});
    rows_.back().row.x_measured = rows_.back().row.flow_measured = false;
  }
  rows_.push_back({sample.stamp_ns, row});
  while (rows_.size() > kMaxLookRows) {
    rows_.pop_front();
  }
}

// F over what the healthy valve would pass, a mean of the first or last rows.
double EpisodeLooks::FlowShare(bool last) const {
  constexpr std::size_t kRows = 20;
  const std::size_t count = std::min(rows_.size(), kRows);
  const bool has_x = (signals_ & MaskOf(Signal::kX)) != 0;
  double flow = 0.0;
  double healthy = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    const RecordRow& row = rows_[last ? rows_.size() - 1 - k : k].row;
    if (row.flow_measured) {
      flow += row.flow;
      healthy += simulation_.HealthyFlow(row.input,
                                         has_x ? row.x_pct : row.input.cv_pct);
    }
  }
  return flow / std::max(healthy, 1e-3 * simulation_.usual().flow);
}

void EpisodeLooks::BeginRows(std::int64_t stamp_ns) {
  constexpr std::int64_t kOutageNs = 300 * kNsPerSecond;
  constexpr std::size_t kFewRows = 10;
  if (rows_.size() >= kFewRows && (signals_ & MaskOf(Signal::kF)) != 0) {
    share_before_ = FlowShare(true);
    before_ns_ = rows_.back().stamp_ns;
  }
  outage_end_ns_ = stamp_ns - before_ns_ >= kOutageNs ? stamp_ns : 0;
  rows_.clear();
}

std::optional<LookTask> EpisodeLooks::Task(std::int64_t detection_ns) const {
  LookTask task;
  task.detection_stamp_ns = detection_ns;
  task.set_back_ns = set_back_ns_;
  task.window.signals = signals_;
  task.window.at_position = at_position_;
  task.slowness = slowness_;
  const std::int64_t begin_ns = detection_ns - set_back_ns_;
  // A routine look finds a fault that has been there for minutes.
  const bool by_routine = by_routine_ && detection_ns == detection_ns_;
  const std::int64_t from_ns =
      by_routine
          ? rows_.front().stamp_ns
          : begin_ns - static_cast<std::int64_t>(kRowsBefore) * period_ns_;
  for (const Row& row : rows_) {
    if (row.stamp_ns < from_ns) {
      continue;
    }
    if (row.stamp_ns < begin_ns && !by_routine) {
      task.window.detection = task.window.rows.size() + 1;
    }
    task.window.rows.push_back(row.row);
    task.stamp_ns = row.stamp_ns;
  }
  if (MeasuredRows(task.window) < kMinMeasuredRows ||
      task.window.detection + 10 > task.window.rows.size()) {
    return std::nullopt;
  }
  constexpr double kLeastChange = 0.1;
  constexpr double kUsual = 3.0;  // deviations of the slow part
  const double change =
      std::max(kLeastChange, kUsual * simulation_.usual().slow_flow_sd /
                                 simulation_.usual().flow);
  task.changed_unread = share_before_ && outage_end_ns_ != 0 &&
                        rows_.front().stamp_ns == outage_end_ns_ &&
                        std::abs(FlowShare(false) - *share_before_) > change;
  if (task.changed_unread) {
    // A transmitter that comes back does not read right at once.
    constexpr std::size_t kComesBack = 5;
    for (RecordRow& row : std::span(task.window.rows).first(kComesBack)) {
      row.x_measured = row.flow_measured = false;
    }
  }
  return task;
}

std::optional<LookTask> EpisodeLooks::RoutineTask(bool suspected) const {
  LookTask task;
  task.occasion = suspected ? LookOccasion::kStill : LookOccasion::kRoutine;
  task.stamp_ns = rows_.back().stamp_ns;
  task.window.signals = signals_;
  task.window.at_position = at_position_;
  task.slowness = slowness_;
  for (const Row& row : rows_) {
    RecordRow& compared = task.window.rows.emplace_back(row.row);
    compared.x_measured = compared.x_measured && row.covered;
    compared.flow_measured = compared.flow_measured && row.covered;
  }
  if (MeasuredRows(task.window) < kRoutineMeasured) {
    return std::nullopt;
  }
  return task;
}

std::optional<LookTask> EpisodeLooks::GrowthTask(
    std::vector<Explanation> known) const {
  std::optional<LookTask> task;
  if (detection_ns_ && !rows_.empty()) {
    task = Task(*detection_ns_);
  }
  if (task) {
    task->occasion = LookOccasion::kGrowth;
    task->known = std::move(known);
  }
  return task;
}

// Only while the window begins with rows of the standing fault alone: they show
// what is usual with it.
std::optional<LookTask> EpisodeLooks::SecondTask(const Verdict& verdict) {
  constexpr std::size_t kLeastBefore = 60;
  const SecondFault& second = verdict.second;
  if (!second.open || second.standing_strength == 0.0 || at_position_) {
    return std::nullopt;
  }
  if (std::exchange(second_ns_, second.detection_stamp_ns) !=
      second.detection_stamp_ns) {
    second_age_ns_ = kFirstLookAge;
  }
  const std::int64_t age_ns =
      rows_.back().stamp_ns + set_back_ns_ - second.detection_stamp_ns;
  if (age_ns < slowness_ * second_age_ns_) {
    return std::nullopt;
  }
  while (age_ns >= slowness_ * second_age_ns_) {
    second_age_ns_ = AgeAfter(second_age_ns_);
  }
  std::optional<LookTask> task = Task(second.detection_stamp_ns);
  if (!task || task->window.detection < kLeastBefore) {
    return std::nullopt;
  }
  task->occasion = LookOccasion::kSecond;
  task->window.standing_strength = second.standing_strength;
  return task;
}

std::optional<LookTask> EpisodeLooks::Step(const Sample& sample,
                                           const Verdict& verdict,
                                           bool suspected) {
  // Whatever the intake: the first sample of a new source ends the episode even
  // if it is rejected.
  for (const Transition& transition : verdict.Transitions()) {
    if (transition.kind == TransitionKind::kDetected) {
      detection_ns_ = transition.detection_stamp_ns;
      set_back_ns_ = 0;
      by_routine_ = suspected;
      // A suspected valve has a name already, that of the routine look.
      next_age_ns_ = suspected ? kLastLookAge : kEarlyLookAge;
    } else if (detection_ns_ && (transition.kind == TransitionKind::kCleared ||
                                 transition.kind == TransitionKind::kClosed)) {
      detection_ns_.reset();
    }
  }
  if (verdict.intake != Intake::kAccepted) {
    return std::nullopt;
  }
  // With a clock that was set back the episode would be as young, or not have
  // begun, and no look would be due.
  const bool set_back =
      !rows_.empty() && sample.stamp_ns <= rows_.back().stamp_ns;
  if (set_back) {
    set_back_ns_ += rows_.back().stamp_ns + period_ns_ - sample.stamp_ns;
  }
  const std::size_t rows = rows_.size();
  AddRow(sample);
  std::optional<LookTask> due;
  const std::int64_t age_ns =
      detection_ns_ ? sample.stamp_ns + set_back_ns_ - *detection_ns_ : 0;
  // Behind a gap the valve may be another one: a look as after a detection, and
  // behind a long one none before there are rows for it.
  if (detection_ns_ && rows > 1 && rows_.size() == 1 && !set_back) {
    const std::int64_t soon = age_ns / slowness_ + kFirstLookAge;
    next_age_ns_ =
        outage_end_ns_ == sample.stamp_ns ? soon : std::min(next_age_ns_, soon);
  }
  const auto is_due = [&] { return age_ns >= slowness_ * next_age_ns_; };
  if (detection_ns_ && is_due()) {
    // After a gap one look stands for all that it passed over. A look for which
    // too little was measured is left out, not put off.
    while (is_due()) {
      next_age_ns_ = AgeAfter(next_age_ns_);
    }
    // This look would see both faults at once.
    due = verdict.second.open ? std::nullopt : Task(*detection_ns_);
  }
  if (detection_ns_ && !due) {
    due = SecondTask(verdict);
  }
  // If there are not more rows than were judged before, AddRow() has started
  // over, and so does the count: all rows of a routine look have been judged.
  rows_.back().covered = verdict.quality == Quality::kLive;
  const bool judged = (verdict.quality == Quality::kLive ||
                       verdict.quality == Quality::kUncovered) &&
                      (!detection_ns_ || suspected) &&
                      rows_.size() > std::min(judged_, kMaxLookRows - 1);
  judged_ = judged ? judged_ + 1 : 0;
  const std::int64_t slot = sample.stamp_ns / (slowness_ * kRoutineNs);
  // The exchange comes first in the condition, because slot_ has to follow
  // every sample; otherwise a look would be due late in its slot.
  if (std::exchange(slot_, slot) != slot && judged_ >= kMaxLookRows && !due) {
    due = RoutineTask(suspected);
  }
  return due;
}

}  // namespace fdi
