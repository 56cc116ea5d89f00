#include "diagnosis/decision/look_answer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/taught.h"

namespace fdi {
namespace {

// Where no hypothesis leaves less, none follows the record: errors of so many
// healthy ones.
constexpr double kMaxMisfit = 12.0;
// The same of no fault at all, where no fault gains on it.
constexpr double kMaxHealthyMisfit = 4.0;
// Faults that act alike differ by less than this share of what none is behind.
constexpr double kAlike = 0.06;
// Healthy windows have about 1.
constexpr double kGoodMisfit = 2.0;

// True if `e` joins the set beside a fault that it looks like.
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

void AddIndistinguishable(const SecondLook& look, double nothing,
                          std::vector<Explanation>& set) {
  if (look.perforation && look.perforation->distance <= kLookMargin &&
      !Explains(set, look.perforation->fault)) {
    set.push_back(*look.perforation);
  }
  for (const Alike alike :
       {Alike::kWithinItsSize, Alike::kWhileWeak, Alike::kUnfit}) {
    for (const Explanation& e : look.ranked) {
      if (e.fault == 0 || Explains(set, e.fault)) {
        continue;
      }
      const auto& others = FaultFactsOf(e.fault).look_alikes;
      if (IsAlike(alike, look, e, nothing) &&
          std::ranges::any_of(others, [&](const LookAlike& other) {
            return other.fault != 0 && other.when == alike &&
                   Explains(set, other.fault);
          })) {
        set.push_back(e);
      }
    }
  }
}

// A seized rod is blocked both ways. Until the command has gone both ways, a
// stop says enough; a later look may then narrow the set to f4.
bool SaysMore(const LookAnswer& answer, const Explanation& e) {
  return e.fault == kStemFriction && e.strength >= 1.0 &&
         Explains(answer.faults, kTravelStop);
}

std::size_t CountNames(const LookAnswer& answer) {
  return static_cast<std::size_t>(std::ranges::count_if(
      answer.faults,
      [&](const Explanation& e) { return !SaysMore(answer, e); }));
}

std::optional<LookAnswer> TakeGrowthLook(const LookSimulation& simulation,
                                         const LookTask& task,
                                         const std::stop_token& stop) {
  StrengthLook look = simulation.Strengths(task.window, task.known, stop);
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

bool LookTask::early() const {
  return occasion == LookOccasion::kEpisode &&
         age_ns() < slowness * kFirstLookAge;
}

bool LookTask::late() const {
  return occasion == LookOccasion::kEpisode &&
         age_ns() > slowness * kLastLookAge;
}

LookAnswer AnswerOf(const SecondLook& look, bool early) {
  LookAnswer answer;
  answer.early = early;
  answer.misfit = look.misfit;
  answer.readings = look.readings;
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
    if (e.fault != 0 && e.distance <= margin &&
        !Explains(answer.faults, e.fault)) {
      answer.faults.push_back(e);
    }
  }
  AddIndistinguishable(look, nothing, answer.faults);
  for (const Explanation& e : look.ranked) {
    if (!look.complete && e.fault != 0 && e.distance <= kAlike * nothing &&
        !Explains(answer.faults, e.fault) &&
        !Explains(answer.beside, e.fault)) {
      answer.beside.push_back(e);
    }
  }
  for (const Explanation& e : look.ranked) {
    if (e.fault != 0 && !Explains(answer.faults, e.fault) &&
        !Explains(answer.others, e.fault)) {
      answer.others.push_back(e);
    }
  }
  const bool healthy =
      nothing <= std::max(kLookMargin, kMinGain * look.readings);
  const double most = healthy ? kMaxHealthyMisfit : kMaxMisfit;
  // The misfit comes first: where even the best explanation does not follow the
  // record, neither health nor a fault can be concluded from it.
  answer.outcome = look.misfit > most ? LookOutcome::kNoneFits
                   : healthy          ? LookOutcome::kNothing
                   : CountNames(answer) > kMaxNamedFaults
                       ? LookOutcome::kUnclear
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
      CountNames(answer) > kMaxNamedFaults) {
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

std::optional<LookAnswer> TakeLook(const LookSimulation& simulation,
                                   const LookTask& task,
                                   const std::stop_token& stop) {
  if (task.occasion == LookOccasion::kGrowth) {
    return TakeGrowthLook(simulation, task, stop);
  }
  // Routine looks come for every valve every five minutes. Where the valve is
  // healthy, one simulation without a fault has to be enough.
  double without_fault = 0.0;
  if (task.occasion != LookOccasion::kEpisode &&
      task.occasion != LookOccasion::kSecond) {
    without_fault = simulation.Misfit(task.window);
    if (task.occasion == LookOccasion::kStill ||
        without_fault <= kHealthyMisfit) {
      LookAnswer answer;
      answer.outcome = LookOutcome::kNothing;
      answer.misfit = answer.without_fault = without_fault;
      return answer;
    }
  }
  const SecondLook look = simulation.Look(task.window, stop);
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
                       CountNames(answer) <= kMaxNamedFaults;
  if ((answer.outcome == LookOutcome::kNothing && !perhaps) ||
      (answer.early && observers_name)) {
    return std::nullopt;
  }
  std::vector<int> names;
  if (answer.outcome == LookOutcome::kNamed || perhaps) {
    for (const Explanation& e : answer.faults) {
      if (!SaysMore(answer, e)) {
        names.push_back(e.fault);
      }
    }
    std::sort(names.begin(), names.end());
  }
  return names;
}

std::optional<std::vector<int>> NamesBeside(const Verdict& engine,
                                            const ModelSet& models,
                                            const LookAnswer& answer) {
  auto names = NamesOf(answer, ObserversName(models, engine.isolated));
  const FaultSet taught = TaughtOnly(models, engine.isolated, engine.strengths);
  if (!names || taught == 0) {
    return names;
  }
  if (names->empty()) {
    return std::nullopt;
  }
  std::vector<int> both;
  std::ranges::copy_if(*names, std::back_inserter(both), [&](int fault) {
    const int bit = FaultIndex(models, fault);
    return bit >= 0 && Has(taught, static_cast<std::size_t>(bit));
  });
  return both.empty() ? names : std::optional(both);
}

}  // namespace fdi
