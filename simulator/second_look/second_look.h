#pragma once

#include <stop_token>
#include <vector>

#include "diagnosis/decision/look.h"
#include "simulator/second_look/valve_physics.h"

namespace fdi::simulator {

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
///
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

/// The looks at one valve, by its physics.
class ValveLooker final : public LookSimulation {
 public:
  explicit ValveLooker(const ValvePhysics& physics);

  /// With the physics of `models`. @throws as PhysicsFrom().
  explicit ValveLooker(const ModelSet& models)
      : ValveLooker(PhysicsFrom(models.physics)) {}

  double HealthyFlow(const InputRow& input, double x_pct) const override;
  SecondLook Look(const LookWindow& window,
                  const std::stop_token& stop) const override;
  StrengthLook Strengths(const LookWindow& window,
                         const std::vector<Explanation>& known,
                         const std::stop_token& stop) const override;
  double Misfit(const LookWindow& window) const override;

 private:
  ValvePhysics physics_;
};

}  // namespace fdi::simulator
