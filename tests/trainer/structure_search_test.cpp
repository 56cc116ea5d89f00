#include <algorithm>
#include <limits>
#include <map>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "trainer/channel_training.h"

namespace fdi::trainer {
namespace {

using testing::ElementsAre;

// Each candidate takes a fixed share off an error of 1.
StructureCriterion Additive(std::map<int, double> gains) {
  return [gains = std::move(gains)](const std::vector<int>& indices) {
    double error = 1.0;
    for (const int index : indices) {
      const auto gain = gains.find(index);
      error -= gain == gains.end() ? 0.0 : gain->second;
    }
    return error;
  };
}

TEST(StructureSearchTest, AddsTheMostHelpfulFirstAndStopsAtTheTolerance) {
  const auto result =
      SearchStructure(6, Additive({{4, 0.5}, {1, 0.3}, {2, 0.001}}));

  EXPECT_THAT(result.selected, ElementsAre(1, 4));
  ASSERT_EQ(result.steps.size(), 2U);
  EXPECT_EQ(result.steps[0].candidate, 4);
  EXPECT_DOUBLE_EQ(result.steps[0].error, 0.5);
  EXPECT_EQ(result.steps[1].candidate, 1);
  EXPECT_DOUBLE_EQ(result.error, 0.2);
  EXPECT_EQ(result.evaluations, 6 + 5 + 4);
}

TEST(StructureSearchTest, ASmallerToleranceAddsMore) {
  StructureSearchOptions options;
  options.relative_improvement = 1e-4;
  const auto result =
      SearchStructure(6, Additive({{4, 0.5}, {1, 0.3}, {2, 0.001}}), options);

  EXPECT_THAT(result.selected, ElementsAre(1, 2, 4));
}

TEST(StructureSearchTest, StopsAtTheLargestNumberOfRegressors) {
  StructureSearchOptions options;
  options.max_regressors = 2;
  const auto result = SearchStructure(
      4, Additive({{0, .2}, {1, .2}, {2, .2}, {3, .2}}), options);

  EXPECT_THAT(result.selected, ElementsAre(0, 1));
}

TEST(StructureSearchTest, TheCriterionSeesAscendingIndicesWithoutRepeats) {
  SearchStructure(5, [](const std::vector<int>& indices) {
    EXPECT_FALSE(indices.empty());
    EXPECT_TRUE(std::is_sorted(indices.begin(), indices.end()));
    EXPECT_EQ(std::adjacent_find(indices.begin(), indices.end()),
              indices.end());
    return 1.0 / (1.0 + static_cast<double>(indices.size()));
  });
}

// An unstable parallel run is not a reason to give up on the others.
TEST(StructureSearchTest, UnusableCandidatesArePassedOver) {
  const auto result = SearchStructure(3, [](const std::vector<int>& indices) {
    return indices.front() == 0 ? std::numeric_limits<double>::quiet_NaN()
                                : 1.0 / static_cast<double>(indices.back());
  });

  EXPECT_THAT(result.selected, ElementsAre(2));
}

TEST(StructureSearchTest, RefusesWhatCannotBeSearched) {
  const StructureCriterion unusable = [](const std::vector<int>&) {
    return std::numeric_limits<double>::infinity();
  };
  EXPECT_THROW(SearchStructure(3, unusable), std::invalid_argument);
  EXPECT_THROW(SearchStructure(0, Additive({})), std::invalid_argument);
  StructureSearchOptions options;
  options.max_regressors = 0;
  EXPECT_THROW(SearchStructure(3, Additive({}), options),
               std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
