#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "diagnosis/loop/audit.h"
#include "tests/diagnosis/loop/closed_loop.h"

namespace fdi::loop {

/// How the load of a loop changes: as slowly as in a twentieth of the window,
/// or over all of it.
enum class Load { kWanders, kSine, kRamps, kSteps };

/// A sound PI loop around a process of second order with dead time, or an
/// integral, under a load. OP and PV in % of their spans.
struct LoadedLoop {
  char service{'F'};  ///< F, P, T or L: lags of seconds to 20 min.
  LoopState state{LoopState::kHealthy};  ///< That, sluggish or tight.
  Load load{Load::kWanders};
  double largest_load{10.0};  ///< [% of OP]
  double period_s{10.0};
  int samples{720};
  bool shut{false};  ///< The valve shuts before the window and stays so.
};

/// A window of `loop`, with process, tuning, load and noise by `seed`.
inline Window Simulate(const LoadedLoop& loop, std::uint64_t seed) {
  std::mt19937_64 random(seed * 7919 + 13);
  std::normal_distribution<double> normal;
  const auto uniform = [&](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  const auto decades = [&](double from, double to) {
    return std::exp(uniform(std::log(from), std::log(to)));
  };
  const bool level = loop.service == 'L';
  const double t = loop.period_s;
  const double span_s = t * loop.samples;
  double lag_s = loop.service == 'F'   ? decades(2.0, 20.0)
                 : loop.service == 'P' ? decades(10.0, 100.0)
                                       : decades(150.0, 1200.0);
  double second_s = uniform(0.05, 0.3) * lag_s;
  double delay_s = uniform(0.02, 0.4) * lag_s;
  if (level) {
    lag_s = second_s = 3.0;
    delay_s = uniform(1.0, 10.0);
  }
  const double sense = uniform(0.0, 1.0) < 0.5 ? 1.0 : -1.0;
  const double gain = decades(0.5, 2.0) * sense;
  const double fill_s = decades(200.0, 1500.0);
  const double slow = loop.state == LoopState::kSluggish ? uniform(6.0, 20.0)
                      : loop.state == LoopState::kTight  ? uniform(0.15, 0.4)
                                                         : uniform(1.0, 3.0);
  // PI by lambda.
  const double dead_s = delay_s + second_s + 0.5 * t;
  const double lambda_s =
      slow * (level ? uniform(100.0, 200.0) : lag_s + dead_s);
  const double ti_s = level ? (2.0 * lambda_s + dead_s) *
                                  (loop.state == LoopState::kTight ? 0.3 : 1.0)
                            : lag_s + 0.5 * t;
  const double kc =
      (level ? 2.0 * fill_s : ti_s) / (gain * (lambda_s + dead_s));
  const double memory_s = decades(0.05, 1.0) * span_s;
  const double size = decades(1.0, loop.largest_load) * std::abs(gain);
  const double noise = decades(0.01, 0.2);
  const double phase = uniform(0.0, 2.0 * std::numbers::pi);
  const double settle_s =
      std::min(2.0 * span_s, std::max(3600.0, 20.0 * lag_s));
  const double shut_s = loop.shut
                            ? -uniform(0.05, 1.0) * std::min(span_s, settle_s)
                            : std::numeric_limits<double>::infinity();
  double load = loop.load == Load::kWanders ? normal(random) : 0.0;
  double rate = 0.0;
  double next_s = -settle_s;
  const double kept = std::exp(-1.0 / memory_s);
  const double rest = uniform(35.0, 65.0);
  double op = rest;
  double last_e = 0.0;
  double first = 0.0;
  double second = 0.0;
  double pv = 50.0;
  std::vector<double> moving(static_cast<std::size_t>(delay_s) + 1, rest);
  std::size_t at = 0;
  Window window;
  window.period_s = t;
  for (auto now = -static_cast<long>(settle_s); now < static_cast<long>(span_s);
       ++now) {
    if (now % static_cast<long>(t) == 0) {
      const double reading = pv + noise * normal(random);
      const double e = 50.0 - reading;
      op = std::clamp(op + kc * (e - last_e + t / ti_s * e), 0.0, 100.0);
      last_e = e;
      if (now >= 0) {
        window.op.push_back(op);
        window.pv.push_back(reading);
        window.sp.push_back(50.0);
      }
    }
    const auto now_s = static_cast<double>(now);
    if (loop.load == Load::kWanders) {
      load = kept * load + std::sqrt(1.0 - kept * kept) * normal(random);
    } else if (loop.load == Load::kSine) {
      load = 1.4 * std::sin(2.0 * std::numbers::pi * now_s / memory_s + phase);
    } else if (now_s >= next_s) {
      const double target = normal(random);
      const double lasts_s = memory_s * uniform(0.5, 1.5);
      next_s = now_s + lasts_s;
      rate = loop.load == Load::kRamps ? (target - load) / lasts_s : 0.0;
      load = loop.load == Load::kRamps ? load : target;
    }
    load += rate;
    moving[at] = now_s >= shut_s ? 0.0 : op;
    at = (at + 1) % moving.size();
    const double flow = gain * (moving[at] - rest);
    if (level) {
      first += (flow - first) / lag_s;
      pv = std::clamp(pv + (first + size * load) / fill_s, 0.0, 100.0);
    } else {
      first += (flow + size * load - first) / lag_s;
      second += (first - second) / std::max(1.0, second_s);
      pv = 50.0 + second;
    }
  }
  return window;
}

}  // namespace fdi::loop
