#pragma once

struct sqlite3_module;

namespace fdi::storage {

/// The table `sample` of fdi_samples.so: the accepted samples of a runs.db, as
/// `fdi-store runs export` writes them. docs/data.md has its columns.
sqlite3_module SampleTable();

}  // namespace fdi::storage
