#include <algorithm>
#include <limits>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "tests/trainer/sampled_function.h"
#include "trainer/cluster_antecedents.h"
#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {
namespace {

TEST(SelectRulesTest, ValidityDecidesAmongCountsThatValidateEquallyWell) {
  RuleSelectionOptions options;
  options.min_rules = 1;
  options.max_rules = 5;
  const RegressionData data = Sampled(250, Hills);
  const auto by_error =
      SelectRules(data, options, [](const std::vector<TsRule>& rules) {
        return rules.size() == 3 ? 1.0 : 2.0;
      });
  const auto by_validity = SelectRules(data, options);
  const auto equal = SelectRules(
      data, options, [](const std::vector<TsRule>&) { return 1.0; });

  EXPECT_EQ(by_error.rules.size(), 3U);
  ASSERT_EQ(by_error.tried.size(), 5U);
  const auto smallest =
      std::min_element(by_validity.tried.begin(), by_validity.tried.end(),
                       [](const RuleCount& a, const RuleCount& b) {
                         return a.validity < b.validity;
                       });
  EXPECT_EQ(static_cast<int>(by_validity.rules.size()), smallest->num_rules);
  EXPECT_EQ(equal.rules.size(), by_validity.rules.size());
}

TEST(SelectRulesTest, BothKindsOfAntecedentsAreTriedWithBothMethods) {
  RuleSelectionOptions options;
  options.counts = {3};
  options.both_methods = true;
  options.both_antecedents = true;
  const auto has_center = [](const std::vector<TsRule>& rules) {
    return rules.front().center.empty() ? 2.0 : 1.0;
  };
  const auto selection = SelectRules(Sampled(300, Hills), options, has_center);

  ASSERT_EQ(selection.tried.size(), 4U);
  EXPECT_EQ(selection.tried[1].method, ConsequentMethod::kGlobal);
  EXPECT_EQ(selection.tried[1].antecedents, AntecedentKind::kProjected);
  EXPECT_EQ(selection.tried[2].method, ConsequentMethod::kLocal);
  EXPECT_EQ(selection.tried[2].antecedents, AntecedentKind::kProductSpace);
  EXPECT_FALSE(selection.rules.front().center.empty());
}

// Rules that are told apart by the first column alone. Only the consequents
// depend on the second, so that its clusters serve again; other targets have
// others.
TEST(SelectRulesTest, KnownClustersServeWhereTheyAreTheSame) {
  RuleSelectionOptions options;
  options.counts = {3};
  options.fit.antecedents = {0};
  const RegressionData data = Sampled(250, Hills);
  RegressionData other_column = data;
  other_column.x.col(1) = data.x.col(1).reverse();
  RegressionData other_targets = data;
  other_targets.y = data.y.cwiseAbs2();
  KnownClusters known;
  for (const RegressionData& rows : {data, other_column, other_targets, data}) {
    const auto fresh = SelectRules(rows, options).rules;
    RuleSelectionOptions shared = options;
    shared.known = &known;
    EXPECT_EQ(Predict(SelectRules(rows, shared).rules, rows.x),
              Predict(fresh, rows.x));
  }
  TakagiSugenoOptions three = options.fit;
  three.num_rules = 3;
  const double* place = known.Of(data, three).z.data();
  EXPECT_EQ(known.Of(other_column, three).z.data(), place);
  EXPECT_NE(known.Of(other_targets, three).z.data(), place);
}

TEST(SelectRulesTest, CountsWithoutEnoughRowsAreLeftOut) {
  RuleSelectionOptions options;
  options.counts = {2, 4, 8, 16};
  const auto selection = SelectRules(Sampled(25, Hills), options);
  EXPECT_EQ(selection.tried.size(), 3U);
  EXPECT_THROW(SelectRules(Sampled(5, Hills), options), std::invalid_argument);
}

TEST(SelectRulesTest, UnusableCountsArePassedOver) {
  RuleSelectionOptions options;
  options.max_rules = 4;
  const RegressionData data = Sampled(300, Hills);
  const auto selection =
      SelectRules(data, options, [](const std::vector<TsRule>& rules) {
        return rules.size() == 3 ? 0.5
                                 : std::numeric_limits<double>::quiet_NaN();
      });
  EXPECT_EQ(selection.rules.size(), 3U);

  EXPECT_THROW(SelectRules(data, options,
                           [](const std::vector<TsRule>&) {
                             return std::numeric_limits<double>::infinity();
                           }),
               std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
