#include "diagnosis/decision/engine_plan.h"

#include <bit>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/decision/valve_engine.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::SharedPlant;

TEST(EnginePlansTest, OneModelSetHasOnePlanWhileItIsUsed) {
  EnginePlans plans;
  const auto first = SharedPlant();
  const auto second = SharedPlant();
  std::optional<EngineParts> parts = plans.For(first);
  EXPECT_EQ(plans.For(first).plan, parts->plan);
  EXPECT_EQ(plans.For(first).outputs, parts->outputs);
  EXPECT_NE(plans.For(second).plan, parts->plan);
  EXPECT_EQ(&parts->plan->models(), first.get());
  const std::weak_ptr<const EnginePlan> watch = parts->plan;
  parts.reset();
  EXPECT_TRUE(watch.expired());
  EXPECT_EQ(&plans.For(first).plan->models(), first.get());
}

TEST(EnginePlansTest, UnusableModelSetIsRefused) {
  EnginePlans plans;
  ModelSet models = tests::LinearPlant();
  models.observers.clear();
  EXPECT_THROW(plans.For(std::make_shared<const ModelSet>(models)), DataError);
  EXPECT_THROW(plans.For(nullptr), std::invalid_argument);
}

// Valve v at time k: every third has a fault, every fourth misses samples,
// every fifth has no flow.
Sample ValveSample(std::size_t v, std::uint64_t k) {
  Sample sample = tests::PlantSample(k, 10.0 + static_cast<double>(v % 7));
  if (v % 3 == 1 && k > 40) {
    tests::AddF6(sample, 0.7);
  }
  if (v % 5 == 4) {
    sample.present =
        static_cast<SignalMask>(sample.present & ~MaskOf(Signal::kF));
  }
  return sample;
}

std::uint64_t Bits(double value) {
  return std::bit_cast<std::uint64_t>(value);
}

void ExpectSame(const Verdict& a, const Verdict& b) {
  EXPECT_EQ(a.quality, b.quality);
  EXPECT_EQ(a.state, b.state);
  EXPECT_EQ(a.isolated, b.isolated);
  EXPECT_EQ(a.transition_count, b.transition_count);
  EXPECT_EQ(Bits(a.normal_factor), Bits(b.normal_factor));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(Bits(a.fault_factors[i]), Bits(b.fault_factors[i]));
    EXPECT_EQ(Bits(a.strengths[i]), Bits(b.strengths[i]));
    EXPECT_EQ(Bits(a.residuals[i]), Bits(b.residuals[i]));
  }
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(Bits(a.observer_factors[i]), Bits(b.observer_factors[i]));
  }
}

class ManyValvesTest : public ::testing::TestWithParam<std::size_t> {};

TEST_P(ManyValvesTest, EnginesThatSharePartsHaveTheBitsOfThoseAlone) {
  const EngineParts parts(SharedPlant());
  std::vector<ValveEngine> together;
  std::vector<ValveEngine> alone;
  for (std::size_t v = 0; v < GetParam(); ++v) {
    together.emplace_back(parts);
    alone.emplace_back(SharedPlant());
  }
  bool isolated = false;
  for (std::uint64_t k = 0; k < 120; ++k) {
    for (std::size_t v = 0; v < GetParam(); ++v) {
      if (v % 4 == 3 && k % 50 == 49) {
        continue;
      }
      const Verdict& verdict = together[v].Step(ValveSample(v, k));
      isolated = isolated || verdict.isolated != 0;
      ExpectSame(verdict, alone[v].Step(ValveSample(v, k)));
    }
    ASSERT_FALSE(HasFailure()) << "sample " << k;
  }
  EXPECT_EQ(isolated, GetParam() > 1);
}

INSTANTIATE_TEST_SUITE_P(Counts, ManyValvesTest,
                         ::testing::Values(1, 3, 8, 1000));

}  // namespace
}  // namespace fdi
