#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "trainer/learning/healthy_residuals.h"
#include "trainer/onboarding/coverage.h"

namespace fdi::trainer {

/// The quantity that a limit of a channel bounds.
enum class LimitKind : std::uint8_t {
  kLower,      ///< The residual from below.
  kUpper,      ///< The residual from above.
  kLowerMean,  ///< The mean of a window from below.
  kUpperMean,  ///< The mean of a window from above.
  kDeviation,  ///< The deviation over a window from above.
};
std::string_view LimitKindName(LimitKind kind);  ///< "lower", "lower_mean", ...

/// One limit of a model set. The order of LimitsOf() is that of the channels;
/// it is the same for sets of the same windows.
struct Limit {
  std::size_t channel{0};
  int window{0};  ///< Length N [samples]; 0: of single residuals.
  LimitKind kind{LimitKind::kLower};
  double value{0.0};  ///< [unit of the output]; negative from below.
};
std::vector<Limit> LimitsOf(const ModelSet& models);
/// "upper mean over 200 samples"
std::string LimitText(const Limit& limit);

/// The nearest that some data come to a limit.
struct Peak {
  double share{0.0};  ///< Share of it for n_d samples; above 1: an alarm.
  std::string run{};  ///< Where that was.
  std::int64_t stamp_ns{0};
};

/// Parallel to LimitsOf(models).
std::vector<Peak> PeaksOf(const ModelSet& models, const HealthyResiduals& data);

/// Fewer residuals of a channel say nothing of its limits.
inline constexpr std::size_t kMinResiduals = 100;

/// New limits of a set, and how they came about.
struct NewLimits {
  ModelSet models;     ///< The parent with other limits; not stored yet.
  double hours{0.0};   ///< Healthy data used.
  bool fitted{false};  ///< The data may also make limits closer.
};

/// Sets the limits of `parent` by healthy data that its observers were not
/// fitted to; the observers stay as they are.
///
/// A limit that the data pass becomes the one that FitThresholds() gives for
/// them, but at most 1.5 times what was seen, and that where too few data give
/// one; the limit on a deviation then lies e^0.25 beyond what was seen. With as
/// many hours as the parent's limits were made from, over at least 80 % of the
/// commands that these hold for, every other limit becomes the one of
/// FitThresholds() if that is closer; otherwise it stays.
///
/// The floor becomes as wide as the data ask for (WidenFloor()).
///
/// @throws DataError if a channel has fewer than kMinResiduals.
NewLimits SetLimits(const ModelSet& parent, const HealthyResiduals& data);

/// Data that no person called healthy may pass the limits of onboarding this
/// far: twice the limit, which then becomes three times as wide.
inline constexpr double kMaxReachRatio = 2.0;

/// @param first The set of onboarding, whose observers `parent` has.
/// @param peaks Of the data, against `parent`.
/// @throws DataError naming run, time and channel if the data pass a limit of
///   `parent` and reach beyond kMaxReachRatio times that of `first`.
void RequireHealthy(const ModelSet& first, const ModelSet& parent,
                    const std::vector<Peak>& peaks);

/// The smallest strengths of each fault and direction whose effect by itself
/// passes a limit, as do all greater ones, by what the observers of the faults
/// predict over `samples` beside the normal one. The strengths are those of the
/// observers.
std::vector<CoverageChange> CompareVisibility(
    const ModelSet& before, const ModelSet& after,
    const std::vector<Sample>& samples);

}  // namespace fdi::trainer
