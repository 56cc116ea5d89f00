#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "diagnosis/model_set.h"
#include "diagnosis/verdict.h"
#include "simulator/second_look/second_look.h"

namespace fdi::simulator {

/// A second look that is due: at what, and for which episode.
struct LookTask {
  LookWindow window;
  std::int64_t stamp_ns{0};            ///< Of the last row.
  std::int64_t detection_stamp_ns{0};  ///< Key of the episode.

  /// So little of the episode is there that the physics, which is off by some
  /// per cent, may find the wrong fault: see LookAnswer::early.
  bool early() const;
};

/// What a second look makes of the name of an episode.
enum class LookOutcome : std::uint8_t {
  kNamed,     ///< The set stands: what the data do not separate is in it.
  kUnclear,   ///< More than four faults explain the window: a shortlist.
  kNothing,   ///< So does no fault at all, or a constant shift.
  kNoneFits,  ///< No hypothesis follows the record: outside what is known.
};

struct LookAnswer {
  LookOutcome outcome{LookOutcome::kNoneFits};
  std::vector<Explanation>
      faults;  ///< One each, best first; of kNoneFits none.
  double misfit{0.0};
  /// Of an early look: its set is wider, it does not overrule the observers,
  /// and no later look is measured by it. It is there for faults that are over
  /// before the others.
  bool early{false};
  /// The valve's answer under the best explanation, a row each.
  std::vector<RecordAnswer> simulated;
  std::int64_t stamp_ns{0};  ///< Of the last row; set by LookBook.
};

/// Largest distance behind the best explanation at which a fault stays in the
/// set; see docs/method.md.
inline constexpr double kLookMargin = 15.0;
/// Of an early look at least this share of what the best gains over none: by
/// so much the physics may be off, which a short window does not average out.
inline constexpr double kEarlyLookShare = 0.1;
/// A fault that gains less over none, per independent reading, may be what a
/// healthy valve and its simulation differ by: up to 0.20 were seen without
/// one.
inline constexpr double kLeastGain = 0.25;
/// A set of more faults is a shortlist.
inline constexpr std::size_t kMostNamed = 4;

LookAnswer AnswerOf(const SecondLook& look, bool early = false);

/// The observers have isolated a fault, and not only what the floor finds.
bool ObserversName(const ModelSet& models, FaultSet isolated);

/// The faults that an answer names, ascending; empty: unknown. Nothing if what
/// the engine says stands. @param observers_name see ObserversName().
std::optional<std::vector<int>> NamesOf(const LookAnswer& answer,
                                        bool observers_name);

/// Seconds from the last sample of a look to the stamp from which its answer
/// counts, whatever the computer took.
inline constexpr std::int64_t kLookDelayNs = 10'000'000'000;

/// Follows the samples and verdicts of one valve and says when the physics
/// should look at an episode that is open: 20 (early), 40, 150 and 300 s after
/// its detection, then at ten times the age each time. Keeps the last 420
/// samples.
class EpisodeLooks {
 public:
  /// `physics` must outlive it.
  explicit EpisodeLooks(const ValvePhysics& physics);

  /// The next sample and what the engine said about it.
  std::optional<LookTask> Step(const Sample& sample, const Verdict& verdict);

 private:
  struct Row {
    std::int64_t stamp_ns;
    RecordRow row;
  };

  void Keep(const Sample& sample);
  std::optional<LookTask> Task() const;

  const ValvePhysics& physics_;
  std::int64_t period_ns_;
  SignalMask signals_{0};
  std::deque<Row> rows_{};
  std::optional<std::int64_t> detection_ns_{};
  std::int64_t next_age_ns_{0};
};

/// The answer of the layer that speaks last: that of the last look at the open
/// episode that was conclusive, else the engine's. A look that fits much worse
/// than an earlier one, or finds nothing after one that named a fault, is not
/// heard: the fault may have gone meanwhile, or show less.
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
  std::vector<Entry> entries_;
};

}  // namespace fdi::simulator
