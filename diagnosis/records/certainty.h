#pragma once

#include <string>
#include <string_view>

#include "diagnosis/records/fault_event.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// How certain the name of an episode is, in the words that every view shows
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

/// The faults that `event` isolates, joined by |; empty if none.
std::string IsolatedFaults(const FaultEvent& event);

/// Of the episode after `event`. On the bus, which does not carry
/// Transition::unknown, the candidates tell.
Certainty CertaintyOf(const FaultEvent& event);

}  // namespace fdi
