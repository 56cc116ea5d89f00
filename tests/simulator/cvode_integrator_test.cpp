#include "simulator/cvode_integrator.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace fdi::simulator {
namespace {

// Prothero-Robinson: x' = -L (x - cos t) - sin t with the solution cos t,
// however stiff L is; the root of x lies at pi/2.
class ProtheroRobinson final : public OdeSystem {
 public:
  void Derivatives(double t, const double* x,
                   double* dx) const noexcept override {
    dx[0] = -1e4 * (x[0] - std::cos(t)) - std::sin(t);
  }
  void Roots(double, const double* x, double* g) const noexcept override {
    g[0] = x[0];
  }
};

CvodeOptions OneState() {
  CvodeOptions options;
  options.absolute_tolerances = {1e-9};
  options.root_count = 1;
  return options;
}

TEST(CvodeIntegratorTest, FollowsAStiffSolutionInFewSteps) {
  const ProtheroRobinson system;
  CvodeIntegrator integrator(system, OneState());
  integrator.state()[0] = 1.0;
  integrator.Restart(0.0);

  while (integrator.StepTowards(1.5) != StepResult::kStopTime) {
  }

  EXPECT_EQ(integrator.time(), 1.5);
  EXPECT_NEAR(integrator.state()[0], std::cos(1.5), 1e-5);
  EXPECT_LT(integrator.step_count(), 500);
}

TEST(CvodeIntegratorTest, StopsAtARoot) {
  const ProtheroRobinson system;
  CvodeIntegrator integrator(system, OneState());
  integrator.state()[0] = 1.0;
  integrator.Restart(0.0);

  StepResult result = StepResult::kStep;
  while (result == StepResult::kStep) {
    result = integrator.StepTowards(3.0);
  }

  EXPECT_EQ(result, StepResult::kRoot);
  EXPECT_NEAR(integrator.time(), std::numbers::pi / 2.0, 1e-5);
}

class Escape final : public OdeSystem {
 public:
  void Derivatives(double, const double* x,
                   double* dx) const noexcept override {
    dx[0] = x[0] * x[0];
  }
  void Roots(double, const double*, double* g) const noexcept override {
    g[0] = 1.0;
  }
};

// x' = x^2 from 1 reaches infinity at t = 1.
TEST(CvodeIntegratorTest, FailureIsThrownWithItsCode) {
  const Escape system;
  CvodeIntegrator integrator(system, OneState());
  integrator.state()[0] = 1.0;
  integrator.Restart(0.0);
  try {
    for (int i = 0; i < 100000; ++i) {
      integrator.StepTowards(2.0);
    }
    FAIL() << "passed the pole at t = " << integrator.time();
  } catch (const CvodeError& error) {
    EXPECT_LT(error.code(), 0);
    EXPECT_NE(std::string(error.what()).find("CVode"), std::string::npos);
  }
}

}  // namespace
}  // namespace fdi::simulator
