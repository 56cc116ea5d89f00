#pragma once

namespace fdi::trainer {

/// Hours of a year, 365.25 days.
inline constexpr double kHoursPerYear = 8766.0;

/// How often something happened, and how often it may.
struct EventRate {
  double per_year{0.0};
  double upper{0.0};  ///< 95 % bound [1/year], exact for a Poisson process.
};

/// The rate of `events` in `hours`; the bound μ solves P(N ≤ events | μ) = 5 %:
/// none in T says below 3/T.
/// @throws std::invalid_argument if events < 0 or hours ≤ 0.
EventRate RateOf(int events, double hours);

}  // namespace fdi::trainer
