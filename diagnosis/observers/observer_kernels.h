#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "diagnosis/model/sample.h"
#include "diagnosis/observers/observer_plan.h"

namespace fdi {

/// Outputs of the observers for one sample, in the blocks of the plan.
struct ObserverOutputs {
  explicit ObserverOutputs(const ObserverPlan& plan);

  std::vector<double> readings;  ///< By channel; NaN: not measured.
  std::vector<char> saturated;
  std::vector<Quad> predictions;
  std::vector<Quad> residuals;
  std::vector<Quad> extrapolations;
};

/// State of one valve's observers, and the buffer for their outputs.
struct ObserverState {
  ObserverState(const ObserverPlan& plan,
                std::shared_ptr<ObserverOutputs> place);

  std::size_t Row(int lag) const {
    return static_cast<std::size_t>((head + depth - lag) % depth);
  }

  int depth;  ///< Length of the rings.
  int head{0};
  std::vector<std::array<double, kSignalCount>> measured;  ///< A ring.
  std::vector<SignalMask> uncertain;                       ///< A ring.
  std::vector<Quad> own_past;  ///< Ring of rows of plan.own_blocks().
  std::vector<char> active;    ///< By channel.
  std::shared_ptr<ObserverOutputs> outputs;
};

/// The instruction set of the kernels below. The results have the same bits
/// with all of them.
enum class InstructionSet { kPortable, kAvx2 };

/// The best one that this processor supports.
InstructionSet BestInstructionSet();

/// Parameters of evidence on one channel; see ObserverEvidence.
struct GainTerms {
  double memory;       ///< λ
  double time;         ///< τ_c [samples].
  bool counts_spread;  ///< False where the reading has no density (saturated).
};

/// Upper bound of r²/S in evidence, against outliers.
inline constexpr double kMaxSquaredDistance = 25.0;

/// Loops over observers, four at a time.
struct ObserverKernels {
  /// Predictions, extrapolations and residuals of the active channels for the
  /// newest row of measurements.
  void (*predict)(const ObserverPlan& plan, ObserverState& state);

  /// μ of the residuals of blocks [first, last), after subtracting possible
  /// extrapolation errors; kAbstains where the residual is NaN. memberships[0]
  /// belongs to the first block.
  void (*score)(const ObserverPlan& plan, const ObserverState& state,
                std::size_t first, std::size_t last, double* memberships);

  /// L_c ← λ L_c − ½ (r²/S + ln S)/τ_c for all observers of a channel, without
  /// the gain where the residual is NaN.
  /// @param parts L_c, by block of the plan.
  void (*gather)(const ObserverPlan& plan, const ObserverState& state,
                 std::size_t channel, const GainTerms& terms, Quad* parts);
};
inline constexpr double kAbstains = 2.0;  ///< Beyond any membership.

const ObserverKernels& KernelsFor(InstructionSet instructions);

}  // namespace fdi
