// Measures the cost of an hour of one valve with CVODE, against RK4 with a
// fixed step of 2.5 ms on the same right-hand side. Ratios of the same run,
// errors against CVODE at a thousandth of its tolerances.
//
//     build/release/bin/fdi-bench-simulator
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <vector>

#include "simulator/control_valve.h"
#include "simulator/valve_simulation.h"

namespace {

using namespace fdi;
using namespace fdi::simulator;

constexpr int kSeconds = 3600;
constexpr int kRounds = 5;
constexpr int kStepsPerSecond = 400;  // of RK4

// The benchmark's sine, which is smooth enough to be taken as it is.
ProcessInputs SineAt(double t) {
  const auto sine = [t](double hertz) {
    return std::sin(2.0 * std::numbers::pi * hertz * t);
  };
  ProcessInputs inputs;
  inputs.command = 0.5 + 0.25 * sine(0.01);
  inputs.inlet_pressure_pa = 3.5e6 + 175e3 * sine(0.1);
  inputs.outlet_pressure_pa = 2.6e6 + 26e3 * std::sin(2.0 * t);
  inputs.temperature_c = 43.0;
  return inputs;
}

// x of every second, fraction of the stroke.
using Trace = std::vector<double>;

Trace Cvode(bool continuous, double scale) {
  ControlValve valve(ValveParameters{}, scale);
  valve.Settle(SineAt(0.0));
  Trace trace;
  for (int k = 0; k < kSeconds; ++k) {
    if (continuous) {
      valve.AdvanceSmoothly(k, k + 1.0, SineAt);
    } else {
      valve.Advance(1.0, SineAt(k), SineAt(k + 1.0));
    }
    trace.push_back(valve.state().rod);
  }
  return trace;
}

// A valve that RK4 steps: the rules of ControlValve at stops and standstill,
// applied at the end of each step.
class Rk4Valve {
 public:
  explicit Rk4Valve(const ValveParameters& parameters)
      : dynamics_(parameters), n_(dynamics_.state_count()) {
    ControlValve settled(parameters, 1.0);
    settled.Settle(SineAt(0.0));
    const ValveState start = settled.state();
    dynamics_.SetInputs(SineAt(0.0), SineAt(0.0), 1.0);
    dynamics_.Align(start.actuator);
    x_[kActuatorState] = start.actuator;
    x_[kChargeState] =
        dynamics_.ChargeFor(start.chamber_pressure_pa, start.actuator);
    x_[kFirstLagState] = x_[kSecondLagState] = SineAt(0.0).command;
  }

  void Advance(int second, bool continuous) {
    const double from = continuous ? second : 0.0;
    if (continuous) {
      dynamics_.FollowInputs(SineAt, from);
    } else {
      dynamics_.SetInputs(SineAt(second), SineAt(second + 1.0), 1.0);
    }
    for (int i = 0; i < kStepsPerSecond; ++i) {
      SelectMotion(from + i * kStep);
      Step(from + i * kStep);
    }
  }

  double rod() const { return dynamics_.Rod(x_[kActuatorState]); }

 private:
  using State = std::array<double, 6>;
  static constexpr double kStep = 1.0 / kStepsPerSecond;

  State At(double t, const State& from, const State& slope, double h) const {
    State x = from;
    for (std::size_t i = 0; i < n_; ++i) {
      x[i] += h * slope[i];
    }
    State dx{};
    dynamics_.Derivatives(t + h, x.data(), dx.data());
    return dx;
  }

  void SelectMotion(double t) {
    const double friction = dynamics_.BreakAwayForce();
    const double v = x_[kVelocityState];
    const double z = x_[kActuatorState];
    const double force = dynamics_.NetForce(t, x_.data());
    const bool rises = force > friction && z < dynamics_.HighStop();
    const bool falls = force < -friction && z > dynamics_.LowStop();
    if (v != 0.0) {
      dynamics_.set_motion(friction == 0.0 ? Motion::kFree
                           : v > 0.0       ? Motion::kRising
                                           : Motion::kFalling);
    } else if (!rises && !falls) {
      dynamics_.set_motion(Motion::kHeld);
    } else {
      dynamics_.set_motion(friction == 0.0 ? Motion::kFree
                           : rises         ? Motion::kRising
                                           : Motion::kFalling);
    }
  }

  void Step(double t) {
    const State k1 = At(t, x_, x_, 0.0);
    const State k2 = At(t, x_, k1, 0.5 * kStep);
    const State k3 = At(t, x_, k2, 0.5 * kStep);
    const State k4 = At(t, x_, k3, kStep);
    const double v = x_[kVelocityState];
    for (std::size_t i = 0; i < n_; ++i) {
      x_[i] += kStep / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    }
    double& z = x_[kActuatorState];
    const double held =
        std::clamp(z, dynamics_.LowStop(), dynamics_.HighStop());
    const bool reverses =
        dynamics_.motion() != Motion::kFree && v * x_[kVelocityState] < 0.0;
    if (held != z || reverses) {
      x_[kVelocityState] = 0.0;
    }
    z = held;
    dynamics_.Commit(x_.data());
  }

  ValveDynamics dynamics_;
  std::size_t n_;
  State x_{};
};

Trace Rk4(bool continuous) {
  Rk4Valve valve{ValveParameters{}};
  Trace trace;
  for (int k = 0; k < kSeconds; ++k) {
    valve.Advance(k, continuous);
    trace.push_back(valve.rod());
  }
  return trace;
}

double WorstError(const Trace& trace, const Trace& reference) {
  double worst = 0.0;
  for (std::size_t k = 0; k < trace.size(); ++k) {
    worst = std::max(worst, std::abs(trace[k] - reference[k]));
  }
  return 100.0 * worst;
}

double Seconds(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
      .count();
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void Compare(const char* name, bool continuous) {
  const Trace reference = Cvode(continuous, 1e-3);
  Trace cvode;
  Trace rk4;
  std::vector<double> cvode_s;
  std::vector<double> rk4_s;
  for (int round = 0; round < kRounds; ++round) {
    cvode_s.push_back(Seconds([&] { cvode = Cvode(continuous, 1.0); }));
    rk4_s.push_back(Seconds([&] { rk4 = Rk4(continuous); }));
  }
  std::printf("%-22s  %9.3f  %9.3f  %6.2f  %12.4f  %12.4f\n", name,
              Median(cvode_s), Median(rk4_s), Median(rk4_s) / Median(cvode_s),
              WorstError(cvode, reference), WorstError(rk4, reference));
}

double RunTogether(int valves) {
  ValveSimulationConfig config;
  config.duration_s = 600.0;
  std::vector<ValveSimulation> simulations;
  for (int i = 0; i < valves; ++i) {
    config.seed = static_cast<std::uint64_t>(i) + 1;
    simulations.emplace_back(config);
  }
  return Seconds([&] {
    while (!simulations.front().finished()) {
      for (ValveSimulation& simulation : simulations) {
        simulation.Step();
      }
    }
  });
}

}  // namespace

int main() {
  std::printf(
      "s per simulated hour, median of %d in turn; error of X against "
      "a tight run [%% of span]\n",
      kRounds);
  std::printf("%-22s  %9s  %9s  %6s  %12s  %12s\n", "inputs", "CVODE", "RK4",
              "ratio", "CVODE error", "RK4 error");
  Compare("held for 1 s", false);
  Compare("continuous", true);
  std::printf("\n%-22s  %9s  %9s\n", "valves, 600 s each", "s", "s/valve");
  for (const int valves : {1, 10, 100}) {
    const double seconds = RunTogether(valves);
    std::printf("%-22d  %9.3f  %9.4f\n", valves, seconds, seconds / valves);
  }
  return 0;
}
