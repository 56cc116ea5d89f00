#pragma once

#include <string_view>

namespace fdi::storage {

// Steps of HistorySchema(), each SQL that brings history.db to its version.

/// Version 4: what people did: where an action came from, shelved alarms.
extern const std::string_view kOperatorSchema;
/// Version 5: health by valve and hour, common causes.
extern const std::string_view kHealthSchema;
/// Version 6: where a candidate model set differs from the active one.
extern const std::string_view kShadowSchema;

}  // namespace fdi::storage
