#include "diagnosis/engine_plan.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "diagnosis/error.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using testing::SharedPlant;

TEST(EnginePlansTest, OneModelSetHasOnePlanWhileItIsUsed) {
  EnginePlans plans;
  const auto first = SharedPlant();
  const auto second = SharedPlant();
  auto plan = plans.For(first);
  EXPECT_EQ(plans.For(first), plan);
  EXPECT_NE(plans.For(second), plan);
  EXPECT_EQ(&plan->models(), first.get());
  const std::weak_ptr<const EnginePlan> watch = plan;
  plan.reset();
  EXPECT_TRUE(watch.expired());
  EXPECT_EQ(&plans.For(first)->models(), first.get());
}

TEST(EnginePlansTest, UnusableModelSetIsRefused) {
  EnginePlans plans;
  ModelSet models = testing::LinearPlant();
  models.observers.clear();
  EXPECT_THROW(plans.For(std::make_shared<const ModelSet>(models)), DataError);
  EXPECT_THROW(plans.For(nullptr), std::invalid_argument);
}

}  // namespace
}  // namespace fdi
