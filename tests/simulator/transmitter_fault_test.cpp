// Faults of the transmitters of T1, P1 and P2: the reading moves, the process
// does not.

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

constexpr std::size_t kOnset = 50;

std::vector<LabelledSample> RunWith(const std::string& fault) {
  ValveSimulationConfig config;
  config.excitation = LevelLoopExcitation{};
  config.duration_s = 200.0;
  if (!fault.empty()) {
    config.faults = {ParseFaultSchedule(fault)};
  }
  ValveSimulation simulation(config);
  std::vector<LabelledSample> samples;
  while (!simulation.finished()) {
    samples.push_back(simulation.Step());
  }
  return samples;
}

struct Case {
  std::string name;
  Signal signal;
  double span;
  double digit;  // The converter's.
};
const std::vector<Case> kCases{{"t1", Signal::kT1, 200.0, 200.0 / 65535.0},
                               {"p1", Signal::kP1, 4000.0, 4000.0 / 65535.0},
                               {"p2", Signal::kP2, 4000.0, 4000.0 / 65535.0}};

// All signals but `spared` to the bit.
void ExpectProcessUnchanged(const std::vector<LabelledSample>& healthy,
                            const std::vector<LabelledSample>& faulty,
                            Signal spared) {
  for (std::size_t k = 0; k < healthy.size(); ++k) {
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      if (i != Index(spared) || k < kOnset) {
        ASSERT_EQ(healthy[k].sample.values[i], faulty[k].sample.values[i])
            << SignalName(static_cast<Signal>(i)) << " at " << k;
      }
    }
  }
}

TEST(TransmitterFaultTest, AStepMovesTheReadingByStrengthTimesSpan) {
  const auto healthy = RunWith("");
  for (const Case& c : kCases) {
    for (const double strength : {0.05, -0.05}) {
      SCOPED_TRACE(c.name + " " + std::to_string(strength));
      const auto faulty =
          RunWith(c.name + ":abrupt@50:strength=" + std::to_string(strength));
      ExpectProcessUnchanged(healthy, faulty, c.signal);
      for (std::size_t k = kOnset; k < healthy.size(); ++k) {
        ASSERT_NEAR(faulty[k].sample[c.signal] - healthy[k].sample[c.signal],
                    strength * c.span, 1.01 * c.digit);
      }
      EXPECT_EQ(faulty[kOnset].truth->fault, *ParseFault(c.name));
      EXPECT_EQ(faulty[kOnset].truth->strength, strength);
    }
  }
}

TEST(TransmitterFaultTest, FullStrengthIsTheLimitOfTheRange) {
  for (const Case& c : kCases) {
    for (const auto& sample : {RunWith(c.name + ":abrupt@50").back(),
                               RunWith(c.name + ":incipient@50+60").back()}) {
      EXPECT_EQ(sample.sample[c.signal], c.span) << c.name;
    }
    const auto low = RunWith(c.name + ":abrupt@50:strength=-1");
    EXPECT_EQ(low.back().sample[c.signal], 0.0) << c.name;
  }
}

TEST(TransmitterFaultTest, AFlatlineRepeatsTheReadingUntilItsEnd) {
  const auto healthy = RunWith("");
  for (const Case& c : kCases) {
    SCOPED_TRACE(c.name);
    const auto faulty = RunWith(c.name + ":flatline@50:until=150");
    ExpectProcessUnchanged(healthy, faulty, c.signal);
    for (std::size_t k = kOnset; k < healthy.size(); ++k) {
      const std::size_t source = k < 150 ? kOnset : k;
      ASSERT_EQ(faulty[k].sample[c.signal], healthy[source].sample[c.signal]);
      ASSERT_EQ(faulty[k].truth->fault, k < 150 ? *ParseFault(c.name) : 0);
    }
  }
}

// Between samples, the first reading after the start is the one that stays.
TEST(TransmitterFaultTest, AFlatlineBetweenSamplesStartsWithTheNextReading) {
  const auto healthy = RunWith("");
  const auto faulty = RunWith("p1:flatline@49.5");
  EXPECT_EQ(faulty[49].sample[Signal::kP1], healthy[49].sample[Signal::kP1]);
  EXPECT_EQ(faulty[199].sample[Signal::kP1], healthy[50].sample[Signal::kP1]);
}

}  // namespace
}  // namespace fdi::simulator
