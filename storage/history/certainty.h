#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/decision/certainty.h"
#include "storage/database/database.h"
#include "storage/history/episode.h"

namespace fdi::storage {

/// The certainty of its name; after its end, the last one that it had.
Certainty CertaintyOf(const Episode& episode);

/// Faults that may be the cause as well as the one that names `episode`
/// (LookAlikesBeside()).
std::vector<std::string> LookAlikesOf(const Episode& episode);

/// Says which witness gave the name, and what the others say: "named by
/// simulation of the valve: f2 explains it 40 times better than f19, the
/// observers are undecided; the audit of its loop says: the valve sticks".
/// Empty if it came from the observers only.
std::string WitnessText(const Episode& episode);
/// Stores certainty and look-alikes for the view fault_history. Called after
/// each change of a column that they depend on.
void StoreCertainty(Database& database, const std::string& episode_id);

/// The text in place of a name, as in the view fault_history; empty for
/// an episode that has a name or is unlike any known fault.
std::string_view NoNameText(const Episode& episode);

}  // namespace fdi::storage
