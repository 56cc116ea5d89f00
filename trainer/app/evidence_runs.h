#pragma once

#include <string>
#include <vector>

#include "storage/data_directory.h"
#include "trainer/app/labelled_episodes.h"

namespace fdi::trainer {

/// Keeps the samples of labelled episodes as runs of their own in runs.db, with
/// the truth that the label says: what the set was trained on stays when traces
/// and recorded runs go. One that is there already is used again. Names them in
/// `meaning.run`.
/// @returns how many are new. @throws DataError, storage::SqliteError
int KeepEvidence(std::vector<LabelledEpisode>& episodes, const ModelSet& parent,
                 const storage::DataDirectory& directory,
                 const std::string& software);

}  // namespace fdi::trainer
