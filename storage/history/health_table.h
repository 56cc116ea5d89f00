#pragma once

struct sqlite3_module;

namespace fdi::storage {

/// The table `health_hour_value` of fdi_samples.so: each number of the hours of
/// health in a history.db, a row each. docs/data.md has its columns.
sqlite3_module HealthTable();

}  // namespace fdi::storage
