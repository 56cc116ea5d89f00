#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/model/quality_count.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/fields.h"
#include "diagnosis/records/health_hour.h"

/// Records of a monitor other than episodes and samples.
namespace fdi {

/// A period in which a valve, or every valve if `valve_id` is empty, was not
/// diagnosed or not recorded.
struct DataGap {
  std::string valve_id;
  std::int64_t from_ns{0};
  std::int64_t to_ns{0};
  std::string reason;  ///< "stream" and others: docs/data.md.
};
/// Samples of one valve on one day by quality.
struct CoverageDay {
  std::string valve_id;
  std::int64_t day{0};   ///< UTC, days since 1970-01-01.
  double period_s{1.0};  ///< Of the samples.
  QualityCount samples;
};

/// The slow accumulators of a valve's engine, as packed by ValveEngine::Save().
struct Accumulator {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t model_hash{0};
  std::int64_t stamp_ns{0};  ///< Of the last sample.
  std::vector<std::byte> bytes;
};
/// The diagnosis of a valve by one model set.
struct ShadowAnswer {
  State state{State::kNormal};
  std::string fault;  ///< Names joined by |; empty unless isolated.

  bool operator==(const ShadowAnswer&) const = default;
};

/// A period in which the candidate and the active model set had constant,
/// different answers. The key is valve, source, start and candidate.
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
template <>
inline constexpr auto kFieldsOf<ShadowDifference> = std::tuple{
    Field{"valve_id", &ShadowDifference::valve_id},
    Field{"source_id", &ShadowDifference::source_id},
    Field{"from_ns", &ShadowDifference::from_ns},
    Field{"to_ns", &ShadowDifference::to_ns},
    Field{"samples", &ShadowDifference::samples},
    Field{"active_set", &ShadowDifference::active_set},
    Field{"active_hash", &ShadowDifference::active_hash},
    Field{"active_state",
          Nested<&ShadowDifference::active, &ShadowAnswer::state>{}},
    Field{"active_fault",
          Nested<&ShadowDifference::active, &ShadowAnswer::fault>{}},
    Field{"candidate_set", &ShadowDifference::candidate_set},
    Field{"candidate_hash", &ShadowDifference::candidate_hash},
    Field{"candidate_state",
          Nested<&ShadowDifference::candidate, &ShadowAnswer::state>{}},
    Field{"candidate_fault",
          Nested<&ShadowDifference::candidate, &ShadowAnswer::fault>{}}};

/// What a monitor stores for all valves every minute.
struct Checkpoint {
  std::vector<CoverageDay> coverage;             ///< Since the last one.
  std::vector<Accumulator> accumulators;         ///< Of the live valves.
  std::vector<HealthHour> health;                ///< Since the last one.
  std::vector<ShadowDifference> shadow;          ///< New or extended since.
  std::vector<Accumulator> shadow_accumulators;  ///< Of the candidate.

  bool empty() const {
    return coverage.empty() && accumulators.empty() && health.empty() &&
           shadow.empty() && shadow_accumulators.empty();
  }
};

}  // namespace fdi

FDI_FIELDS(fdi::DataGap, valve_id, from_ns, to_ns, reason)

FDI_FIELDS(fdi::Accumulator, valve_id, source_id, model_hash, stamp_ns, bytes)
