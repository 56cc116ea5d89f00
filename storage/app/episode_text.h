#pragma once

#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "storage/alarm.h"
#include "storage/cli/json_output.h"
#include "storage/cli/text_table.h"
#include "storage/history_types.h"

namespace fdi::storage {

// Episodes and shelved alarms as text that several verbs print.

/// The columns of fault_history.
cli::Json EpisodeJson(const Episode& episode);
/// {"episodes": [...]}
cli::Json EpisodesJson(const std::vector<Episode>& episodes);
/// The columns of fault_history as CSV with a heading (RFC 4180).
void WriteEpisodes(const std::vector<Episode>& episodes, std::ostream& out);

cli::Json ShelfJson(const Shelf& shelf);

/// Shelved if there is a shelf, else its own state.
AlarmState ShownState(const Alarm& alarm);
cli::Tone ToneOf(AlarmState state);

/// A cell of a CSV line, quoted if it must be.
std::string CsvCell(const std::string& text);
/// Reads back as the same bits; "nan".
std::string CsvCell(double value);

}  // namespace fdi::storage
