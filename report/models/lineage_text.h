#pragma once

#include <string>

#include "report/json_output.h"
#include "storage/models/models.h"

namespace fdi::report {

/// {"parent": {"model_set", "version", "content_hash"} or null, "settings":
/// {...} or null, "episodes": [{episode_id, valve_id, label, labelled_by,
/// labelled_utc, fault, strength, run, samples}]}.
Json LineageJson(const storage::Lineage& lineage);

/// "NAME@VERSION, hash 0123456789abcdef"; "none". For a set of `fdi-trainer
/// limits` also ", with limits from 23.92 h".
std::string ParentText(const storage::Lineage& lineage);

}  // namespace fdi::report
