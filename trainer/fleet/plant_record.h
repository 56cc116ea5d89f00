#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "trainer/dataset.h"
#include "trainer/fleet/plant_files.h"

namespace fdi::trainer {

/// The text of a row's record: its own columns of its files.
struct RowText {
  std::string text;
  importer::ColumnMap form;
  LinePlaces source;
};
std::vector<RowText> TextsOf(const PlantJob& job, PlantFiles& files);

/// True if the row asks for named faults and has what they take: a type and x.
bool WantsModels(const PlantJob& job);

/// Fingerprint of a row's input: what the row says about reading and judging
/// its record, and the record itself. Grade and group are not part of it.
/// @param basis of its models beside the record, as text; empty: data only.
std::uint64_t InputHash(const PlantJob& job, const std::vector<RowText>& texts,
                        const std::string& basis);

/// The healthy record of a valve.
/// @param utc messages show times in UTC.
/// @throws DataError, ConfigError with what was seen and what to type.
std::vector<TrainingRun> ReadValve(const PlantJob& job,
                                   const std::vector<RowText>& texts, bool utc);

/// The verdict of the audit on the record of a loop, in one sentence.
/// @param fits false: check what the record is, but do not judge the loop.
/// @throws DataError, ConfigError if op, pv, sp or mode cannot be what the row
///   says, with what was seen and what to type.
std::string AuditLoop(const PlantJob& job, const std::vector<RowText>& texts,
                      bool utc, bool fits);

}  // namespace fdi::trainer
