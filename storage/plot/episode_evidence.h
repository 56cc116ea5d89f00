#pragma once

#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/history_reader.h"

namespace fdi::storage {

/// All that a picture of an episode shows.
struct EpisodeEvidence {
  Episode episode;
  std::vector<EpisodeEvent> events;
  std::vector<TraceInstant> trace;
  std::vector<DataGap> gaps;  ///< That touch the trace.
  /// That gave the answer: thresholds and T. None: not drawn.
  std::optional<ModelSet> models;
};

/// @param id as HistoryReader::Show(). @param models_path models.db; the set is
///   left out if the file has none of this version and content, or
///   of an older format.
/// @throws NotFoundError; DataError if stored bytes of the trace are damaged.
EpisodeEvidence LoadEvidence(HistoryReader& history, std::string_view id,
                             const std::filesystem::path& models_path);

}  // namespace fdi::storage
