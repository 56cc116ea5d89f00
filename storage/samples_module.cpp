// fdi_samples.so, which SQLite loads: samples and hours of health as tables.
// docs/data.md describes it.
#include <sqlite3ext.h>

#include "storage/history/health_table.h"
#include "storage/runs/sample_table.h"

SQLITE_EXTENSION_INIT1

// SQLite finds it by the name of the file.
extern "C" __attribute__((visibility("default"))) int sqlite3_fdisamples_init(
    sqlite3* database, char** /*message*/, const sqlite3_api_routines* api) {
  SQLITE_EXTENSION_INIT2(api);
  static const sqlite3_module samples = fdi::storage::SampleTable();
  static const sqlite3_module health = fdi::storage::HealthTable();
  const int result =
      sqlite3_create_module(database, "sample", &samples, nullptr);
  return result != SQLITE_OK
             ? result
             : sqlite3_create_module(database, "health_hour_value", &health,
                                     nullptr);
}
