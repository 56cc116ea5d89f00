#pragma once

#include <cstdint>
#include <optional>

namespace fdi::loop {

/// Settings of TravelCounter, as positioners have them.
struct TravelOptions {
  double dead_band{1.0};  ///< Of travel and reversals [%].
  double end{1.0};        ///< Nearer to 0 or 100 % is at an end [%].
  double jump{1.0};       ///< A slip jump is at least as large [%] ...
  double quiet{0.25};     ///< ... while the command moves less than this [%].
};

/// What instrument people count of one valve. Times in s.
struct TravelCounts {
  double time_s{0.0};
  double auto_s{0.0};            ///< In automatic.
  double low_end_s{0.0};         ///< At the end of 0 %.
  double high_end_s{0.0};        ///< At the end of 100 %.
  double travel{0.0};            ///< Σ|dX|, noise included [%].
  double dead_band_travel{0.0};  ///< Beyond the dead band [%].
  std::int64_t reversals{0};     ///< Turns longer than the dead band.
  std::int64_t slip_jumps{0};
  double largest_jump{0.0};  ///< [%]
};

/// Counts one sample after the other; bounded memory, no allocation.
///
/// Travel with a dead band: the change of position counts once the position has
/// left the band around the last reference; the reference then moves there. A
/// reversal is a counted change in the other direction. A slip jump is a step
/// of the position of one sample while the command stands still. The
/// definitions are those of positioners (Fisher DVC, Flowserve Logix, Siemens
/// SIPART PS2).
class TravelCounter {
 public:
  explicit TravelCounter(const TravelOptions& options = {})
      : options_(options) {}

  /// @param command CV [%].
  /// @param position X [%], or CV where X is not measured, which then has no
  ///   slip jumps.
  /// @param period_s that the sample stands for.
  /// @throws std::invalid_argument unless all are finite and the period is
  ///   positive.
  void Push(double command, double position, bool automatic, double period_s);

  /// The next sample is not compared with those before: after a gap.
  void Restart() { last_.reset(); }

  const TravelCounts& counts() const { return counts_; }

 private:
  struct Last {
    double command;
    double position;
    double reference;
  };

  TravelOptions options_;
  TravelCounts counts_;
  std::optional<Last> last_;
  int direction_{0};  // 0: not yet known.
};

/// What a step of the command did. Times are from the step to the first sample
/// that has reached the value, of which one sample period is uncertain.
struct StepResponse {
  double size{0.0};       ///< Of the command [%], signed.
  double gain{0.0};       ///< Realised step / step of the command [-].
  double t63_s{0.0};      ///< To 63 % of the realised step.
  double t86_s{0.0};      ///< To 86.5 % of it.
  double overshoot{0.0};  ///< Beyond the end value [% of the realised step].
};

/// Finds natural steps: the command moves at least `smallest` in one sample and
/// then stays within a tenth of that for `hold_s`; the position before has
/// settled for as long. The realised step is from the last position before to
/// the mean of the last third of the hold.
class StepFinder {
 public:
  /// @throws std::invalid_argument unless both are positive.
  explicit StepFinder(double smallest = 2.0, double hold_s = 20.0);

  /// @returns the response, once it is complete.
  std::optional<StepResponse> Push(double command, double position,
                                   double period_s);

 private:
  std::optional<StepResponse> Response() const;

  static constexpr int kMaxSamples = 256;
  double smallest_;
  double hold_s_;
  double still_s_{0.0};  // The command has stood this long.
  std::optional<double> command_;
  double position_{0.0};
  bool in_step_{false};
  double from_command_{0.0};
  double from_position_{0.0};
  double period_s_{0.0};
  int count_{0};
  double positions_[kMaxSamples]{};
};

}  // namespace fdi::loop
