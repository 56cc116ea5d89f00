// Actions of an operator on a valve, by the scenarios of campaigns/operation,
// judged by models of normal work.
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "diagnosis/model/quality_count.h"
#include "simulator/scenario/scenario_toml.h"
#include "trainer/evaluation.h"
#include "trainer/onboarding/onboarding.h"

namespace fdi {
namespace {

using simulator::Scenario;

trainer::TrainingRun Simulate(const std::string& name,
                              const std::string& fault = "",
                              double duration_s = 0.0) {
  Scenario scenario;
  simulator::ApplyScenarioFile(
      std::filesystem::path(FDI_OPERATION_SCENARIOS) / (name + ".toml"),
      scenario);
  if (!fault.empty()) {
    scenario.config.faults = {simulator::ParseFaultSchedule(fault)};
    scenario.config.seed += 100;
  }
  if (duration_s > 0.0) {
    scenario.config.duration_s = duration_s;
  }
  trainer::TrainingRun run;
  run.id = name + fault;
  run.flow_unit = FlowUnit::kTPerHour;
  simulator::ValveSimulation simulation(scenario.config);
  while (!simulation.finished()) {
    run.samples.push_back(simulation.Step());
  }
  return run;
}

struct Outcome {
  int episodes{0};
  QualityCount seconds;
};

std::uint64_t Total(const QualityCount& seconds) {
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < kQualityCount; ++i) {
    total += seconds[static_cast<Quality>(i)];
  }
  return total;
}

class OperationTest : public testing::Test {
 protected:
  // Onboarded on two hours of normal work, without any fault.
  static void SetUpTestSuite() {
    trainer::ValveType type;
    type.name = "lublin-actuator-3";
    type.parameters = simulator::ParameterSet(type.name);
    const trainer::FaultSynthesizer synthesize(type);
    trainer::TrainingOptions options = trainer::OnboardingPreset(kBasicSignals);
    options.name = "operation";
    models_ = std::make_shared<const ModelSet>(trainer::TrainDifferenceSet(
        {Simulate("normal")}, {{13, 0.25}, {19, 0.25}, {19, 0.5}},
        std::ref(synthesize), type.parameters.instruments.flow.high, options));
  }

  static Outcome Replay(const trainer::TrainingRun& run) {
    Outcome outcome;
    trainer::ScoreRun(
        models_, run, [&outcome](const Sample&, const Verdict& verdict) {
          outcome.seconds.Add(verdict.quality);
          for (const Transition& transition : verdict.Transitions()) {
            outcome.episodes += transition.kind == TransitionKind::kDetected;
          }
        });
    return outcome;
  }

  static std::shared_ptr<const ModelSet> models_;
};
std::shared_ptr<const ModelSet> OperationTest::models_;

TEST_F(OperationTest, AParkedValveIsNotJudged) {
  const Outcome outcome = Replay(Simulate("parked"));
  EXPECT_EQ(outcome.episodes, 0);
  EXPECT_EQ(outcome.seconds[Quality::kUncovered], 3600U);
}

TEST_F(OperationTest, AnHourInManualIsInhibitedAndTheRestJudged) {
  const Outcome outcome = Replay(Simulate("manual"));
  EXPECT_EQ(outcome.episodes, 0);
  EXPECT_EQ(outcome.seconds[Quality::kInhibited], 3600U);
  // The valve is left alone for 200 of the 1800.
  EXPECT_GT(outcome.seconds[Quality::kLive], 1530U);
}

TEST_F(OperationTest, AllTimeIsAccountedForAndNormalWorkIsJudged) {
  const std::map<std::string, std::pair<double, double>> live_hours = {
      {"start_up", {0.92, 1.05}},     // One of normal work, but for 200 s.
      {"shutdown", {0.95, 1.10}},     // One, and the beginning of the ramp.
      {"stroke_test", {0.90, 1.05}},  // One, and the steps within the range.
  };
  for (const auto& [name, hours] : live_hours) {
    SCOPED_TRACE(name);
    const trainer::TrainingRun run = Simulate(name);
    const Outcome outcome = Replay(run);
    const QualityCount& seconds = outcome.seconds;
    EXPECT_EQ(outcome.episodes, 0);
    EXPECT_EQ(Total(seconds), run.samples.size());
    const double live = static_cast<double>(seconds[Quality::kLive]) / 3600.0;
    EXPECT_GT(live, hours.first);
    EXPECT_LT(live, hours.second);
  }
}

TEST_F(OperationTest, AFaultIsSeenAgainAfterAnHourInManual) {
  const Outcome outcome =
      Replay(Simulate("manual", "f19:abrupt@4800:strength=0.5"));
  EXPECT_GE(outcome.episodes, 1);
}

}  // namespace
}  // namespace fdi
