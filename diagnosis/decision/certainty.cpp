#include "diagnosis/decision/certainty.h"

#include <algorithm>
#include <array>
#include <optional>

#include "diagnosis/model/fault_catalogue.h"

namespace fdi {
namespace {

constexpr double kSureFactor = 0.9;
constexpr double kAgreeingFactor = 0.5;
// An external leak takes at most a twentieth of the flow, and estimates err.
constexpr double kWeak = 0.06;
constexpr int kExternalLeak = 5;

// True if KnownFaults() have `name`, with that sign if it is not 0.
bool Knows(const std::vector<std::string>& known, const std::string& name,
           int sign) {
  return std::ranges::any_of(known, [&](std::string_view one) {
    return one == name || (sign <= 0 && one == name + "-") ||
           (sign >= 0 && one == name + "+");
  });
}

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

Certainty WithAudit(Certainty certainty, std::string_view faults,
                    std::string_view audit) {
  const std::optional<int> found = ParseFinding(audit);
  const bool rod = found == kNoResponse || found == kStiction;
  bool leaves_rod = rod && certainty > Certainty::kOneOf;
  while (leaves_rod && !faults.empty()) {
    const std::size_t bar = std::min(faults.find('|'), faults.size());
    const std::optional<int> fault = ParseFault(faults.substr(0, bar));
    leaves_rod = fault && FaultFactsOf(*fault).acts_on != ActsOn::kRod;
    faults.remove_prefix(std::min(bar + 1, faults.size()));
  }
  return leaves_rod ? Certainty::kOneOf : certainty;
}

std::vector<std::string> LookAlikesBeside(
    std::string_view faults, Layer layer, double strength,
    const std::vector<std::string>& known) {
  std::vector<std::string> beside;
  const std::optional<int> fault = ParseFault(faults);
  if (!fault || known.empty() || layer != Layer::kObservers) {
    return beside;
  }
  const FaultFacts& facts = FaultFactsOf(*fault);
  const auto add = [&](int other, int sign) {
    if (!Knows(known, FaultName(other), sign)) {
      beside.push_back(FaultName(other));
    }
  };
  const bool weak = strength > 0.0 && strength <= kWeak;
  for (const LookAlike& other : facts.look_alikes) {
    if (other.fault != 0 && other.when != Alike::kUnfit &&
        (other.when != Alike::kWhileWeak || weak)) {
      add(other.fault, other.sign);
    }
  }
  // Not so to a simulation, which sees the answer of the loop.
  if (weak && facts.acts_on == ActsOn::kFlowReading) {
    add(kExternalLeak, 0);
  }
  return beside;
}

std::vector<std::string> LookAlikesOf(const FaultEvent& event) {
  std::vector<std::string> known;
  if (event.models) {
    known = KnownFaults(event.models->faults, event.models->observers);
  }
  const Transition& t = event.transition;
  return LookAlikesBeside(IsolatedFaults(event), t.layer, t.strength, known);
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
  return WithLookAlikes(
      CertaintyOf(IsolatedFaults(event), t.layer, t.factor,
                  outside ? Unknown::kOutsideKnown : Unknown::kTooEarly),
      LookAlikesOf(event));
}

}  // namespace fdi
