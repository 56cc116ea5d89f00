#include "bench/study/baseline.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>

#include "base/error.h"

namespace fdi::trainer::study {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// Readings of the sensors of a linear plant.
struct Sensors {
  double flow_factor{1.0};
  double position_offset{0.0};
};

// X lags CV by one sample, F = 50 − 0.3 X + 0.01 (P1 − P2), all with noise.
Stretch Plant(int samples, unsigned seed, const Sensors& sensors = {}) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise;
  Stretch stretch;
  double x = 60.0;
  for (int k = 0; k < samples; ++k) {
    Sample sample;
    sample.stamp_ns = k * 1'000'000'000LL;
    sample.Set(Signal::kCv, 60.0 + 10.0 * std::sin(0.05 * k) + noise(engine));
    sample.Set(Signal::kP1, 3500.0 + 10.0 * noise(engine));
    sample.Set(Signal::kP2, 2600.0 + 10.0 * noise(engine));
    sample.Set(Signal::kT1, 105.0);
    sample.Set(Signal::kX, x + sensors.position_offset + 0.1 * noise(engine));
    const double flow = 50.0 - 0.3 * x +
                        0.01 * (sample[Signal::kP1] - sample[Signal::kP2]) +
                        0.1 * noise(engine);
    sample.Set(Signal::kF, sensors.flow_factor * flow);
    x = 0.5 * x + 0.5 * sample[Signal::kCv];
    stretch.samples.push_back(sample);
  }
  return stretch;
}

constexpr Sensors kWeakFlow{0.9, 0.0};
constexpr Sensors kHighPosition{1.0, 3.0};

std::vector<Condition> Conditions() {
  return {{0, 0.0, {Plant(4000, 1)}, {Plant(1500, 2)}},
          {13, 0.5, {Plant(600, 3, kHighPosition)}, {}},
          {19, 0.5, {Plant(600, 4, kWeakFlow)}, {}}};
}

TEST(LinearModelTest, RecoversThePlant) {
  const Stretch normal = Plant(4000, 1);
  const LinearModel model = FitLinear(
      "F", Signal::kF,
      {{Signal::kX, 0}, {Signal::kP1, 0}, {Signal::kP2, 0}, {Signal::kT1, 0}},
      {&normal, 1});
  EXPECT_NEAR(model.slopes[0], -0.3, 0.002);
  EXPECT_NEAR(model.slopes[1], 0.01, 0.0005);
  EXPECT_NEAR(model.slopes[2], -0.01, 0.0005);
  EXPECT_EQ(model.slopes[3], 0.0);  // It never moved.
  EXPECT_NEAR(model.residual_sd, std::hypot(0.1, 0.3 * 0.1), 0.005);
}

TEST(LinearModelTest, ArxTakesTheOrderThatPredictsBest) {
  const Stretch normal = Plant(4000, 1);
  const Stretch other = Plant(1500, 2);
  const LinearModel model =
      FitArx("X", Signal::kX, {Signal::kCv}, {&normal, 1}, {&other, 1});
  EXPECT_LT(model.residual_sd, 0.14);
  LinearPredictor predictor(model);
  EXPECT_FALSE(predictor.Step(other.samples[0]));
  Sample blind = other.samples[1];
  blind.Set(Signal::kX, std::nan(""));
  for (int k = 0; k < 8; ++k) {
    EXPECT_FALSE(predictor.Step(blind));
  }
}

TEST(LinearModelTest, TooLittleDataIsNamed) {
  const Stretch brief = Plant(15, 1);
  try {
    FitLinear("F(CV)", Signal::kF, {{Signal::kCv, 0}, {Signal::kCv, 1}},
              {&brief, 1});
    FAIL();
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("F(CV)"));
  }
}

TEST(CusumTest, SumsWhatIsBeyondTheDriftInBothDirections) {
  Cusum test(5.0);
  for (int k = 0; k < 5; ++k) {
    EXPECT_EQ(test.Step(1.5), 0);
  }
  EXPECT_EQ(test.Step(1.5), 1);  // 6 > 5
  for (int k = 0; k < 1000; ++k) {
    test.Step(1.5);
  }
  int samples = 0;
  while (test.Step(0.0) != 0) {
    ++samples;
  }
  EXPECT_EQ(samples, 9);  // From the cap, 10, to the limit by 0.5 each.
  for (int k = 0; k < 20; ++k) {
    test.Step(-1.5);
  }
  EXPECT_EQ(test.Step(-1.5), -1);
}

TEST(CusumTest, LimitIsKeptByOtherDataOfItsKind) {
  std::mt19937 engine(1);
  std::normal_distribution<double> noise;
  std::vector<std::vector<double>> series(1, std::vector<double>(40000));
  for (double& z : series[0]) {
    z = noise(engine);
  }
  const double limit = CusumLimit(series, 1e-6);
  EXPECT_GT(limit, 5.0);
  EXPECT_LT(limit, 25.0);
  Cusum test(limit);
  int alarms = 0;
  for (int k = 0; k < 40000; ++k) {
    alarms += test.Step(noise(engine)) != 0;
  }
  EXPECT_EQ(alarms, 0);
  EXPECT_THROW(CusumLimit({{1.0, 2.0}}, 1e-6), DataError);
}

TEST(BaselineTest, ArxCusumDetectsAndNamesNothing) {
  const Baseline arx = FitBaseline("arx-cusum", Conditions(), 1.0, {});
  BaselineDetector detector(arx);
  for (const Sample& sample : Plant(900, 7).samples) {
    EXPECT_FALSE(detector.Step(sample).detected);
  }
  Indication last;
  for (const Sample& sample : Plant(300, 8, kWeakFlow).samples) {
    last = detector.Step(sample);
  }
  EXPECT_TRUE(last.detected);
  EXPECT_TRUE(last.isolated.empty());
}

TEST(BaselineTest, SignatureTableNamesTheFaultsThatShareTheSigns) {
  const Baseline table = FitBaseline("signature-table", Conditions(), 1.0, {});
  EXPECT_THAT(table.table.at({0, -1, -1}), ElementsAre(19));
  EXPECT_THAT(table.table.at({1, 1, 0}), ElementsAre(13));
  BaselineDetector detector(table);
  int first = -1;
  Indication last;
  const Stretch faulty = Plant(300, 8, kWeakFlow);
  for (int k = 0; k < 300; ++k) {
    last = detector.Step(faulty.samples[static_cast<std::size_t>(k)]);
    EXPECT_EQ(last.settled, k >= 30);
    first = first < 0 && last.detected ? k : first;
  }
  EXPECT_GE(first, 30);
  EXPECT_THAT(last.isolated, ElementsAre(19));

  int quiet = 0;
  for (const Sample& sample : Plant(300, 9).samples) {
    quiet += detector.Step(sample).detected ? 0 : 1;
  }
  EXPECT_GT(quiet, 100);  // Clears itself.
}

TEST(BaselineTest, FaultsOfEqualSignsShareARow) {
  std::vector<Condition> conditions = Conditions();
  conditions.push_back({5, 1.0, {Plant(600, 5, {0.95, 0.0})}, {}});
  conditions.push_back({14, 1.0, {Plant(600, 6)}, {}});  // Shows nowhere.
  const Baseline table = FitBaseline("signature-table", conditions, 1.0, {});
  EXPECT_THAT(table.table.at({0, -1, -1}), ElementsAre(5, 19));
  EXPECT_EQ(table.table.size(), 2U);
  EXPECT_THROW(FitBaseline("pca", conditions, 1.0, {}), ConfigError);
}

}  // namespace
}  // namespace fdi::trainer::study
