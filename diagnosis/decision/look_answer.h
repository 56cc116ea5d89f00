#pragma once

#include <optional>
#include <stop_token>
#include <vector>

#include "diagnosis/decision/look.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// Largest distance behind the best explanation at which a fault stays in the
/// set; see docs/method.md.
inline constexpr double kLookMargin = 15.0;
/// An early look keeps at least this share of what the best gains over none: by
/// so much the physics may be off, which a short window does not average out.
inline constexpr double kEarlyLookShare = 0.1;
/// A fault that gains less over none, per independent reading, may be what a
/// healthy valve and its simulation differ by: up to 0.20 were seen without
/// one.
inline constexpr double kMinGain = 0.25;
/// A set of more faults is a shortlist.
inline constexpr std::size_t kMaxNamedFaults = 4;

/// A window that the valve without a fault follows with a larger misfit is not
/// that of a healthy valve, for which it is about 1.
inline constexpr double kHealthyMisfit = 1.5;
/// A routine look names a fault only where that takes so much off the misfit:
/// as much as a healthy valve has.
inline constexpr double kRoutineGain = 1.0;

LookAnswer AnswerOf(const SecondLook& look, bool early = false);

/// Takes the look that is due. Nothing if it was asked to stop. One for growth
/// answers with the faults that it knows, and names nothing.
/// @throws as LookSimulation.
std::optional<LookAnswer> TakeLook(const LookSimulation& simulation,
                                   const LookTask& task,
                                   const std::stop_token& stop = {});

/// The observers have isolated a fault, and not only what the floor finds.
bool ObserversName(const ModelSet& models, FaultSet isolated);

/// Faults that look the same to the observers of a set: ModelSet::groups.
using FaultGroups = std::vector<std::vector<int>>;

/// Adds to the faults of the answer those beside them that are of their groups:
/// known look-alikes bind a look that is not sure to know better.
void BindGroups(const FaultGroups& groups, LookAnswer& answer);

/// Where the flow has changed while nothing was read, and the look names
/// nothing: the faults of a meter or the line that explain it better than none
/// does, if they are a name. Trim and rod wear while they work; transmitters
/// are set, and lines switched, during outages.
void KeepMeterAndLine(const SecondLook& look, LookAnswer& answer);

/// The faults that an answer names, ascending; empty: unknown. Nothing if what
/// the engine says stands. @param observers_name see ObserversName().
std::optional<std::vector<int>> NamesOf(const LookAnswer& answer,
                                        bool observers_name);

/// NamesOf() beside what the observers say: a fault that they know from this
/// very valve (TaughtOnly()) stands for the set of which it is one, and for no
/// name at all. Where the physics names others, it is not heard.
std::optional<std::vector<int>> NamesBeside(const Verdict& engine,
                                            const ModelSet& models,
                                            const LookAnswer& answer);

}  // namespace fdi
