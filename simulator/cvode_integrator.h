#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace fdi::simulator {

/// A failed CVODE call: what() names the operation, code() is its return value.
class CvodeError : public std::runtime_error {
 public:
  CvodeError(const std::string& operation, int code);
  int code() const { return code_; }

 private:
  int code_;
};

/// A system of ordinary differential equations dx/dt = f(t, x) with events at
/// the zeros of g(t, x). Called from C: must not throw.
class OdeSystem {
 public:
  virtual ~OdeSystem() = default;
  virtual void Derivatives(double t, const double* x,
                           double* dx) const noexcept = 0;
  virtual void Roots(double t, const double* x, double* g) const noexcept = 0;
};

struct CvodeOptions {
  double relative_tolerance{1e-6};
  std::vector<double> absolute_tolerances;  ///< One per state; sets the size.
  int root_count{0};
};

enum class StepResult { kStep, kRoot, kStopTime };

/// Stiff integration by CVODE's variable-order BDF with a dense
/// difference-quotient Jacobian, one accepted step at a time.
class CvodeIntegrator {
 public:
  /// `system` must outlive this object.
  CvodeIntegrator(const OdeSystem& system, const CvodeOptions& options);
  ~CvodeIntegrator();
  CvodeIntegrator(CvodeIntegrator&&) noexcept;
  CvodeIntegrator& operator=(CvodeIntegrator&&) noexcept;

  /// Restarts at (t, state()) without the history of earlier steps; required
  /// after every jump of the state or of the right-hand side.
  void Restart(double t);

  /// Takes one accepted step towards `t_stop`, never beyond it.
  StepResult StepTowards(double t_stop);

  double time() const;
  /// The state at time(); may be modified before Restart().
  std::span<double> state();
  std::span<const double> state() const;
  std::int64_t step_count() const;
  std::int64_t restart_count() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::simulator
