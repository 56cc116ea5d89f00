#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// "NAME@VERSION"
std::string NameOf(const ModelSet& models);

/// Strengths of faults by the beginning of an episode id, as the user gave
/// them; they win over estimates.
using GivenStrengths = std::map<std::string, double>;

/// The part of a run that covers a time, in whole seconds from its start and
/// one period longer, as users write it.
std::string SelectorOf(const storage::RunInfo& info, std::int64_t from_ns,
                       std::int64_t to_ns);

/// A labelled episode and what it teaches.
struct LabelledEpisode {
  storage::TrainingEpisode meaning;  ///< Its run is named once it is stored.
  std::string data;     ///< "trace", or the stretch of the recorded run.
  std::string refusal;  ///< Why nothing can be learnt from it, or empty.
  /// The samples to train on, each with the truth that the label implies.
  std::vector<LabelledSample> samples;
  storage::StoredRun record;  ///< With what went before the episode.
};

/// The samples of an episode that teaches `parent` something, as a run.
TrainingRun RunOf(const LabelledEpisode& episode, const ModelSet& parent);

/// Reads what labels teach a successor of `parent`:
///
///   true     the isolated fault, if it is exactly one, at the strength that
///            was estimated live;
///   a fault  that fault: at the strength estimated live if it was isolated,
///            else at the estimate of the parent's engine on the same samples;
///   false    normal operation, with up to 30 min before the detection.
///
/// A fault counts from the detection until the clearing, less the clearing
/// time t_c and the samples dropped after a step. The samples are those of the
/// recorded run of the source, or those of the episode's trace if there are
/// more of them.
class LabelReader {
 public:
  /// @param runs runs.db, which need not exist.
  LabelReader(storage::HistoryReader& history, std::filesystem::path runs,
              std::shared_ptr<const ModelSet> parent,
              const DatasetOptions& dataset, GivenStrengths strengths);

  /// An episode that teaches nothing comes back with the reason.
  /// @throws DataError, storage::SqliteError if a database cannot be read.
  LabelledEpisode Read(const storage::Episode& episode);

 private:
  struct TimeSpan;
  struct EpisodeSamples;

  TimeSpan SpanAround(const storage::Episode& episode);
  EpisodeSamples LoadSamples(const storage::Episode& episode,
                             const TimeSpan& span);
  void RequireSuited(const storage::StoredRun& run) const;
  double StrengthOf(const storage::Episode& episode, int fault,
                    const storage::StoredRun& run) const;
  std::vector<LabelledSample> TakeSamples(const storage::StoredRun& run,
                                          const storage::Episode& episode,
                                          const FaultTruth& truth) const;

  storage::HistoryReader& history_;
  std::filesystem::path runs_;
  std::shared_ptr<const ModelSet> parent_;
  DatasetOptions dataset_;
  GivenStrengths strengths_;
};

}  // namespace fdi::trainer
