#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <vector>

#include "base/time_units.h"
#include "diagnosis/model/record_row.h"
#include "diagnosis/model/sample.h"

/// The messages between the decision and a simulation of the valve: the window
/// to look at, and how well each fault explains it. The simulation itself is
/// not known here (LookSimulation).
namespace fdi {

/// Ages of an episode at which looks are due; then at twice the age each.
inline constexpr std::int64_t kEarlyLookAge = 20 * kNsPerSecond;
inline constexpr std::int64_t kFirstLookAge = 40 * kNsPerSecond;
inline constexpr std::int64_t kMiddleLookAge = 150 * kNsPerSecond;
inline constexpr std::int64_t kLastLookAge = 300 * kNsPerSecond;

/// Recorded rows about an episode, one period apart.
struct LookWindow {
  std::vector<RecordRow> rows;  ///< At least 20, with X or F measured in 20.
  std::size_t detection{0};     ///< Row of the first abnormal sample; 0 if it
                                ///< lies before the window.
  SignalMask signals{0};        ///< The measured ones.
  /// A fault that acts all the time; the one sought comes on top of it. 0:
  /// none.
  int standing{0};
  double standing_strength{0.0};  ///< Signed [-].
  /// The command of the rows is the position that was read
  /// (PositionAsCommand): faults that only the rod's way to it shows are no
  /// hypotheses.
  bool at_position{false};
};

/// The best explanation of the window by one fault.
struct Explanation {
  int fault{0};          ///< 0: none, but for a constant shift of X or F.
  double strength{0.0};  ///< Most likely; signed [-].
  double lowest{0.0};    ///< Ends of its 95 % interval [-].
  double highest{0.0};   ///<
  int start{0};          ///< Row that the fault begins at; < 0: before.
  bool growing{false};   ///< From 0 at `start` to `strength` at the end.
  double distance{0.0};  ///< Behind the best explanation [2 log-likelihood].
  double supply{1.0};    ///< Supply pressure, as a share of the onboarded one.
};

/// The explanations of a window by all faults.
struct SecondLook {
  /// All hypotheses, best first.
  std::vector<Explanation> ranked;
  /// f10 with the supply pressure that suits it best, where f16 is the best
  /// explanation: a healthy record does not tell that pressure, which decides
  /// between the two.
  std::optional<Explanation> perforation{};
  /// Mean square of the best explanation's errors in units of the healthy
  /// ones; far above 1 where none fits.
  double misfit{0.0};
  double readings{0.0};  ///< Independent readings of X and F.
  /// Both pressures and the position were measured: the force on the rod and
  /// what drives the flow are known, and so is which of the two a fault
  /// changes.
  bool complete{true};
  /// The valve's answer under the best explanation, one per row.
  std::vector<RecordAnswer> best;
};

/// The strengths of faults that are known, over a window that they act in all
/// the time.
struct StrengthLook {
  /// As they were asked for, with their strengths and intervals; empty if it
  /// was asked to stop.
  std::vector<Explanation> faults;
  double misfit{0.0};  ///< Least among them, as in SecondLook.
};

/// Why a look is due.
enum class LookOccasion : std::uint8_t {
  kEpisode,  ///< To name an open episode.
  kRoutine,  ///< There is no episode: should there be one?
  kStill,    ///< A routine look opened it: is the valve abnormal still?
  kGrowth,   ///< There is a name: how strong are its faults by now?
  kSecond,   ///< To name a second fault, on top of the one of an open episode.
};

/// A look that is due: at what, and for which episode.
struct LookTask {
  LookWindow window;
  std::int64_t stamp_ns{0};            ///< Stamp of the last row.
  std::int64_t detection_stamp_ns{0};  ///< Key of the episode, or of what
                                       ///< comes on top (kSecond).
  LookOccasion occasion{LookOccasion::kEpisode};
  std::vector<Explanation> known{};  ///< kGrowth only.
  std::int64_t slowness{1};          ///< See SlownessOf().
  /// The flow has changed while nothing was read, just before the window.
  bool changed_unread{false};
  /// By how much the stamps of the valve were set back since the detection.
  std::int64_t set_back_ns{0};
  /// kGrowth only: the middle of the rows, and the last row of the look that
  /// named `known`.
  std::int64_t middle_ns{0};
  std::int64_t named_ns{0};

  /// Age of the episode at the last row.
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

/// True if one of `explanations` is by `fault`.
inline bool Explains(const std::vector<Explanation>& explanations, int fault) {
  return std::ranges::count(explanations, fault, &Explanation::fault) > 0;
}

/// The kinds of answer that a second look gives.
enum class LookOutcome : std::uint8_t {
  kNamed,     ///< The set stands; inseparable faults are in it together.
  kUnclear,   ///< More than four faults explain the window: a shortlist.
  kNothing,   ///< No fault, or a constant shift, explains it as well.
  kNoneFits,  ///< No hypothesis follows the record: outside what is known.
};

struct LookAnswer {
  LookOutcome outcome{LookOutcome::kNoneFits};
  std::vector<Explanation>
      faults;  ///< One each, best first; none for kNoneFits.
  /// Faults beyond the margin, but within the errors of a simulation that lacks
  /// X or a pressure; empty if it has them.
  std::vector<Explanation> beside{};
  /// The other faults, each with its best explanation, best first.
  std::vector<Explanation> others{};
  double misfit{0.0};
  double readings{0.0};  ///< As in SecondLook.
  /// An early look has a wider set, does not overrule the observers, and no
  /// later look is measured by it. It serves faults that are over before the
  /// others come.
  bool early{false};
  /// The look is late. The alarm has lasted, so the faults that explain its
  /// window name the episode even where a constant shift would explain it, too.
  bool late{false};
  /// The valve's answer under the best explanation, a row each.
  std::vector<RecordAnswer> simulated;
  std::int64_t stamp_ns{0};  ///< Stamp of the last row.
  /// Misfit without any fault; set by a routine look only.
  double without_fault{0.0};
};

/// Readings of a valve while it is healthy.
struct UsualValve {
  double period_s{1.0};  ///< Between samples, > 0.
  double p1_kpa{0.0};    ///< Stands in for an input that is not measured.
  double p2_kpa{0.0};
  double t1_degc{0.0};
  double coldest_degc{0.0};  ///< Temperatures that can be simulated.
  double hottest_degc{0.0};
  double flow{0.0};          ///< Mean [flow unit].
  double slow_flow_sd{0.0};  ///< Deviation of ten-minute means [flow unit].
};

/// A simulation of one valve, which is not known here. The same window has the
/// same answer, bit for bit. One object may be used by several threads.
class LookSimulation {
 public:
  explicit LookSimulation(const UsualValve& usual) : usual_(usual) {}
  virtual ~LookSimulation() = default;
  LookSimulation(const LookSimulation&) = delete;
  LookSimulation& operator=(const LookSimulation&) = delete;

  const UsualValve& usual() const { return usual_; }

  /// Flow that the healthy valve passes with its rod at `x_pct` [flow unit].
  virtual double HealthyFlow(const InputRow& input, double x_pct) const = 0;

  /// All faults, by how well they explain the window; nothing is ranked if it
  /// was asked to stop.
  /// @throws Error if the simulation fails; std::invalid_argument unless the
  ///   window has 20 rows and a detection among them. So do the others.
  virtual SecondLook Look(const LookWindow& window,
                          const std::stop_token& stop) const = 0;

  /// No other fault, course or supply pressure is tried: a twentieth of the
  /// work of Look(). @param known fault, sign, supply pressure and about the
  /// strength of each.
  virtual StrengthLook Strengths(const LookWindow& window,
                                 const std::vector<Explanation>& known,
                                 const std::stop_token& stop) const = 0;

  /// Misfit of the window without any fault, but for a constant shift of X or
  /// F: 0.6 to 1.2 of a healthy valve. A hundredth of the work of Look().
  virtual double Misfit(const LookWindow& window) const = 0;

 private:
  UsualValve usual_;
};

}  // namespace fdi
