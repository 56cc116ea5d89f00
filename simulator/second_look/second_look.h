#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <vector>

#include "diagnosis/model/sample.h"
#include "simulator/second_look/valve_physics.h"

namespace fdi::simulator {

/// Recorded rows about an episode, one period apart.
struct LookWindow {
  std::vector<RecordRow> rows;  ///< At least 20, with X or F measured in 20.
  std::size_t detection{0};     ///< Row of the first abnormal sample; 0 if it
                                ///< lies before the window.
  SignalMask signals{0};        ///< That were measured.
  /// A fault that acts all the time: what is sought comes on top of it. 0:
  /// none.
  int standing{0};
  double standing_strength{0.0};  ///< Signed [-].
  /// The command of the rows is the position that was read
  /// (PositionAsCommand): faults of which only the rod's way to it tells are no
  /// hypotheses.
  bool at_position{false};
};

/// How one fault, at its best, explains the window.
struct Explanation {
  int fault{0};          ///< 0: none, but for a constant shift of X or F.
  double strength{0.0};  ///< Most likely; signed [-].
  double lowest{0.0};    ///< Ends of its 95 % interval [-].
  double highest{0.0};   ///<
  int start{0};          ///< Row that the fault begins at; < 0: before.
  bool growing{false};   ///< From 0 at `start` to `strength` at the end.
  double distance{0.0};  ///< Behind the best explanation [2 log-likelihood].
  double supply{1.0};    ///< Of what onboarding took for the supply pressure.
};

/// What the physics of the valve says about a window.
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
  double readings{0.0};  ///< Of X and F that count as independent.
  /// Both pressures and the position were measured: the force on the rod and
  /// what drives the flow are known, and so is which of the two a fault
  /// changes.
  bool complete{true};
  /// The valve's answer under the best explanation, one per row.
  std::vector<RecordAnswer> best;
};

/// Simulates the valve over the window with every fault of the catalogue that
/// moves X, F or an input (f8 and f14 do not), in each direction, abrupt or
/// growing, and ranks them by likelihood,
///
///     Q = sum_c 1/tau_c [ sum_k nu ln(1 + e_ck^2 / nu) + ln w_ck ] +
///     b_c^2/s_c^2
///
/// with e = (y - b - yhat) / (sd sqrt(w)): y is X or F, yhat simulated from the
/// recorded CV, P1, P2, T1, sd, tau and s the healthy scatter, correlation time
/// and slow deviation, b a constant shift. w = 1 + (kappa (yhat - yhat_0) /
/// sd)^2 lets the effect of a fault be off by a share. Strengths are found by
/// least squares between simulated ones. P1, P2 and T1 are compared with what
/// is usual. Distances are divided by the misfit of the best, at least 1.
///
/// Deterministic: no clock, no threads. @throws CvodeError.
///
/// @param stop asks it to end between two hypotheses: nothing is ranked then.
SecondLook RunSecondLook(const ValvePhysics& physics, const LookWindow& window,
                         const std::stop_token& stop = {});

/// The strengths of faults that are known, over a window that they act in all
/// the time: no other fault, course or supply pressure is tried. A twentieth of
/// the work of RunSecondLook().
struct StrengthLook {
  /// As they were asked for, with their strengths and intervals; empty if it
  /// was asked to stop.
  std::vector<Explanation> faults;
  double misfit{0.0};  ///< Of the one that fits best, as in SecondLook.
};

/// @param known fault, sign, supply pressure and about the strength of each.
/// @throws as RunSecondLook().
StrengthLook EstimateStrengths(const ValvePhysics& physics,
                               const LookWindow& window,
                               const std::vector<Explanation>& known,
                               const std::stop_token& stop = {});

/// Misfit of the window without any fault, but for a constant shift of X or F:
/// 0.6 to 1.2 of a healthy valve. A hundredth of the work of RunSecondLook().
/// @throws CvodeError; std::invalid_argument as RunSecondLook().
double MisfitWithoutFault(const ValvePhysics& physics,
                          const LookWindow& window);

}  // namespace fdi::simulator
