#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "storage/database.h"

namespace fdi::storage {

/// An episode of history.db that a model set learnt from: what it was labelled,
/// what that was taken to mean, and where its samples are.
struct TrainingEpisode {
  std::string episode_id;  ///< 16 hex digits.
  std::string valve_id;
  std::string label;  ///< true, false, or a fault.
  std::string labelled_by;
  std::int64_t labelled_ns{0};
  int fault{0};          ///< 0: normal operation.
  double strength{0.0};  ///< Signed; 0 in normal operation.
  std::string run;       ///< Of runs.db, among the training runs of the set.
  std::int64_t samples{0};

  bool operator==(const TrainingEpisode&) const = default;
};

/// The model set that another one was built on.
struct ParentSet {
  std::string name;
  int version{0};
  std::uint64_t content_hash{0};

  bool operator==(const ParentSet&) const = default;
};

/// Where a model set comes from, beside its training runs. Stays in models.db:
/// an exported file does not carry it.
struct Lineage {
  std::string settings;  ///< JSON of the training; empty: not known.
  std::optional<ParentSet> parent;
  std::vector<TrainingEpisode> episodes;  ///< Those of the parent, too.
};

/// Within the transaction that stores the set.
void InsertLineage(Database& database, std::int64_t model_set_id,
                   const Lineage& lineage);

Lineage ReadLineage(Database& database, std::int64_t model_set_id);

}  // namespace fdi::storage
