#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "diagnosis/loop/audit.h"

namespace fdi::loop {

enum class LoopState {
  kHealthy,
  kSluggish,
  kTight,
  kExternalSine,
  kSticky,
  kStuck  ///< From a quarter of the window on, when the load steps.
};

/// A PI loop around a valve with play. OP in % of its span, PV in %, too.
struct ClosedLoop {
  LoopState state{LoopState::kHealthy};
  bool level{false};
  bool slow{false};    ///< A temperature, under a load that swings slowly.
  double band{0.0};    ///< The play's [% of OP], if kSticky.
  double noise{0.05};  ///< Standard deviation of PV's reading [%].
  bool steps{false};   ///< The set point steps every 20 to 40 min.
  double period_s{10.0};
  int samples{750};
};

/// Two hours of `loop`, with gain, lag, delay, load and tuning by `seed`.
inline Window Simulate(const ClosedLoop& loop, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  std::normal_distribution<double> normal;
  const double gain = uniform(0.5, 2.0);
  const double lag_s = uniform(5.0, 40.0) * (loop.slow ? 30.0 : 1.0);
  const int delay_s = static_cast<int>(uniform(1.0, 15.0));
  const double fill_s = uniform(200.0, 1500.0);  // A level's, at 1 % of OP.
  // PI by lambda: λ of 1 to 3 lags in sound loops.
  const double slow = loop.state == LoopState::kSluggish ? uniform(6.0, 20.0)
                      : loop.state == LoopState::kTight  ? uniform(0.15, 0.4)
                                                         : uniform(1.0, 3.0);
  const double sample_s = loop.period_s;
  const double dead_s = delay_s + 0.5 * sample_s;
  double kc = 0.0;
  double ti_s = 0.0;
  if (loop.level) {
    const double lambda_s = slow * uniform(100.0, 200.0);
    kc = 2.0 * fill_s / (gain * (lambda_s + dead_s));
    ti_s = 2.0 * lambda_s + dead_s;
    if (loop.state == LoopState::kTight) {
      ti_s = 0.3 * ti_s;
    }
  } else {
    const double lambda_s = slow * (lag_s + dead_s);
    kc = (lag_s + 0.5 * sample_s) / (gain * (lambda_s + dead_s));
    ti_s = lag_s + 0.5 * sample_s;
  }
  const double sine =
      loop.state == LoopState::kExternalSine ? uniform(0.5, 3.0) : 0.0;
  const double sine_s = uniform(120.0, 900.0);
  const double load_noise = uniform(0.02, 0.1) * (loop.slow ? 20.0 : 1.0);
  const double load_memory =
      std::exp(-1.0 / (uniform(200.0, 1500.0) * (loop.slow ? 10.0 : 1.0)));
  const double load_step = loop.state != LoopState::kStuck ? 0.0
                           : uniform(0.0, 1.0) < 0.5       ? uniform(15.0, 40.0)
                                                     : uniform(-40.0, -15.0);
  double sp = 50.0;
  double op = 50.0;
  double stem = 50.0;
  double flow = 50.0;
  double pv = 50.0;
  double load = 0.0;
  double e_last = 0.0;
  std::vector<double> moving(static_cast<std::size_t>(delay_s) + 1, 50.0);
  double next_step_s = loop.steps ? uniform(600.0, 1200.0) : 1e300;
  Window window;
  window.period_s = sample_s;
  if (loop.level) {
    window.integrating = true;
  }
  const int step = static_cast<int>(sample_s);
  const int settle_s = 3600;
  for (int t = -settle_s; t < loop.samples * step; ++t) {
    if (t % step == 0) {
      if (t > next_step_s) {
        sp = 50.0 + uniform(-4.0, 4.0);
        next_step_s = t + uniform(1200.0, 2400.0);
      }
      const double reading = pv + loop.noise * normal(random);
      const double e = sp - reading;
      op += kc * (e - e_last + sample_s / ti_s * e);
      op = std::min(100.0, std::max(0.0, op));
      e_last = e;
      if (t >= 0) {
        window.op.push_back(op);
        window.pv.push_back(reading);
        window.sp.push_back(sp);
      }
    }
    const double band = loop.state == LoopState::kSticky ? loop.band : 0.0;
    const bool stuck =
        loop.state == LoopState::kStuck && 4 * t > loop.samples * step;
    stem = stuck ? stem : std::clamp(stem, op - 0.5 * band, op + 0.5 * band);
    load = load_memory * load + load_noise *
                                    std::sqrt(1.0 - load_memory * load_memory) *
                                    5.0 * normal(random);
    const double outside = load + (stuck ? gain * load_step : 0.0) +
                           sine * std::sin(2.0 * std::numbers::pi * t / sine_s);
    moving[static_cast<std::size_t>(t + settle_s) % moving.size()] = stem;
    const double late =
        moving[static_cast<std::size_t>(t + settle_s + 1) % moving.size()];
    if (loop.level) {
      flow += (late - flow) / 3.0;
      pv += (gain * (flow - 50.0) + outside) / fill_s;
    } else {
      flow += (50.0 + gain * (late - 50.0) + outside - flow) / lag_s;
      pv = flow;
    }
  }
  return window;
}

}  // namespace fdi::loop
