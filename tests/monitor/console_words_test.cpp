#include <limits>

#include "diagnosis/fault_catalogue.h"
#include "monitor/console/model_facts.h"
#include "tests/monitor/console_fixture.h"

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
