#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/verdict.h"

namespace fdi::monitor {

/// What one model set said of a valve.
struct ShadowAnswer {
  State state{State::kNormal};
  std::string fault;  ///< Names joined by |; empty unless isolated.

  bool operator==(const ShadowAnswer&) const = default;
};

/// A stretch in which the candidate said something else than the active set,
/// both the same all along. Known by valve, source, start and candidate.
struct ShadowDifference {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::int64_t from_ns{0};  ///< Stamps of the first and the last sample.
  std::int64_t to_ns{0};
  std::int64_t samples{0};
  std::string active_set;  ///< NAME@VERSION
  std::uint64_t active_hash{0};
  ShadowAnswer active;
  std::string candidate_set;
  std::uint64_t candidate_hash{0};
  ShadowAnswer candidate;
};

/// `newer` behind `older`; of the same stretch the newer one stands. What is
/// beyond 100 000, as while the disk is full, is left out: these are notes, no
/// evidence.
std::vector<ShadowDifference> Merged(std::vector<ShadowDifference> older,
                                     std::vector<ShadowDifference> newer);

}  // namespace fdi::monitor
