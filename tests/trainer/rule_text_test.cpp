#include "trainer/rule_text.h"

#include <limits>

#include <gtest/gtest.h>

namespace fdi::trainer {
namespace {

constexpr double kShoulder = std::numeric_limits<double>::infinity();

// Half of the membership is reached sqrt(2 ln 2) w = 1.1774 w beyond the core.
TEST(RuleTextTest, RangesAreWhereTheMembershipIsAtLeastOneHalf) {
  TsModel model;
  model.output = Signal::kF;
  model.regressors = {{Signal::kCv, 1}, {Signal::kP1, 0}};
  model.regressor_min = {60.0, 3400.0};
  model.regressor_max = {80.0, 3600.0};
  model.rules = {
      {{{62.0, 64.0, kShoulder, 1.0}, {3500.0, 3500.0, 500.0, 500.0}},
       {-0.5, 0.012345},
       -3.0,
       0.25},
      {{{75.0, 80.0, 2.0, kShoulder}, {3520.0, 3540.0, 10.0, 10.0}},
       {0.0, 0.1},
       2.0,
       0.75}};

  EXPECT_EQ(RulesText(model, FlowUnit::kTPerHour),
            "  if CV(k-1) is low [60.0..65.2 %]\n"
            "    then F(k) = -0.5 CV(k-1) + 0.01235 P1(k) - 3 t/h   (25 % of "
            "the data)\n"
            "  if CV(k-1) is high [72.6..80.0 %] and P1(k) is medium "
            "[3508..3552 kPa]\n"
            "    then F(k) = 0.1 P1(k) + 2 t/h   (75 % of the data)\n");
}

// The second regressor is none of the antecedents.
TEST(RuleTextTest, ARuleWithACenterIsNearIt) {
  constexpr FuzzySet kAny{0.0, 0.0, kShoulder, kShoulder};
  TsModel model;
  model.output = Signal::kF;
  model.regressors = {{Signal::kCv, 0}, {Signal::kT1, 0}, {Signal::kP1, 2}};
  model.regressor_min = {20.0, 90.0, 3400.0};
  model.regressor_max = {80.0, 110.0, 3600.0};
  TsRule& rule = model.rules.emplace_back();
  rule.antecedents = {kAny, kAny, kAny};
  rule.slopes = {0.5, 0.0, 0.0};
  rule.intercept = 1.0;
  rule.data_share = 0.5;
  rule.center = {50.0, 0.0, 3500.0};
  rule.metric = {0.1, 0.0, 0.0, -0.2, 0.0, 0.01};

  EXPECT_EQ(RulesText(model, FlowUnit::kTPerHour),
            "  if near (CV(k) 50 %, P1(k-2) 3500 kPa)\n"
            "    then F(k) = 0.5 CV(k) + 1 t/h   (50 % of the data)\n");
}

}  // namespace
}  // namespace fdi::trainer
