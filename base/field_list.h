#pragma once

/// Applies a macro to each field of a single list:
///
///     FDI_FOR_EACH(MACRO, sd, correlation)    is    MACRO(sd)
///     MACRO(correlation)
///
/// The preprocessor does not expand a macro within itself. FDI_FOR_EACH_STEP
/// therefore leaves the name of its next step unexpanded, and FDI_RESCAN
/// rescans the result 64 times, which limits the number of fields.
#define FDI_FOR_EACH(MACRO, ...) \
  __VA_OPT__(FDI_RESCAN(FDI_FOR_EACH_STEP(MACRO, __VA_ARGS__)))
#define FDI_FOR_EACH_STEP(MACRO, FIRST, ...) \
  MACRO(FIRST)                               \
  __VA_OPT__(FDI_FOR_EACH_NEXT FDI_NO_ARGUMENTS(MACRO, __VA_ARGS__))
#define FDI_FOR_EACH_NEXT() FDI_FOR_EACH_STEP
#define FDI_NO_ARGUMENTS ()
#define FDI_RESCAN(...) FDI_RESCAN_16(FDI_RESCAN_16(__VA_ARGS__))
#define FDI_RESCAN_16(...) \
  FDI_RESCAN_4(FDI_RESCAN_4(FDI_RESCAN_4(FDI_RESCAN_4(__VA_ARGS__))))
#define FDI_RESCAN_4(...) \
  FDI_RESCAN_1(FDI_RESCAN_1(FDI_RESCAN_1(FDI_RESCAN_1(__VA_ARGS__))))
#define FDI_RESCAN_1(...) __VA_ARGS__

/// FDI_VISITABLE(Scatter, sd, slow_sd) defines VisitFields(scatter, visit),
/// which calls visit("sd", scatter.sd) and so on, in this order.
#define FDI_VISITABLE(STRUCT, ...)                   \
  template <typename Visitor>                        \
  void VisitFields(STRUCT& value, Visitor&& visit) { \
    FDI_FOR_EACH(FDI_VISIT_FIELD, __VA_ARGS__)       \
  }
#define FDI_VISIT_FIELD(FIELD) visit(#FIELD, value.FIELD);
