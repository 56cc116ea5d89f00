#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "diagnosis/decision/look.h"

namespace fdi {

/// Seconds from the last sample of a look to the stamp from which its answer
/// counts, whatever the computer took.
inline constexpr std::int64_t kLookDelayNs = 10'000'000'000;

/// The answer of a routine look counts later: there may be one for every valve
/// at once.
inline constexpr std::int64_t kRoutineDelayNs = 60'000'000'000;

/// The answer of the layer that speaks last: that of the last look at the open
/// episode that was conclusive, else the engine's. A look that fits much worse
/// than an earlier one, or finds nothing after one that named a fault, is not
/// heard: the fault may have gone meanwhile, or show less.
///
/// More than five minutes after the detection a name stands until there is a
/// better one. A look is heard that names some of its faults. One that names
/// all of them and others separates less than those before it. One that leaves
/// some out and names others is heard if it is the second in a row that finds
/// the same other fault.
class LookBook {
 public:
  void Enter(const LookTask& task, LookAnswer answer);

  /// The answer that counts for an episode at `stamp_ns`, if any.
  const LookAnswer* At(std::int64_t detection_stamp_ns,
                       std::int64_t stamp_ns) const;

 private:
  struct Entry {
    std::int64_t detection_stamp_ns;
    std::int64_t from_ns;
    LookAnswer answer;
  };
  // True if a look that comes so late still counts.
  bool AcceptsLate(const LookAnswer& answer);

  std::vector<Entry> entries_;
  std::vector<Explanation> doubt_;  // The other name that the last look gave.
};

/// Collects what routine looks find. Two in a row that name the same fault make
/// the valve suspect, until one finds that it follows its physics without a
/// fault.
class Suspicion {
 public:
  void Enter(std::int64_t stamp_ns, LookAnswer answer);
  /// The answers up to now count.
  void Advance(std::int64_t stamp_ns);
  void Dismiss();

  /// Answer of the look that made the valve suspect; null: it is not.
  const LookAnswer* found() const { return found_ ? &*found_ : nullptr; }

 private:
  void Take(LookAnswer answer);

  std::deque<std::pair<std::int64_t, LookAnswer>> waiting_;  // By stamp.
  std::optional<LookAnswer> last_;  // The last look, if it named a fault.
  std::optional<LookAnswer> found_;
};

}  // namespace fdi
