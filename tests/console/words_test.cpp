#include <cmath>
#include <limits>
#include <vector>

#include "console/model_facts.h"
#include "diagnosis/model/fault_catalogue.h"
#include "tests/console/board_fixture.h"

namespace fdi::console {
namespace {

std::string Describe(std::string_view fault) {
  return std::string(FaultFactsOf(*ParseFault(fault)).description);
}

ModelFacts TwoChannels() {
  ModelFacts models;
  models.channels = {{"X", Signal::kX, "%", -2.0, 2.0},
                     {"F", Signal::kF, "m3/h", -3.0, 4.0}};
  models.faults = {"f1", "f3", "f19"};
  models.isolation_threshold = 0.7;
  return models;
}

TracePoint Abnormal(std::vector<double> residuals,
                    std::vector<double> factors) {
  TracePoint point;
  point.state = State::kDetected;
  point.residuals = std::move(residuals);
  point.factors = std::move(factors);
  return point;
}

TEST(ConsoleWordsTest, TheFarthestChannelAndTheFaultsThatFitBestFirst) {
  // Beyond its threshold by 1.5 (X) and by 3 (F); T/2 = 0.35.
  EXPECT_EQ(Explain(TwoChannels(), Abnormal({-3.0, 12.0}, {0.34, 0.36, 0.9}),
                    Describe),
            "flow 12 m3/h above what the normal model expects; fits: flow "
            "sensor fault, plug or seat erosion");
  EXPECT_EQ(Explain(TwoChannels(), Abnormal({-3.04, 0.0}, {0.35, 0.0, 0.0}),
                    Describe),
            "rod position 3 % below what the normal model expects; fits: valve "
            "clogging");
}

TEST(ConsoleWordsTest, NothingBeyondItsThresholdIsSaidSo) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  TracePoint point = Abnormal({kNone, 3.9}, {0.0, 0.0, 0.0});
  EXPECT_EQ(Explain(TwoChannels(), point, Describe),
            "no reading beyond its threshold now; no known fault fits");
  point.state = State::kNormal;
  EXPECT_EQ(Explain(TwoChannels(), point, Describe),
            "as the normal model expects");
}

// A shift of 1 m3/h is within the thresholds, but not on the mean.
TEST(ConsoleWordsTest, AWindowThatRaisesAnAlarmIsToldWithItsLimits) {
  ModelFacts models = TwoChannels();
  models.channels[1].windows = {{30, -0.5, 0.5, 10.0}, {500, -0.1, 0.1, 10.0}};
  std::vector<TracePoint> points(60, Abnormal({0.0, -1.0}, {0.0, 0.0, 0.0}));
  points.push_back(Abnormal({}, {}));  // Not judged.

  const std::vector<WindowBeyond> beyond = WindowsBeyond(models, points);
  ASSERT_EQ(beyond.size(), 1U);  // The longer one is not full.
  EXPECT_EQ(beyond[0].channel, 1U);
  EXPECT_EQ(beyond[0].length, 30);
  EXPECT_FALSE(beyond[0].deviation);
  EXPECT_NEAR(beyond[0].value, -1.0, 1e-9);
  EXPECT_EQ(beyond[0].low, -0.5);

  models.channels[1].windows = {{30, -5.0, 5.0, std::log(0.2)}};
  for (std::size_t k = 0; k < points.size(); k += 2) {
    points[k].residuals = {0.0, 1.0};
  }
  ASSERT_EQ(WindowsBeyond(models, points).size(), 1U);
  EXPECT_TRUE(WindowsBeyond(models, points)[0].deviation);
  EXPECT_NEAR(WindowsBeyond(models, points)[0].high, 0.2, 1e-9);
}

TEST(ConsoleWordsTest, WhileAValveIsNormalNoFaultFits) {
  TracePoint point = Abnormal({0.0, 12.0}, {1.0, 1.0, 1.0});
  point.state = State::kNormal;
  EXPECT_EQ(Explain(TwoChannels(), point, Describe),
            "flow 12 m3/h above what the normal model expects");
}

TEST(ConsoleWordsTest, TwoDigitsCount) {
  EXPECT_EQ(TwoDigits(12.34), "12");
  EXPECT_EQ(TwoDigits(1234.4), "1234");
  EXPECT_EQ(TwoDigits(1.26), "1.3");
  EXPECT_EQ(TwoDigits(0.01234), "0.012");
}

}  // namespace
}  // namespace fdi::console
