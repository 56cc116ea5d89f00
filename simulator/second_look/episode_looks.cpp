#include "simulator/second_look/episode_looks.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <span>
#include <utility>

#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "simulator/fault_effects.h"

namespace fdi::simulator {
namespace {

constexpr std::size_t kBefore = 120;   // rows before the detection
constexpr std::size_t kMaxRows = 420;  // rows in all
constexpr std::ptrdiff_t kMinMeasuredRows = 20;
constexpr std::int64_t kEarlyAge = 20 * kNsPerSecond;
constexpr std::int64_t kFirstAge = 40 * kNsPerSecond;
constexpr std::int64_t kLastAge = 300 * kNsPerSecond;  // Then twice each.
constexpr std::int64_t kRoutineNs = 300 * kNsPerSecond;
constexpr std::ptrdiff_t kRoutineMeasured = 300;  // of its rows
// None of the hypotheses follows the record: errors of so many healthy ones.
constexpr double kMaxMisfit = 12.0;
// Nor does no fault, where no fault gains on it.
constexpr double kMaxHealthyMisfit = 4.0;
// Faults that act alike differ by less than this share of what none is behind.
constexpr double kAlike = 0.06;
// Healthy windows have about 1.
constexpr double kGoodMisfit = 2.0;

// Of a sample a second.
std::int64_t AgeAfter(std::int64_t age_ns) {
  return age_ns < kFirstAge            ? kFirstAge
         : age_ns < 150 * kNsPerSecond ? 150 * kNsPerSecond
         : age_ns < kLastAge           ? kLastAge
                                       : 2 * age_ns;
}

// Rows in which the valve's answer was measured: X, or F of a valve without a
// position transmitter.
std::ptrdiff_t MeasuredRows(const LookWindow& window) {
  const bool has_x = (window.signals & MaskOf(Signal::kX)) != 0;
  return std::ranges::count_if(
      window.rows, has_x ? &RecordRow::x_measured : &RecordRow::flow_measured);
}

std::int64_t PeriodOf(const ValvePhysics& physics) {
  return std::llround(physics.drive.period_s * kNsPerSecond);
}

bool Has(const std::vector<Explanation>& faults, int fault) {
  return std::any_of(faults.begin(), faults.end(),
                     [&](const auto& e) { return e.fault == fault; });
}

// Whether `e` is to stand beside a fault of the set that it looks like.
bool IsAlike(Alike alike, const SecondLook& look, const Explanation& e,
             double nothing) {
  switch (alike) {
    case Alike::kWithinItsSize:
      return std::abs(e.strength) < 1.0 && e.distance <= nothing;
    case Alike::kWhileWeak:
      return e.distance <= kAlike * nothing;
    case Alike::kUnfit:
      // Where the best leaves no more than a healthy valve does, it needs no
      // such excuse, unless the force on the rod is not known.
      return (look.misfit > kGoodMisfit || !look.complete) &&
             e.distance <= kAlike * nothing;
    case Alike::kUntaught:  // A simulation knows all faults.
      break;
  }
  return false;
}

// Whether the best fault would have to be larger than there is, and leaves more
// than a healthy valve does: the window shows something else. A stop and a lack
// of force are complete at that strength.
bool IsExhausted(const SecondLook& look) {
  constexpr double kLargest = 0.99;
  const Explanation& best = look.ranked.front();
  return !look.complete && look.misfit > kGoodMisfit && IsFault(best.fault) &&
         std::abs(best.strength) > kLargest &&
         FaultFactsOf(best.fault).onset == Onset::kGradual;
}

void AddIndistinguishable(const SecondLook& look, double nothing,
                          std::vector<Explanation>& set) {
  if (look.perforation && look.perforation->distance <= kLookMargin &&
      !Has(set, look.perforation->fault)) {
    set.push_back(*look.perforation);
  }
  for (const Alike alike :
       {Alike::kWithinItsSize, Alike::kWhileWeak, Alike::kUnfit}) {
    for (const Explanation& e : look.ranked) {
      if (e.fault == 0 || Has(set, e.fault)) {
        continue;
      }
      const auto& others = FaultFactsOf(e.fault).look_alikes;
      if (IsAlike(alike, look, e, nothing) &&
          std::ranges::any_of(others, [&](const LookAlike& other) {
            return other.fault != 0 && other.when == alike &&
                   Has(set, other.fault);
          })) {
        set.push_back(e);
      }
    }
  }
}

std::optional<LookAnswer> TakeGrowthLook(const ValvePhysics& physics,
                                         const LookTask& task,
                                         const std::stop_token& stop) {
  StrengthLook look = EstimateStrengths(physics, task.window, task.known, stop);
  if (look.faults.empty()) {
    return std::nullopt;
  }
  LookAnswer answer;
  answer.outcome =
      look.misfit > kMaxMisfit ? LookOutcome::kNoneFits : LookOutcome::kNamed;
  answer.misfit = look.misfit;
  answer.faults = std::move(look.faults);
  return answer;
}

}  // namespace

std::int64_t SlownessOf(double period_s) {
  return std::max<std::int64_t>(1, std::llround(period_s));
}

LookAnswer AnswerOf(const SecondLook& look, bool early) {
  LookAnswer answer;
  answer.early = early;
  answer.misfit = look.misfit;
  answer.simulated = look.best;
  double nothing = std::numeric_limits<double>::infinity();
  for (const Explanation& e : look.ranked) {
    if (e.fault == 0) {
      nothing = e.distance;
    }
  }
  const double margin =
      early ? std::max(kLookMargin, kEarlyLookShare * nothing) : kLookMargin;
  for (const Explanation& e : look.ranked) {
    if (e.fault != 0 && e.distance <= margin && !Has(answer.faults, e.fault)) {
      answer.faults.push_back(e);
    }
  }
  AddIndistinguishable(look, nothing, answer.faults);
  for (const Explanation& e : look.ranked) {
    if (!look.complete && e.fault != 0 && e.distance <= kAlike * nothing &&
        !Has(answer.faults, e.fault) && !Has(answer.beside, e.fault)) {
      answer.beside.push_back(e);
    }
  }
  const bool healthy =
      nothing <= std::max(kLookMargin, kMinGain * look.readings);
  const double most = healthy ? kMaxHealthyMisfit : kMaxMisfit;
  // The misfit comes first: where even the best explanation does not follow the
  // record, neither health nor a fault can be concluded from it.
  answer.outcome =
      look.misfit > most || IsExhausted(look)  ? LookOutcome::kNoneFits
      : healthy                                ? LookOutcome::kNothing
      : answer.faults.size() > kMaxNamedFaults ? LookOutcome::kUnclear
                                               : LookOutcome::kNamed;
  return answer;
}

void BindGroups(const FaultGroups& groups, LookAnswer& answer) {
  const std::vector<Explanation> looked = answer.faults;
  for (const Explanation& e : answer.beside) {
    const bool bound =
        std::ranges::any_of(groups, [&](const std::vector<int>& group) {
          const auto is_in = [&](const Explanation& other) {
            return std::ranges::count(group, other.fault) > 0;
          };
          return is_in(e) && std::ranges::any_of(looked, is_in);
        });
    if (bound) {
      answer.faults.push_back(e);
    }
  }
  if (answer.outcome == LookOutcome::kNamed &&
      answer.faults.size() > kMaxNamedFaults) {
    answer.outcome = LookOutcome::kUnclear;
  }
}

void KeepMeterAndLine(const SecondLook& look, LookAnswer& answer) {
  const auto none = std::ranges::find(look.ranked, 0, &Explanation::fault);
  const auto is_left = [&](const Explanation& e) {
    const ActsOn acts_on = FaultFactsOf(e.fault).acts_on;
    return (acts_on == ActsOn::kFlowReading || acts_on == ActsOn::kInputs) &&
           (none == look.ranked.end() || e.distance < none->distance);
  };
  const auto count =
      static_cast<std::size_t>(std::ranges::count_if(answer.faults, is_left));
  if ((answer.outcome == LookOutcome::kUnclear ||
       answer.outcome == LookOutcome::kNothing) &&
      count > 0 && count <= kMaxNamedFaults) {
    std::erase_if(answer.faults, std::not_fn(is_left));
    answer.beside.clear();
    answer.outcome = LookOutcome::kNamed;
  }
}

std::optional<LookAnswer> TakeLook(const ValvePhysics& physics,
                                   const LookTask& task,
                                   const std::stop_token& stop) {
  if (task.occasion == LookOccasion::kGrowth) {
    return TakeGrowthLook(physics, task, stop);
  }
  // Routine looks come for every valve every five minutes. Where the valve is
  // healthy, one simulation without a fault has to be enough.
  double without_fault = 0.0;
  if (task.occasion != LookOccasion::kEpisode &&
      task.occasion != LookOccasion::kSecond) {
    without_fault = MisfitWithoutFault(physics, task.window);
    if (task.occasion == LookOccasion::kStill ||
        without_fault <= kHealthyMisfit) {
      LookAnswer answer;
      answer.outcome = LookOutcome::kNothing;
      answer.misfit = answer.without_fault = without_fault;
      return answer;
    }
  }
  const SecondLook look = RunSecondLook(physics, task.window, stop);
  if (look.ranked.empty()) {
    return std::nullopt;
  }
  LookAnswer answer = AnswerOf(look, task.early());
  answer.late = task.late();
  if (task.changed_unread) {
    KeepMeterAndLine(look, answer);
  }
  answer.without_fault = without_fault;
  if (task.occasion == LookOccasion::kRoutine &&
      answer.misfit + kRoutineGain > without_fault) {
    answer.outcome = LookOutcome::kNothing;
  }
  return answer;
}

bool LookTask::early() const {
  return occasion == LookOccasion::kEpisode && age_ns() < slowness * kFirstAge;
}

bool LookTask::late() const {
  return occasion == LookOccasion::kEpisode && age_ns() > slowness * kLastAge;
}

bool ObserversName(const ModelSet& models, FaultSet isolated) {
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    if (((isolated >> i) & 1U) != 0 && IsFault(models.faults[i])) {
      return true;
    }
  }
  return false;
}

std::optional<std::vector<int>> NamesOf(const LookAnswer& answer,
                                        bool observers_name) {
  const bool perhaps = answer.outcome == LookOutcome::kNothing && answer.late &&
                       !answer.faults.empty() &&
                       answer.faults.size() <= kMaxNamedFaults;
  if ((answer.outcome == LookOutcome::kNothing && !perhaps) ||
      (answer.early && observers_name)) {
    return std::nullopt;
  }
  std::vector<int> names;
  if (answer.outcome == LookOutcome::kNamed || perhaps) {
    for (const Explanation& e : answer.faults) {
      names.push_back(e.fault);
    }
    std::sort(names.begin(), names.end());
  }
  return names;
}

EpisodeLooks::EpisodeLooks(const ValvePhysics& physics, bool at_position)
    : physics_(physics),
      period_ns_(PeriodOf(physics)),
      slowness_(SlownessOf(physics.drive.period_s)),
      at_position_(at_position) {}

// One row a period; up to three missing ones are held, a longer gap begins
// anew. So does another set of signals, because a window has one for all rows.
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
  const auto value = [&](Signal signal, double usual, double least,
                         double most) {
    return sample.Has(signal) ? std::clamp(sample[signal], least, most) : usual;
  };
  constexpr double kMaxPressureKpa = 2e4;
  const bool is_water = physics_.parameters.medium.fluid == Fluid::kWater;
  const SignalMask uncertain = sample.uncertain();
  // A command is needed as much as a position, to compare that with. Without a
  // position, the flow is compared with it.
  const bool has_x = sample.Has(Signal::kX);
  const bool follows = sample.Has(Signal::kCv) && has_x;
  const bool flows =
      has_x || (sample.Has(Signal::kCv) && sample.Has(Signal::kF));
  const RecordRow row{
      {sample[Signal::kCv],
       value(Signal::kP1, physics_.p1.mean, 0.0, kMaxPressureKpa),
       value(Signal::kP2, physics_.p2.mean, 0.0, kMaxPressureKpa),
       value(Signal::kT1, physics_.t1.mean, is_water ? 0.0 : kColdestMediumC,
             is_water ? kMaxTemperatureC : kHottestMediumC)},
      sample[Signal::kX],
      sample.Has(Signal::kF) ? sample[Signal::kF] : 0.0,
      follows && (uncertain & MaskOf(Signal::kX)) == 0,
      flows && (uncertain & MaskOf(Signal::kF)) == 0};
  for (std::int64_t held = 1; !rows_.empty() && held < step; ++held) {
    rows_.push_back({rows_.back().stamp_ns + period_ns_, rows_.back().row});
    rows_.back().row.x_measured = rows_.back().row.flow_measured = false;
  }
  rows_.push_back({sample.stamp_ns, row});
  while (rows_.size() > kMaxRows) {
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
      healthy += FlowReading(physics_.parameters, {}, row.input,
                             has_x ? row.x_pct : row.input.cv_pct);
    }
  }
  return flow / std::max(healthy, 1e-3 * physics_.flow_mean);
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
  // A routine look finds what has been there for minutes.
  const bool by_routine = by_routine_ && detection_ns == detection_ns_;
  const std::int64_t from_ns =
      by_routine ? rows_.front().stamp_ns
                 : begin_ns - static_cast<std::int64_t>(kBefore) * period_ns_;
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
  const double change = std::max(
      kLeastChange, kUsual * physics_.flow.slow_sd / physics_.flow_mean);
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

// Only as long as the window begins with the standing fault alone: from there
// it is known what is usual with it.
std::optional<LookTask> EpisodeLooks::SecondTask(const Verdict& verdict) {
  constexpr std::size_t kLeastBefore = 60;
  const SecondFault& second = verdict.second;
  if (!second.open || second.standing_strength == 0.0 || at_position_) {
    return std::nullopt;
  }
  if (std::exchange(second_ns_, second.detection_stamp_ns) !=
      second.detection_stamp_ns) {
    second_age_ns_ = kFirstAge;
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
  // Of any sample: the first one of a new source ends the episode even if it is
  // rejected.
  for (const Transition& transition : verdict.Transitions()) {
    if (transition.kind == TransitionKind::kDetected) {
      detection_ns_ = transition.detection_stamp_ns;
      set_back_ns_ = 0;
      by_routine_ = suspected;
      // A suspected valve has a name already, that of the routine look.
      next_age_ns_ = suspected ? kLastAge : kEarlyAge;
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
    const std::int64_t soon = age_ns / slowness_ + kFirstAge;
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
  // If there are not more rows than were judged before, AddRow() has begun
  // anew, and so does the count: all rows of a routine look have been judged.
  rows_.back().covered = verdict.quality == Quality::kLive;
  const bool judged = (verdict.quality == Quality::kLive ||
                       verdict.quality == Quality::kUncovered) &&
                      (!detection_ns_ || suspected) &&
                      rows_.size() > std::min(judged_, kMaxRows - 1);
  judged_ = judged ? judged_ + 1 : 0;
  const std::int64_t slot = sample.stamp_ns / (slowness_ * kRoutineNs);
  // The exchange comes first in the condition, because slot_ has to follow
  // every sample; otherwise a look would be due late in its slot.
  if (std::exchange(slot_, slot) != slot && judged_ >= kMaxRows && !due) {
    due = RoutineTask(suspected);
  }
  return due;
}

void LookBook::Enter(const LookTask& task, LookAnswer answer) {
  // Only one episode is open at a time: what is not of this one is over.
  const auto others = std::erase_if(entries_, [&](const Entry& entry) {
    return entry.detection_stamp_ns != task.detection_stamp_ns;
  });
  if (others > 0) {
    doubt_.clear();
  }
  constexpr double kMuchWorse = 2.0;
  for (const Entry& entry : entries_) {
    const bool named = entry.answer.outcome == LookOutcome::kNamed;
    if (!entry.answer.early &&
        (answer.misfit > kMuchWorse * std::max(1.0, entry.answer.misfit) ||
         (named && answer.outcome == LookOutcome::kNothing))) {
      return;
    }
  }
  // Comes last, because it changes the doubt: a look that was refused above
  // leaves the doubt of the one before it.
  if (task.age_ns() > task.slowness * kLastAge && !AcceptsLate(answer)) {
    return;
  }
  answer.stamp_ns = task.stamp_ns;
  entries_.push_back({task.detection_stamp_ns, task.stamp_ns + kLookDelayNs,
                      std::move(answer)});
}

bool LookBook::AcceptsLate(const LookAnswer& answer) {
  // Taken in any case: a look that gets here ends the doubt of the one before
  // it.
  const auto doubt = std::exchange(doubt_, {});
  const auto named =
      std::find_if(entries_.rbegin(), entries_.rend(), [](const Entry& entry) {
        return entry.answer.outcome == LookOutcome::kNamed &&
               !entry.answer.early;
      });
  if (named == entries_.rend() || answer.outcome == LookOutcome::kNoneFits) {
    return true;
  }
  const auto within = [](const std::vector<Explanation>& some,
                         const std::vector<Explanation>& others) {
    return std::ranges::all_of(
        some, [&](const Explanation& e) { return Has(others, e.fault); });
  };
  const std::vector<Explanation>& name = named->answer.faults;
  if (within(answer.faults, name)) {
    return true;
  }
  if (answer.outcome != LookOutcome::kNamed || within(name, answer.faults)) {
    return false;
  }
  const bool again = std::ranges::any_of(doubt, [&](const Explanation& e) {
    return Has(answer.faults, e.fault) && !Has(name, e.fault);
  });
  if (!again) {
    doubt_ = answer.faults;
  }
  return again;
}

void Suspicion::Enter(std::int64_t stamp_ns, LookAnswer answer) {
  answer.stamp_ns = stamp_ns;
  waiting_.emplace_back(stamp_ns + kRoutineDelayNs, std::move(answer));
}

void Suspicion::Advance(std::int64_t stamp_ns) {
  // Where time has stepped back, they would hold up all others until it is
  // their time again.
  std::erase_if(waiting_, [stamp_ns](const auto& waiting) {
    return waiting.second.stamp_ns > stamp_ns;
  });
  while (!waiting_.empty() && waiting_.front().first <= stamp_ns) {
    LookAnswer answer = std::move(waiting_.front().second);
    waiting_.pop_front();
    Take(std::move(answer));
  }
}

void Suspicion::Dismiss() {
  last_.reset();
  found_.reset();
}

void Suspicion::Take(LookAnswer answer) {
  // A look that merely names no fault does not end a suspicion. It takes a
  // window that the valve follows without a fault.
  if (found_) {
    if (answer.without_fault <= kHealthyMisfit) {
      Dismiss();
    }
    return;
  }
  const bool named = answer.outcome == LookOutcome::kNamed;
  const bool again =
      named && last_ && std::ranges::any_of(answer.faults, [&](const auto& e) {
        return Has(last_->faults, e.fault);
      });
  if (again) {
    found_ = std::move(answer);
  } else if (named) {
    last_ = std::move(answer);
  } else {
    last_.reset();
  }
}

void ObserversMemory::Step(std::int64_t detection_stamp_ns,
                           std::int64_t stamp_ns, FaultSet faults) {
  if (std::exchange(detection_stamp_ns_, detection_stamp_ns) !=
      detection_stamp_ns) {
    seen_ = 0;
    set_back_ns_ = 0;
    last_stamp_ns_ = stamp_ns;
  }
  // A clock that is set back would make the episode younger, and the stamps of
  // before newer than all that follow. So the time since the detection goes on.
  set_back_ns_ += std::max<std::int64_t>(0, last_stamp_ns_ - stamp_ns);
  last_stamp_ns_ = stamp_ns;
  stamp_ns += set_back_ns_;
  seen_ |= faults;
  faults_ = faults;
  // last_ns_ still holds stamps of earlier episodes. It is read only for bits
  // of seen_, which were written in this one.
  const std::int64_t age_ns = stamp_ns - detection_stamp_ns;
  for (FaultSet left = seen_; left != 0; left &= left - 1) {
    const auto bit = static_cast<std::size_t>(std::countr_zero(left));
    const FaultSet fault = FaultSet{1} << bit;
    if ((faults & fault) != 0) {
      last_ns_[bit] = stamp_ns;
    } else if (age_ns > 2 * kLastAge &&
               last_ns_[bit] >= stamp_ns - age_ns / 2) {
      faults_ |= fault;
    }
  }
}

ValveLooks::ValveLooks(const ValvePhysics& physics, const ModelSet* models)
    : looks_(physics, models != nullptr && models->position_as_command),
      models_(models),
      trained_(models != nullptr ? TrainedSignals(*models) : TrainedSignals()),
      period_ns_(PeriodOf(physics)) {}

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
  if (open_) {
    memory_.Step(detection_ns_, stamp_ns_, verdict.isolated);
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

FaultSet ValveLooks::Observed(const ModelSet& models, FaultSet isolated) const {
  const FaultSet known = ~FindingsOf(models);
  const FaultSet faults = memory_.faults() & known;
  if (!open_ || faults == (isolated & known)) {
    return isolated;
  }
  return std::popcount(faults) > static_cast<int>(kMaxNamedFaults) ? 0 : faults;
}

// The entries are in the order in which the looks were answered, and the last
// one whose delay is over counts. So does one that comes from a later time:
// then time has stepped back.
const LookAnswer* LookBook::At(std::int64_t detection_stamp_ns,
                               std::int64_t stamp_ns) const {
  const LookAnswer* answer = nullptr;
  for (const Entry& entry : entries_) {
    if (entry.detection_stamp_ns == detection_stamp_ns &&
        (entry.from_ns <= stamp_ns || entry.answer.stamp_ns > stamp_ns)) {
      answer = &entry.answer;
    }
  }
  return answer;
}

}  // namespace fdi::simulator
