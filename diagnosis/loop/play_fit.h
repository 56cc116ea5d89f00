#pragma once

#include <optional>
#include <span>

namespace fdi::loop {

/// The longest lag that FitPlay() tries [samples].
inline constexpr int kLongestLag = 6;

/// Compares how well PV follows OP through a play and without one.
struct PlayFit {
  double linear{0.0};     ///< r² of the best fit without a play.
  double play{0.0};       ///< r² of the best fit with one.
  double band{0.0};       ///< w of the best fit [% of OP span].
  double band_low{0.0};   ///< The widths whose squared error is within 5 % of
  double band_high{0.0};  ///< the least.
  double step{0.0};       ///< Between the widths that were tried.
  double start{0.0};      ///< Initial output of the play.
  int lag{0};             ///< First-order lag [samples].
  int delay{0};           ///< [samples]
  double offset{0.0};     ///< PV ≈ offset + slope · z.
  double slope{0.0};

  double gap() const { return play - linear; }
  /// G, the share of the linear fit's error that the play explains.
  double explained() const {
    return linear < 1.0 ? 1.0 - (1.0 - play) / (1.0 - linear) : 0.0;
  }
};

/// Fits PV ≈ a + b z, z = OP through a play of width w, a first-order lag of 0,
/// 2 or 6 samples, and a delay of 0, 1 or 2 samples; w = 0 and 24 widths from 4
/// to 90 % of the range of OP, each with the play in its lower, middle and
/// upper position at the beginning. b has the sign `sign`, or else the fit
/// explains nothing.
///
/// @param sign of the process gain, 1 or -1.
/// @returns nothing if OP or PV is constant, or the window has fewer than 20
///   samples.
std::optional<PlayFit> FitPlay(std::span<const double> op,
                               std::span<const double> pv, int sign);

/// The gain of one-step predictions of PV by the play that was fitted:
///
///     LLR = N/2 ln(SSE(u) / min_w SSE(play_w u)),
///     PV(k) = c + Σ_i a_i PV(k-i) + Σ_i b_i u(k-i),   i = 1..4,
///
/// by least squares, consistent in closed loop. Without u(k): with it the
/// controller's own law would explain everything. w goes from two steps below
/// `fit.band_low` to two above `fit.band_high`: a play of another width would
/// be no witness of this one.
///
/// @returns 0 if there are too few samples or nothing to predict.
double PlayPredictionGain(std::span<const double> op,
                          std::span<const double> pv, const PlayFit& fit);

/// r² of increments of PV over h = 3, 6 or 12 samples from the mean of OP over
/// the same samples, delays 0, 1, 3, 6, as an integrating process has them; of
/// the best fit whose slope has the sign `sign`.
double FitIncrements(std::span<const double> op, std::span<const double> pv,
                     int sign);

}  // namespace fdi::loop
