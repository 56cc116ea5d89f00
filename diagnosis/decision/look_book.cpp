#include "diagnosis/decision/look_book.h"

#include <algorithm>
#include <utility>

#include "diagnosis/decision/look_answer.h"

namespace fdi {

void LookBook::Enter(const LookTask& task, LookAnswer answer) {
  // Only one episode is open at a time: entries of any other one are over.
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
  if (task.age_ns() > task.slowness * kLastLookAge && !AcceptsLate(answer)) {
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
        some, [&](const Explanation& e) { return Explains(others, e.fault); });
  };
  const std::vector<Explanation>& name = named->answer.faults;
  if (within(answer.faults, name)) {
    return true;
  }
  if (answer.outcome != LookOutcome::kNamed || within(name, answer.faults)) {
    return false;
  }
  const bool again = std::ranges::any_of(doubt, [&](const Explanation& e) {
    return Explains(answer.faults, e.fault) && !Explains(name, e.fault);
  });
  if (!again) {
    doubt_ = answer.faults;
  }
  return again;
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
        return Explains(last_->faults, e.fault);
      });
  if (again) {
    found_ = std::move(answer);
  } else if (named) {
    last_ = std::move(answer);
  } else {
    last_.reset();
  }
}

}  // namespace fdi
