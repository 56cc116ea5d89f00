#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/trained_signals.h"
#include "diagnosis/model/verdict.h"
#include "simulator/second_look/second_look.h"

namespace fdi::simulator {

/// Why a look is due.
enum class LookOccasion : std::uint8_t {
  kEpisode,  ///< To name an open episode.
  kRoutine,  ///< There is no episode: should there be one?
  kStill,    ///< A routine look opened it: is the valve abnormal still?
  kGrowth,   ///< There is a name: how strong are its faults by now?
  kSecond,   ///< To name what comes on top of the fault of an open episode.
};

/// A look that is due: at what, and for which episode.
struct LookTask {
  LookWindow window;
  std::int64_t stamp_ns{0};            ///< Of the last row.
  std::int64_t detection_stamp_ns{0};  ///< Key of the episode, or of what
                                       ///< comes on top (kSecond).
  LookOccasion occasion{LookOccasion::kEpisode};
  std::vector<Explanation> known{};  ///< Of kGrowth: EstimateStrengths().
  std::int64_t slowness{1};          ///< See SlownessOf().
  /// The flow has changed while nothing was read, just before the window.
  bool changed_unread{false};
  /// By how much the stamps of the valve were set back since the detection.
  std::int64_t set_back_ns{0};

  /// Of the episode, at the last row.
  std::int64_t age_ns() const {
    return stamp_ns + set_back_ns - detection_stamp_ns;
  }
  /// So little of the episode is there that the physics, which is off by some
  /// per cent, may find the wrong fault: see LookAnswer::early.
  bool early() const;
  /// The valve as it is by now, without the first minutes of the episode: see
  /// LookAnswer::late.
  bool late() const;
};

/// The ages and intervals of looks are for a sample a second. Slower data give
/// as few rows in them as would tell nothing, so all of them grow with the
/// period: this is the factor, at least 1.
std::int64_t SlownessOf(double period_s);

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
  /// Those beyond the margin by no more than the errors of a simulation that
  /// lacks X or a pressure; none where it has them.
  std::vector<Explanation> beside{};
  double misfit{0.0};
  /// Of an early look: its set is wider, it does not overrule the observers,
  /// and no later look is measured by it. It is there for faults that are over
  /// before the others.
  bool early{false};
  /// Of a late look. The alarm has lasted, so the faults that explain its
  /// window name the episode even where a constant shift would explain it, too.
  bool late{false};
  /// The valve's answer under the best explanation, a row each.
  std::vector<RecordAnswer> simulated;
  std::int64_t stamp_ns{0};  ///< Of the last row.
  /// Misfit without any fault, of a routine look alone.
  double without_fault{0.0};
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
inline constexpr double kMinGain = 0.25;
/// A set of more faults is a shortlist.
inline constexpr std::size_t kMaxNamedFaults = 4;

/// A window that the valve without a fault follows with a larger misfit is not
/// that of a healthy valve, for which it is about 1.
inline constexpr double kHealthyMisfit = 1.5;
/// A routine look names a fault only where that takes so much off the misfit:
/// as much as a healthy valve has.
inline constexpr double kRoutineGain = 1.0;

LookAnswer AnswerOf(const SecondLook& look, bool early = false);

/// Takes the look that is due. Nothing if it was asked to stop. One for growth
/// answers with the faults that it knows, and names nothing.
/// @throws CvodeError.
std::optional<LookAnswer> TakeLook(const ValvePhysics& physics,
                                   const LookTask& task,
                                   const std::stop_token& stop = {});

/// The observers have isolated a fault, and not only what the floor finds.
bool ObserversName(const ModelSet& models, FaultSet isolated);

/// Faults that look the same to the observers of a set: ModelSet::groups.
using FaultGroups = std::vector<std::vector<int>>;

/// Adds to the faults of the answer those beside them that are of their groups:
/// what is known to look alike binds a look that is not sure to know better.
void BindGroups(const FaultGroups& groups, LookAnswer& answer);

/// Where the flow has changed while nothing was read, and the look names
/// nothing: the faults of a meter or the line that explain it better than none
/// does, if they are a name. Trim and rod wear while they work; transmitters
/// are set, and lines switched, during outages.
void KeepMeterAndLine(const SecondLook& look, LookAnswer& answer);

/// The faults that an answer names, ascending; empty: unknown. Nothing if what
/// the engine says stands. @param observers_name see ObserversName().
std::optional<std::vector<int>> NamesOf(const LookAnswer& answer,
                                        bool observers_name);

/// Seconds from the last sample of a look to the stamp from which its answer
/// counts, whatever the computer took.
inline constexpr std::int64_t kLookDelayNs = 10'000'000'000;

/// The answer of a routine look counts later: there may be one for every valve
/// at once.
inline constexpr std::int64_t kRoutineDelayNs = 60'000'000'000;

/// Follows the samples and verdicts of one valve and says when the physics
/// should look at an episode that is open: 20 (early), 40, 150 and 300 s after
/// its detection, then at twice the age each time. While there is none, or
/// one that a routine look opened, a routine look is due every 300 s, at the
/// same stamps whenever a program was started; it does not compare what lies
/// outside the commands and pressures that the set was taught. What comes on
/// top of the fault of an episode is looked at 40, 150 and 300 s after it was
/// detected, with that fault as it stood before. All of these are longer by
/// SlownessOf() the period. Keeps the last 420 samples.
class EpisodeLooks {
 public:
  /// `physics` must outlive it.
  /// @param at_position see LookWindow.
  explicit EpisodeLooks(const ValvePhysics& physics, bool at_position = false);

  /// The next sample and what the engine said about it.
  /// @param suspected a routine look found the valve abnormal.
  std::optional<LookTask> Step(const Sample& sample, const Verdict& verdict,
                               bool suspected = false);

  /// A look at how strong the faults of the open episode are after the last
  /// sample. Nothing if there is no episode, or too little was measured.
  std::optional<LookTask> GrowthTask(std::vector<Explanation> known) const;

 private:
  struct Row {
    std::int64_t stamp_ns;
    RecordRow row;
    bool covered{false};  // Where the model set was taught.
  };

  void AddRow(const Sample& sample);
  void BeginRows(std::int64_t stamp_ns);
  double FlowShare(bool last) const;
  std::optional<LookTask> Task(std::int64_t detection_ns) const;
  std::optional<LookTask> SecondTask(const Verdict& verdict);
  std::optional<LookTask> RoutineTask(bool suspected) const;

  const ValvePhysics& physics_;
  std::int64_t period_ns_;
  std::int64_t slowness_;
  bool at_position_;
  SignalMask signals_{0};
  std::deque<Row> rows_{};
  // Of the last time that the rows began anew: when, if nothing was read for
  // five minutes or more before; the last stamp and FlowShare() before that.
  std::int64_t outage_end_ns_{0};
  std::int64_t before_ns_{0};
  std::optional<double> share_before_{};
  std::optional<std::int64_t> detection_ns_{};
  std::int64_t next_age_ns_{0};
  std::int64_t set_back_ns_{0};    // See LookTask.
  bool by_routine_{false};         // The open episode.
  std::int64_t second_ns_{0};      // Detection of what is on top.
  std::int64_t second_age_ns_{0};  // Of the next look at it.
  std::size_t judged_{0};  // Rows in a row that a routine look may hold.
  std::int64_t slot_{0};   // Of a routine look.
};

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
  // Whether a look that comes so late is heard.
  bool AcceptsLate(const LookAnswer& answer);

  std::vector<Entry> entries_;
  std::vector<Explanation> doubt_;  // What the last look named instead.
};

/// What routine looks find. Two in a row that name the same fault make the
/// valve suspect, until one finds that it follows its physics without a fault.
class Suspicion {
 public:
  void Enter(std::int64_t stamp_ns, LookAnswer answer);
  /// The answers up to now count.
  void Advance(std::int64_t stamp_ns);
  void Dismiss();

  /// Of the look that made the valve suspect; null: it is not.
  const LookAnswer* found() const { return found_ ? &*found_ : nullptr; }

 private:
  void Take(LookAnswer answer);

  std::deque<std::pair<std::int64_t, LookAnswer>> waiting_;  // By stamp.
  std::optional<LookAnswer> last_;  // Of the last look, if it named a fault.
  std::optional<LookAnswer> found_;
};

/// What the observers name. Near the limits of what they can see, their answer
/// changes with the noise. From ten minutes after the detection on, it is
/// therefore every fault that they isolated in the second half of the episode.
class ObserversMemory {
 public:
  /// The observers isolate `faults` at `stamp_ns`.
  void Step(std::int64_t detection_stamp_ns, std::int64_t stamp_ns,
            FaultSet faults);

  FaultSet faults() const { return faults_; }

 private:
  std::int64_t detection_stamp_ns_{0};
  std::int64_t last_stamp_ns_{0};           // Of the last sample.
  std::int64_t set_back_ns_{0};             // As of LookTask.
  std::array<std::int64_t, 64> last_ns_{};  // When each was isolated.
  FaultSet seen_{0};                        // Those that ever were.
  FaultSet faults_{0};
};

/// The looks at one valve and what they make of it: when one is due, the name
/// of the open episode, and whether there should be one.
class ValveLooks {
 public:
  /// `physics` and `models` must outlive it; without a set, every signal counts
  /// and no groups bind.
  explicit ValveLooks(const ValvePhysics& physics,
                      const ModelSet* models = nullptr);

  /// The next sample, whatever its intake, and what the engine said about it.
  std::optional<LookTask> Step(const Sample& sample, const Verdict& verdict);

  /// The answer to a look that was due; of an earlier episode it counts for
  /// nothing.
  void Enter(const LookTask& task, LookAnswer answer);

  /// What counts for the open episode at the last sample, if there is one.
  const LookAnswer* Answer() const;
  /// The same for what is on top of the fault of that episode.
  const LookAnswer* SecondAnswer() const;

  /// What the observers name at the last sample, where the engine isolates
  /// `isolated`: see ObserversMemory. Empty if that is more than
  /// kMaxNamedFaults.
  FaultSet Observed(const ModelSet& models, FaultSet isolated) const;

  /// See EpisodeLooks::GrowthTask(). Its answer is not for Enter().
  std::optional<LookTask> GrowthTask(std::vector<Explanation> known) const {
    return looks_.GrowthTask(std::move(known));
  }

  /// The engine should have an episode (ValveEngine::Suspect).
  bool suspects() const { return suspicion_.found() != nullptr; }

 private:
  void EnterInBook(const LookTask& task, LookAnswer answer);

  EpisodeLooks looks_;
  const ModelSet* models_;
  TrainedSignals trained_;
  std::int64_t period_ns_;
  LookBook book_;
  LookBook second_book_;  // Of what is on top.
  Suspicion suspicion_;
  ObserversMemory memory_;
  std::int64_t stamp_ns_{0};
  std::int64_t detection_ns_{0};
  std::int64_t second_ns_{0};  // Detection of what is on top; 0: nothing is.
  bool open_{false};
};

}  // namespace fdi::simulator
