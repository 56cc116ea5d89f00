#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"

namespace fdi::loop {

/// Counts of a valve over some time, in the terms of instrument engineers. Sums
/// of whole quanta, so parts add up exactly in any order. 0 where X is lacking.
struct ValveCounts {
  static constexpr double kQuantum = 1e-3;  ///< In % and in units of gain [-].

  std::int64_t auto_ms{0};    ///< In automatic.
  std::int64_t limit_ms{0};   ///< CV within 0.5 % of 0 or 100 %.
  std::int64_t path{0};       ///< Travel of X, else of CV, without a dead band.
  std::int64_t slips{0};      ///< Jumps of a rod that stood,
  std::int64_t slip_size{0};  ///< and Σ of their sizes.
  std::int64_t turns{0};      ///< Turns of CV that X followed,
  std::int64_t dead_band{0};  ///< and Σ of what CV moved until it did.
  std::int64_t opening{0};    ///< Samples of slow ramps towards open,
  std::int64_t opening_offset{0};  ///< and Σ(X − CV) over them;
  std::int64_t closing{0};         ///< the same towards closed.
  std::int64_t closing_offset{0};
  std::int64_t steps{0};     ///< Natural steps of CV; Σ over them:
  std::int64_t delay_ms{0};  ///< Td
  std::int64_t t63_ms{0};
  std::int64_t t86_ms{0};
  std::int64_t overshoot{0};  ///< [% of the realised step]
  std::int64_t gain{0};       ///< Travel gain ΔX/ΔCV.
  /// Single readings that were wrong or unusable (Verdict::single), by signal.
  std::int64_t single_cv{0};
  std::int64_t single_p1{0};
  std::int64_t single_p2{0};
  std::int64_t single_t1{0};
  std::int64_t single_x{0};
  std::int64_t single_f{0};

  void Add(const ValveCounts& other);
  bool operator==(const ValveCounts&) const = default;
};

/// All numbers of ValveCounts, in the order in which they are stored.
inline constexpr std::array<std::int64_t ValveCounts::*, 23> kValveCounts{
    &ValveCounts::auto_ms,        &ValveCounts::limit_ms,
    &ValveCounts::path,           &ValveCounts::slips,
    &ValveCounts::slip_size,      &ValveCounts::turns,
    &ValveCounts::dead_band,      &ValveCounts::opening,
    &ValveCounts::opening_offset, &ValveCounts::closing,
    &ValveCounts::closing_offset, &ValveCounts::steps,
    &ValveCounts::delay_ms,       &ValveCounts::t63_ms,
    &ValveCounts::t86_ms,         &ValveCounts::overshoot,
    &ValveCounts::gain,           &ValveCounts::single_cv,
    &ValveCounts::single_p1,      &ValveCounts::single_p2,
    &ValveCounts::single_t1,      &ValveCounts::single_x,
    &ValveCounts::single_f};

/// Number of single readings of a signal in `counts`.
struct SingleReadings {
  Signal signal{Signal::kF};
  std::int64_t number{0};
};

/// Adds those of `signals`.
void CountSingle(SignalMask signals, ValveCounts& counts);
/// The signal with most of them; 0: there are none.
SingleReadings MostSingle(const ValveCounts& counts);

/// A figure of a valve that has a limit in the catalogue.
enum class Figure : std::uint8_t {
  kAtLimit,     ///< Share of the time with CV at an end of its range [%].
  kSlipJump,    ///< Mean size of the jumps [%].
  kDeadBand,    ///< Mean dead band at turns [%].
  kErrorBand,   ///< Dynamic error band: width of X over CV on ramps [%].
  kDelay,       ///< Td of natural steps, mean, as the next four [s].
  kT63,         ///< [s]
  kT86,         ///< [s]
  kOvershoot,   ///< [% of the realised step]
  kTravelGain,  ///< ΔX/ΔCV [-].
  kSingle,      ///< MostSingle() [1/h].
};
inline constexpr std::size_t kFigureCount = 10;

/// "at_limit", "slip_jump", "dead_band", "error_band", "delay", "t63", "t86",
/// "overshoot", "travel_gain" or "single_readings".
std::string_view FigureName(Figure figure);

/// The figure as `counts` of `seen_ms` have it; nothing if too little was
/// counted: no time, jump, turn or step, or less than 60 samples of ramps
/// either way.
std::optional<double> FigureOf(Figure figure, const ValveCounts& counts,
                               std::int64_t seen_ms);

/// Counts from the samples of one valve, all but single readings, at a cost and
/// a memory that do not depend on its history. Positions and commands in % of
/// closing.
///
/// - Slip jump: X, which has stood (0.1 % in two samples), moves by 0.5 % or
///   more from one sample to the next, and by more than twice what CV moved
///   between any two samples of late (a maximum that decays in 10 s), and by
///   five times what X usually moves (a mean of a minute), which noise does
///   not: a rod that stuck and let go.
/// - Dead band: when CV turns (by 0.25 %) at c*, where X is x*, until X has
///   followed by 0.25 %: |CV − c*| − |X − x*|. With a play this is its width,
///   whichever sample shows it. Turns in which CV moves by more
///   than 1 %/s say nothing, because X lags.
/// - Dynamic error band: the mean of X − CV while CV falls, minus the mean
///   while it rises, on ramps of 0.01 to 0.25 %/s, once CV has moved 2 % one
///   way.
/// - Steps: CV, which stood for 10 s (0.1 %), moves by 2 % or more from one
///   sample to the next and stays there (a tenth of the step) for 10 to 60 s.
///   x_∞ is the mean of the last quarter of that, x_∞ − x_0 the realised step,
///   at least a quarter of that of CV. Td is the time until 2 % of it, T63 and
///   T86 until 63.2 and 86.5 %, interpolated between samples from the first
///   one with the new CV: good to a sample period.
///
/// One thread at a time.
///
/// Source: terms of ISA-75.25.01 and of positioners that count (docs/
/// loops.md).
class ValveCounters {
 public:
  struct Reading {
    double cv{0.0};  ///< NaN: none.
    double x{0.0};   ///< NaN: none.
    double period_s{1.0};
    bool automatic{true};
  };

  /// Adds what `reading` counts to `counts`.
  void Push(const Reading& reading, ValveCounts& counts);
  /// The next reading is not compared with those before: a gap, another source.
  void Restart() { *this = ValveCounters(); }

 private:
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  // The way of CV since it turned last.
  struct Leg {
    int direction{0};  // 0: not yet known
    double begin{0.0};
    double extreme{0.0};
    double x{0.0};  // At the extreme.
  };
  struct Turn {
    double cv;
    double x;
  };
  struct Step {
    double cv_before;
    double cv;
    double x_before;
    double last_cv;
    std::vector<float> x{};  // From the first sample with the new CV on.
  };

  void Begin(const Reading& now);
  void CountSlip(const Reading& now, ValveCounts& counts);
  void CountTurn(const Reading& now, ValveCounts& counts);
  void CountRamp(const Reading& now, ValveCounts& counts);
  void CountStep(const Reading& now, ValveCounts& counts);
  void FinishStep(double period_s, ValveCounts& counts) const;

  bool measurable_{false};  // The last reading had CV and X.
  double cv_{kNone};        // In the last reading, like the next.
  double x_{kNone};
  double x_before_{kNone};  // In the reading before.
  double recent_cv_{0.0};   // Decaying maximum of |ΔCV| [%].
  double usual_x_{0.0};     // Leaky mean of |ΔX| [%],
  double usual_s_{0.0};     // of so long.
  double rate_{0.0};        // Leaky mean of dCV/dt [%/s].
  double held_cv_{0.0};     // CV has stood there
  double held_s_{0.0};      // for so long.
  Leg leg_;
  std::optional<Turn> turn_;  // X has not followed yet.
  std::optional<Step> step_;
};

}  // namespace fdi::loop
