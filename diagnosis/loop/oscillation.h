#pragma once

#include <optional>
#include <span>

namespace fdi::loop {

/// The oscillation of a signal.
struct Oscillation {
  double period{0.0};  ///< T, mean over the crossings found [samples].
  /// r = mean(T_i) / (3 sd(T_i)); above 1 the oscillation is regular
  /// [Thornhill et al. 2003].
  double regularity{0.0};
  /// MSE of half sines / (MSE of half sines + MSE of triangles), in 0..1: below
  /// 0.5 a sine, above a triangle; square waves have 0.43 [He et al. 2007].
  double shape{0.5};
};

/// From the zero crossings of the autocorrelation of the signal without its
/// linear trend: T_i = 2 × the spacings of the first 11 crossings up to half
/// of the window. The shape is fitted between zero crossings of the signal
/// without frequencies beyond the 7th harmonic.
///
/// @returns nothing if there are fewer than four crossings: no oscillation, or
///   a window of less than about four periods.
///
/// - [Thornhill et al. 2003] "Detection of multiple oscillations in control
///   loops", J. Process Control 13, pp. 91-100.
/// - [He et al. 2007] "A curve fitting method for detecting valve stiction in
///   oscillating control loops", Ind. Eng. Chem. Res. 46, pp. 4549-4560.
std::optional<Oscillation> FindOscillation(std::span<const double> signal);

}  // namespace fdi::loop
