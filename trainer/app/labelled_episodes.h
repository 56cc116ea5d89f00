#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/history.h"
#include "storage/lineage.h"
#include "storage/run_types.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// Which labelled episodes, and what their labels do not say.
struct LabelSelection {
  storage::EpisodeFilter filter;
  /// Strengths by the beginning of an episode id; they win over estimates.
  std::map<std::string, double> strengths;
};

/// A labelled episode and what it teaches.
struct LabelledEpisode {
  storage::TrainingEpisode meaning;  ///< Without its run.
  std::string data;     ///< "trace", or the stretch of the recorded run.
  std::string refusal;  ///< Why it cannot be trained on; empty: it can.
  /// The samples that count, each with the truth that the label says.
  std::vector<LabelledSample> samples;
};

/// The labelled episodes that `filter` lets through.
/// @throws NotFoundError, DataError, storage::SqliteError
std::vector<storage::Episode> FindLabelled(storage::HistoryReader& history,
                                           const LabelSelection& selection);

/// Reads what labels teach a successor of `parent`:
///
///   true     the isolated fault, if it is one, at its estimated strength;
///   a fault  that fault: at the strength estimated live if it was isolated,
///            else at what EstimateStrength() makes of the same samples with
///            the parent's engine;
///   false    normal operation, with up to 30 min before the detection.
///
/// A fault counts from the detection until t_c and the samples dropped after a
/// step before the clearing. The samples are those of the recorded run of the
/// source, or of the episode's trace if that has more of them.
class LabelReader {
 public:
  /// @param runs runs.db; it need not be there.
  LabelReader(storage::HistoryReader& history,
              const std::filesystem::path& runs,
              std::shared_ptr<const ModelSet> parent,
              const DatasetOptions& dataset, const LabelSelection& selection);
  ~LabelReader();

  LabelledEpisode Read(const storage::Episode& episode);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::trainer
