#include "simulator/robust_least_squares.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "simulator/random.h"
#include "simulator/valve_equations.h"
#include "simulator/valve_identification.h"

namespace fdi::simulator {
namespace {

// y = 2 exp(0.5 t) with noise 0.1 and each tenth row off by 5; a third entry
// that nothing depends on.
RobustFit FitExponential(const Eigen::Vector3d& start, int iterations,
                         double damping, const PointBounds& bounds) {
  constexpr Eigen::Index kRows = 400;
  NormalSource noise(1, 1);
  Eigen::VectorXd y(kRows);
  for (Eigen::Index k = 0; k < kRows; ++k) {
    const double t = 0.005 * static_cast<double>(k);
    y[k] = 2.0 * std::exp(0.5 * t) + 0.1 * noise() + (k % 10 == 0 ? 5.0 : 0.0);
  }
  const auto residuals = [&](const std::vector<Eigen::VectorXd>& points) {
    std::vector<Eigen::MatrixXd> result;
    for (const Eigen::VectorXd& p : points) {
      Eigen::MatrixXd r(kRows, 1);
      for (Eigen::Index k = 0; k < kRows; ++k) {
        r(k, 0) = p[0] * std::exp(p[1] * 0.005 * static_cast<double>(k)) - y[k];
      }
      result.push_back(r);
    }
    return result;
  };
  RobustFitOptions options;
  options.max_iterations = iterations;
  options.least_scale = Eigen::VectorXd::Constant(1, 0.01);
  options.damping = damping;
  return FitRobustly(residuals, start, bounds, options);
}

const PointBounds kExponentialBounds{
    Eigen::Vector3d(0.1, -1.0, -1.0), Eigen::Vector3d(9.0, 2.0, 1.0),
    Eigen::Vector3d(1.0, 0.0, 0.3), Eigen::Vector3d(5.0, 5.0, 0.5)};

TEST(RobustLeastSquaresTest, ResistsOutliersAndKnowsWhatItCannotTell) {
  const PointBounds& bounds = kExponentialBounds;
  const RobustFit fit =
      FitExponential(Eigen::Vector3d(1.0, 0.0, 0.3), 20, 1e-2, bounds);
  EXPECT_TRUE(fit.settled);
  EXPECT_NEAR(fit.point[0], 2.0, 0.04);
  EXPECT_NEAR(fit.point[1], 0.5, 0.02);
  EXPECT_NEAR(fit.point[2], 0.3, 1e-9);
  EXPECT_NEAR(fit.scale[0], 0.1, 0.02);
  const Eigen::VectorXd sd = StandardDeviations(fit, bounds, {0, 1, 2});
  EXPECT_LT(sd[0], 0.03);
  EXPECT_LT(sd[1], 0.02);
  EXPECT_NEAR(sd[2], 0.5, 1e-6);
}

// Bit for bit, so that a fit may be looked at before it goes on.
TEST(RobustLeastSquaresTest, GoesOnWhereItEnded) {
  const Eigen::Vector3d start(1.0, 0.0, 0.3);
  const RobustFit whole = FitExponential(start, 4, 1e-2, kExponentialBounds);
  const RobustFit first = FitExponential(start, 1, 1e-2, kExponentialBounds);
  ASSERT_FALSE(first.settled);
  ASSERT_NE(first.point, whole.point);
  const RobustFit second =
      FitExponential(first.point, 3, first.damping, kExponentialBounds);
  EXPECT_EQ(second.point, whole.point);
  EXPECT_EQ(second.damping, whole.damping);
  EXPECT_EQ(second.residuals, whole.residuals);
}

// F is that of a valve 3 times as large.
TEST(ValveUnknownsTest, TheSizeIsThatOfTheRecord) {
  const ValveParameters valve = ParameterSet("lublin-actuator-3");
  HealthyRecord record;
  for (int k = 0; k < 40; ++k) {
    RecordRow row{{50.0, 3500.0, 2600.0, 43.0}, 50.0 + 0.5 * k, 0.0};
    row.flow = 3.0 * FlowReading(valve, {}, row.input, row.x_pct);
    record.rows.push_back(row);
  }
  EXPECT_NEAR(SizeOf({record}, valve), 3.0, 1e-12);
  const ValveParameters large = Resized(valve, 3.0, 71.0);
  EXPECT_DOUBLE_EQ(large.trim.kv_m3_h, 3.0 * valve.trim.kv_m3_h);
  EXPECT_DOUBLE_EQ(large.trim.bypass_kv_m3_h, 3.0 * valve.trim.bypass_kv_m3_h);
  EXPECT_DOUBLE_EQ(large.instruments.flow.high, 120.0);
  // A record beyond the range, and one that hardly uses it, set the range.
  EXPECT_DOUBLE_EQ(Resized(valve, 1.0, 48.0).instruments.flow.high, 60.0);
  EXPECT_DOUBLE_EQ(Resized(valve, 1.0, 2.0).instruments.flow.high, 2.5);
  record.rows.resize(20);
  EXPECT_EQ(SizeOf({record}, valve), 1.0);
}

TEST(ValveUnknownsTest, TheTrimFollowsFromPositionAndFlowAlone) {
  ValveParameters truth = ParameterSet("lublin-actuator-3");
  truth.trim.kv_m3_h = 80.0;
  truth.trim.exponent = 4.2;
  HealthyRecord record;
  for (int k = 0; k < 40; ++k) {
    const InputRow input{0.0, 3500.0 + k, 2600.0, 100.7};
    const double x_pct = 55.0 + 0.5 * k;
    const MediumState medium = MediumAt({}, 1e3 * input.p1_kpa, 2.6e6, 100.7);
    const double flow =
        Flow(80.0, Opening(truth.trim, 0.01 * x_pct),
             EffectivePressureDrop(
                 medium, RecoveryCoefficient(truth.trim, 0.01 * x_pct), 0.72),
             medium.density_kg_m3);
    record.rows.push_back({input, x_pct, 1e-3 * flow * LiquidDensity(100.7)});
  }
  const Trim trim = RegressTrim({record}, ParameterSet("lublin-actuator-3"));
  EXPECT_NEAR(trim.kv_m3_h, 80.0, 0.01);
  EXPECT_NEAR(trim.exponent, 4.2, 1e-4);
  // Filled-in readings of X or F do not count.
  for (int k = 0; k < 40; ++k) {
    record.rows.push_back(record.rows[static_cast<std::size_t>(k)]);
    RecordRow& row = record.rows.back();
    (k % 2 == 0 ? row.x_pct : row.flow) *= 1.1;
    (k % 2 == 0 ? row.x_measured : row.flow_measured) = false;
  }
  EXPECT_EQ(RegressTrim({record}, ParameterSet("lublin-actuator-3")).kv_m3_h,
            trim.kv_m3_h);
  record.rows.resize(10);
  EXPECT_EQ(RegressTrim({record}, truth).kv_m3_h, 80.0);
}

}  // namespace
}  // namespace fdi::simulator
