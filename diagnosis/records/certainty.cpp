#include "diagnosis/records/certainty.h"

#include <array>

#include "diagnosis/fault_catalogue.h"

namespace fdi {
namespace {

constexpr double kSureFactor = 0.9;
constexpr double kAgreeingFactor = 0.5;

}  // namespace

std::string_view CertaintyName(Certainty certainty) {
  constexpr std::array<std::string_view, 5> kNames{"not yet", "not known",
                                                   "one of", "likely", "sure"};
  return kNames.at(static_cast<std::size_t>(certainty));
}

Certainty CertaintyOf(std::string_view faults, Layer layer, double factor,
                      Unknown unknown) {
  if (faults == "unknown") {  // It ended before it had a name.
    return Certainty::kNotKnown;
  }
  if (faults.empty()) {
    return unknown == Unknown::kOutsideKnown ? Certainty::kNotKnown
                                             : Certainty::kNotYet;
  }
  if (faults.find('|') != std::string_view::npos) {
    return Certainty::kOneOf;
  }
  const std::optional<int> fault = ParseFinding(faults);
  const bool cause = fault && (IsFault(*fault) || IsLoopFinding(*fault));
  const double least = layer == Layer::kPhysics ? kAgreeingFactor : kSureFactor;
  return cause && factor >= least ? Certainty::kSure : Certainty::kLikely;
}

std::string IsolatedFaults(const FaultEvent& event) {
  std::string text;
  for (const FaultCandidate& candidate : event.candidates) {
    if (candidate.isolated) {
      text.append(text.empty() ? "" : "|").append(FaultName(candidate.fault));
    }
  }
  return text;
}

Certainty CertaintyOf(const FaultEvent& event) {
  const Transition& t = event.transition;
  const bool outside = event.candidates.empty() &&
                       t.unknown != Unknown::kTooEarly &&
                       t.kind != TransitionKind::kDetected;
  return CertaintyOf(IsolatedFaults(event), t.layer, t.factor,
                     outside ? Unknown::kOutsideKnown : Unknown::kTooEarly);
}

}  // namespace fdi
