#include "storage/plot/episode_evidence.h"

#include "diagnosis/error.h"
#include "storage/models.h"

namespace fdi::storage {

EpisodeEvidence LoadEvidence(HistoryReader& history, std::string_view id,
                             const std::filesystem::path& models_path) {
  EpisodeEvidence evidence;
  evidence.episode = history.Show(id);
  const Episode& episode = evidence.episode;
  evidence.events = history.Events(episode.id);
  evidence.trace = history.Trace(episode.id);
  if (!evidence.trace.empty()) {
    EpisodeFilter filter;
    filter.since_ns = evidence.trace.front().received.sample.stamp_ns;
    filter.until_ns = evidence.trace.back().received.sample.stamp_ns + 1;
    evidence.gaps = history.Gaps(filter);
    std::erase_if(evidence.gaps, [&episode](const DataGap& gap) {
      return !gap.valve_id.empty() && gap.valve_id != episode.valve_id;
    });
  }
  if (std::filesystem::exists(models_path)) {
    try {
      ModelSet models = ModelStore(models_path).Load(episode.model_set);
      if (models.content_hash == episode.model_hash &&
          models.channels.size() == episode.channels.size()) {
        evidence.models = std::move(models);
      }
    } catch (const NotFoundError&) {  // It may have been made elsewhere,
    } catch (const DataError&) {      // or be of an older format.
    }
  }
  return evidence;
}

}  // namespace fdi::storage
