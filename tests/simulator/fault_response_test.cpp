// Each of the nineteen faults must change X and F of the Lublin valve in its
// way under the benchmark's sine, noise off, against the healthy run.
#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

std::vector<Sample> SineRun(int fault, double strength) {
  ValveSimulationConfig config;
  config.parameters = ParameterSet("lublin-actuator-3");
  config.excitation = SineExcitation{};
  config.continuous_inputs = true;
  config.duration_s = 400.0;
  config.noise = false;
  config.resolution = false;
  if (fault > 0) {
    FaultSchedule schedule;
    schedule.fault = fault;
    schedule.initial_strength = strength;
    schedule.final_strength = strength;
    config.faults = {schedule};
  }
  ValveSimulation simulation(config);
  std::vector<Sample> samples;
  while (!simulation.finished()) {
    samples.push_back(simulation.Step().sample);
  }
  return samples;
}

struct Shift {
  double mean{0.0};
  double rms{0.0};
};

Shift ShiftOf(const std::vector<Sample>& faulty,
              const std::vector<Sample>& healthy, Signal signal) {
  Shift shift;
  for (std::size_t k = 100; k < 400; ++k) {
    const double difference = faulty[k][signal] - healthy[k][signal];
    shift.mean += difference / 300.0;
    shift.rms += difference * difference / 300.0;
  }
  shift.rms = std::sqrt(shift.rms);
  return shift;
}

struct Response {
  int fault;
  double strength;
  Shift x;  // [%].
  Shift f;  // [t/h].
};

// Over three periods of the sine; within 15 % of the rms.
const std::vector<Response> kResponses{
    {1, 0.5, {-1.9, 18.5}, {4.3, 13.8}},      // Held at the stop.
    {2, 0.5, {0.2, 0.41}, {-6.1, 7.9}},       // Less flow.
    {3, 0.5, {-0.1, 0.19}, {3.1, 4.4}},       // More flow.
    {4, 0.3, {-0.26, 1.5}, {0.18, 1.0}},      // X lags its command.
    {4, -0.5, {-0.01, 0.14}, {0.0, 0.11}},    // Without play, less.
    {5, 1.0, {0.0, 0.0}, {-0.55, 0.79}},      // 5 % of the flow lost.
    {6, 0.5, {0.0, 0.0}, {9.4, 12.5}},        // Leaks by the trim.
    {7, 0.25, {-1.3, 2.8}, {-0.16, 2.9}},     // Chokes.
    {7, 0.5, {-11.9, 16.7}, {14.3, 19.7}},    // Pushes the valve open.
    {8, 1.0, {0.006, 0.043}, {0.0, 0.029}},   // Hardly seen.
    {9, 1.0, {-0.49, 0.85}, {0.28, 0.70}},    // The leak wants a control error.
    {10, 0.5, {0.21, 2.5}, {0.10, 2.0}},      // Too weak at high P1.
    {11, 0.75, {1.4, 2.3}, {-0.73, 1.7}},     // Closes.
    {12, 0.5, {2.5, 4.1}, {-1.2, 2.9}},       // Slower relay.
    {12, -0.5, {-1.0, 2.0}, {0.63, 1.8}},     // Faster relay.
    {13, 0.5, {0.02, 0.90}, {13.2, 18.0}},    // X is held, the rod opens.
    {13, -0.2, {0.75, 3.0}, {-8.3, 10.5}},    // X is held, the rod closes.
    {14, 1.0, {0.0, 0.0}, {0.0, 0.0}},        // Nothing, either way.
    {14, -1.0, {0.0, 0.0}, {0.0, 0.0}},       //
    {15, 0.75, {35.0, 43.6}, {-18.5, 24.0}},  // Cycles from stop to stop.
    {16, 0.75, {-8.0, 12.0}, {6.9, 11.3}},    // Cannot shut.
    {17, 0.5, {-0.92, 1.65}, {4.7, 6.4}},     // P2 falls.
    {17, -0.2, {0.74, 1.25}, {-9.0, 11.5}},   // P1 falls.
    {18, 0.25, {0.0, 0.0}, {8.0, 10.5}},      // The bypass adds its flow.
    {19, 0.5, {0.0, 0.0}, {-7.0, 8.9}},       // The reading falls.
    {19, -0.25, {0.0, 0.0}, {2.4, 3.4}},      // The reading rises.
};

TEST(FaultResponseTest, EveryFaultMovesXAndFAsItMust) {
  const std::vector<Sample> healthy = SineRun(0, 0.0);
  std::set<int> seen;
  for (const Response& response : kResponses) {
    SCOPED_TRACE(FaultName(response.fault) + " at " +
                 std::to_string(response.strength));
    seen.insert(response.fault);
    const auto faulty = SineRun(response.fault, response.strength);
    for (const auto& [signal, expected] :
         {std::pair{Signal::kX, response.x}, {Signal::kF, response.f}}) {
      const Shift shift = ShiftOf(faulty, healthy, signal);
      if (expected.rms == 0.0) {
        EXPECT_EQ(shift.rms, 0.0);
      } else {
        EXPECT_NEAR(shift.mean, expected.mean, 0.15 * expected.rms);
        EXPECT_NEAR(shift.rms, expected.rms, 0.15 * expected.rms);
      }
    }
  }
  EXPECT_EQ(seen.size(), static_cast<std::size_t>(kFaultCount));
}

}  // namespace
}  // namespace fdi::simulator
