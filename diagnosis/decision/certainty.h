#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/fault_event.h"

namespace fdi {

/// The certainty of the name of an episode, in the words that every view shows
/// instead of numbers.
enum class Certainty : std::uint8_t {
  kNotYet,    ///< It is too early to say.
  kNotKnown,  ///< No known fault explains the data.
  kOneOf,     ///< Several faults do, and the data do not tell them apart.
  kLikely,    ///< One fault.
  kSure,      ///< One fault, and what else is known agrees.
};

std::string_view CertaintyName(Certainty certainty);  ///< "one of", ...

/// @param faults "f19", "f3|f6"; empty or "unknown": no name.
/// @param layer what named them.
/// @param factor largest decision factor of theirs [-]. A single fault is sure
///   from 0.9, and from 0.5 if a simulation of the valve named it: then
///   observers and simulation, which know nothing of each other, agree. A
///   finding of the floor, which does not tell the cause, is never sure.
/// @param unknown why there is no name.
Certainty CertaintyOf(std::string_view faults, Layer layer, double factor,
                      Unknown unknown = Unknown::kTooEarly);

/// The faults that a model set knows, by name. One that can have either sign,
/// but has observers of one only, has the sign behind its name: "f19-".
/// @param faults those of the set, findings included.
/// @param observers with their `fault` and `strength`.
template <typename Observers>
std::vector<std::string> KnownFaults(const std::vector<int>& faults,
                                     const Observers& observers) {
  std::vector<std::string> known;
  for (const int fault : faults) {
    bool negative = false;
    bool positive = false;
    for (const auto& observer : observers) {
      negative |= observer.fault == fault && observer.strength < 0.0;
      positive |= observer.fault == fault && observer.strength > 0.0;
    }
    const bool one = HasNegative(fault) && negative != positive;
    known.push_back(FaultName(fault) + (!one ? "" : negative ? "-" : "+"));
  }
  return known;
}

/// Faults that look like `faults`, where these are a single one, to observers
/// whose set does not know them: with one shape whatever the size, as long as
/// both are weak, or with a sign that the set does not know. Empty for a name
/// by a simulation of the valve, which knows all faults.
/// @param strength of the fault; signed [-].
/// @param known KnownFaults() of the set; empty: the set is not known, and
///   nothing is added.
std::vector<std::string> LookAlikesBeside(
    std::string_view faults, Layer layer, double strength,
    const std::vector<std::string>& known);

/// `certainty` of a name with these look-alikes beside it.
inline Certainty WithLookAlikes(Certainty certainty,
                                const std::vector<std::string>& look_alikes) {
  return look_alikes.empty() ? certainty : Certainty::kOneOf;
}

/// The certainty of a name if the loop audit reports `audit` at the same time.
/// If the rod sticks or does not answer the command, a fault that does not act
/// on the rod is unlikely. @param audit as FaultName(); empty: no finding.
Certainty WithAudit(Certainty certainty, std::string_view faults,
                    std::string_view audit);

/// The look-alikes of the name that `event` gives; none if it is from the bus.
std::vector<std::string> LookAlikesOf(const FaultEvent& event);

/// The faults that `event` isolates, joined by |; empty if none.
std::string IsolatedFaults(const FaultEvent& event);

/// The certainty of the episode after `event`. The bus does not carry
/// Transition::unknown, so there it is derived from the candidates.
Certainty CertaintyOf(const FaultEvent& event);

}  // namespace fdi
