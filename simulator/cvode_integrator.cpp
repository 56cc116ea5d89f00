#include "simulator/cvode_integrator.h"

#include <algorithm>

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "base/error.h"

namespace fdi::simulator {
namespace {

void FreeContext(SUNContext context) {
  SUNContext_Free(&context);
}
void FreeSolver(SUNLinearSolver solver) {
  SUNLinSolFree(solver);
}
void FreeMemory(void* memory) {
  CVodeFree(&memory);
}

template <auto Free>
struct Deleter {
  template <typename T>
  void operator()(T* handle) const {
    Free(handle);
  }
};

using Context =
    std::unique_ptr<std::remove_pointer_t<SUNContext>, Deleter<FreeContext>>;
using Vector = std::unique_ptr<_generic_N_Vector, Deleter<N_VDestroy>>;
using Matrix = std::unique_ptr<_generic_SUNMatrix, Deleter<SUNMatDestroy>>;
using Solver = std::unique_ptr<_generic_SUNLinearSolver, Deleter<FreeSolver>>;
using Memory = std::unique_ptr<void, Deleter<FreeMemory>>;

// SUNDIALS returns errors below 0; above 0 is what happened, such as a root.
void Check(int code, const char* operation) {
  if (code < 0) {
    throw CvodeError(operation, code);
  }
}

template <typename Handle>
Handle Owned(typename Handle::pointer handle, const char* operation) {
  if (handle == nullptr) {
    throw CvodeError(operation, CV_MEM_FAIL);
  }
  return Handle(handle);
}

Context MakeContext() {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR < 7
  Check(SUNContext_Create(nullptr, &context), "SUNContext_Create");
#else
  Check(SUNContext_Create(SUN_COMM_NULL, &context), "SUNContext_Create");
#endif
  return Context(context);
}

// Called from C, which no exception may cross: OdeSystem is noexcept.
int CallDerivatives(double t, N_Vector x, N_Vector dx, void* system) {
  static_cast<const OdeSystem*>(system)->Derivatives(t, N_VGetArrayPointer(x),
                                                     N_VGetArrayPointer(dx));
  return 0;
}

int CallRoots(double t, N_Vector x, double* g, void* system) {
  static_cast<const OdeSystem*>(system)->Roots(t, N_VGetArrayPointer(x), g);
  return 0;
}

// Stores CVODE's error message for the exception. Called from C, too; if there
// is no memory, the message is empty.
void CopyMessage(const char* text, void* message) {
  try {
    *static_cast<std::string*>(message) = text;
  } catch (...) {
    static_cast<std::string*>(message)->clear();
  }
}

#if SUNDIALS_VERSION_MAJOR < 7
void KeepMessage(int, const char*, const char*, char* text, void* message) {
  CopyMessage(text, message);
}
#else
void KeepMessage(int, const char*, const char*, const char* text, SUNErrCode,
                 void* message, SUNContext) {
  CopyMessage(text, message);
}
#endif

}  // namespace

CvodeError::CvodeError(const std::string& operation, int code)
    : std::runtime_error(operation + " failed with code " +
                         std::to_string(code)),
      code_(code) {}

// Declared in the order of creation; destruction runs in reverse. CVODE keeps
// the addresses of the system and of message_, so an Impl stays where it is.
class CvodeIntegrator::Impl {
 public:
  Impl(const OdeSystem& system, const CvodeOptions& options)
      : size_(static_cast<sunindextype>(options.absolute_tolerances.size())),
        context_(MakeContext()),
        state_(NewVector()),
        tolerances_(NewVector()),
        matrix_(Owned<Matrix>(SUNDenseMatrix(size_, size_, context_.get()),
                              "SUNDenseMatrix")),
        solver_(Owned<Solver>(
            SUNLinSol_Dense(state_.get(), matrix_.get(), context_.get()),
            "SUNLinSol_Dense")),
        memory_(
            Owned<Memory>(CVodeCreate(CV_BDF, context_.get()), "CVodeCreate")) {
    N_VConst(0.0, state_.get());
    std::copy(options.absolute_tolerances.begin(),
              options.absolute_tolerances.end(),
              N_VGetArrayPointer(tolerances_.get()));
    void* const m = memory_.get();
    // First, because tolerances and linear solver use vectors that it
    // allocates.
    Check(CVodeInit(m, CallDerivatives, 0.0, state_.get()), "CVodeInit");
    Check(CVodeSVtolerances(m, options.relative_tolerance, tolerances_.get()),
          "CVodeSVtolerances");
    Check(CVodeSetLinearSolver(m, solver_.get(), matrix_.get()),
          "CVodeSetLinearSolver");
    // SUNDIALS takes user data as void*; the callbacks only read it.
    Check(CVodeSetUserData(m, const_cast<OdeSystem*>(&system)),
          "CVodeSetUserData");
#if SUNDIALS_VERSION_MAJOR < 7
    Check(CVodeSetErrHandlerFn(m, KeepMessage, &message_),
          "CVodeSetErrHandlerFn");
#else
    // The handlers are a stack, all of which are called. Without this, the
    // default one would print the message as well.
    Check(SUNContext_ClearErrHandlers(context_.get()),
          "SUNContext_ClearErrHandlers");
    Check(SUNContext_PushErrHandler(context_.get(), KeepMessage, &message_),
          "SUNContext_PushErrHandler");
#endif
    // A root function may be 0 at a restart, as the velocity is when a rod at
    // rest breaks away. CVODE would warn of it.
    Check(CVodeSetNoInactiveRootWarn(m), "CVodeSetNoInactiveRootWarn");
    if (options.root_count > 0) {
      Check(CVodeRootInit(m, options.root_count, CallRoots), "CVodeRootInit");
    }
  }

  void Restart(double t) {
    steps_ = steps();  // CVodeReInit() sets CVODE's counter to 0.
    Check(CVodeReInit(memory_.get(), t, state_.get()), "CVodeReInit");
    time_ = t;
    ++restarts_;
  }

  StepResult StepTowards(double t_stop) {
    void* const m = memory_.get();
    // In one-step mode the t_stop of CVode() gives only the direction; the stop
    // time is what a step does not pass. CVODE drops it once it is reached, so
    // it is set every time.
    Check(CVodeSetStopTime(m, t_stop), "CVodeSetStopTime");
    const int code = CVode(m, t_stop, state_.get(), &time_, CV_ONE_STEP);
    if (code < 0) {
      throw CvodeError("CVode: " + message_, code);
    }
    if (code == CV_ROOT_RETURN) {
      return StepResult::kRoot;
    }
    return code == CV_TSTOP_RETURN ? StepResult::kStopTime : StepResult::kStep;
  }

  std::int64_t steps() const {
    long count = 0;
    Check(CVodeGetNumSteps(memory_.get(), &count), "CVodeGetNumSteps");
    return steps_ + count;
  }

  double time_{0.0};
  std::int64_t restarts_{0};

  std::span<double> state() const {
    return {N_VGetArrayPointer(state_.get()), static_cast<std::size_t>(size_)};
  }

 private:
  Vector NewVector() const {
    return Owned<Vector>(N_VNew_Serial(size_, context_.get()), "N_VNew_Serial");
  }

  sunindextype size_;
  Context context_;
  Vector state_;
  Vector tolerances_;
  Matrix matrix_;
  Solver solver_;
  // Before memory_, whose error handler writes to it.
  std::string message_;
  Memory memory_;
  std::int64_t steps_{0};
};

CvodeIntegrator::CvodeIntegrator(const OdeSystem& system,
                                 const CvodeOptions& options) {
  Require(!options.absolute_tolerances.empty(),
          "absolute_tolerances needs one entry per state");
  impl_ = std::make_unique<Impl>(system, options);
}
CvodeIntegrator::~CvodeIntegrator() = default;
CvodeIntegrator::CvodeIntegrator(CvodeIntegrator&&) noexcept = default;
CvodeIntegrator& CvodeIntegrator::operator=(CvodeIntegrator&&) noexcept =
    default;

void CvodeIntegrator::Restart(double t) {
  impl_->Restart(t);
}
StepResult CvodeIntegrator::StepTowards(double t_stop) {
  return impl_->StepTowards(t_stop);
}
double CvodeIntegrator::time() const {
  return impl_->time_;
}
std::span<double> CvodeIntegrator::state() {
  return impl_->state();
}
std::span<const double> CvodeIntegrator::state() const {
  return impl_->state();
}
std::int64_t CvodeIntegrator::step_count() const {
  return impl_->steps();
}
std::int64_t CvodeIntegrator::restart_count() const {
  return impl_->restarts_;
}

}  // namespace fdi::simulator
