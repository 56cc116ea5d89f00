#include "monitor/app/shadow.h"

#include <algorithm>
#include <string_view>

#include "monitor/exposition.h"
#include "storage/shadow.h"

namespace fdi::monitor {
namespace {

storage::ShadowDifference ToStored(const ShadowDifference& d) {
  return {d.valve_id,       d.source_id,
          d.from_ns,        d.to_ns,
          d.samples,        d.active_set,
          d.active_hash,    std::string(StateName(d.active.state)),
          d.active.fault,   d.candidate_set,
          d.candidate_hash, std::string(StateName(d.candidate.state)),
          d.candidate.fault};
}

}  // namespace

std::shared_ptr<const ModelSet> LoadCandidate(
    const std::filesystem::path& models,
    const storage::ModelReference& reference) {
  storage::ModelStore store(models);
  storage::ModelReference chosen = reference;
  if (!chosen.version) {
    for (const storage::ModelSummary& summary : store.List()) {
      if (summary.name == chosen.name) {
        chosen.version = std::max(chosen.version.value_or(0), summary.version);
      }
    }
  }
  return std::make_shared<const ModelSet>(store.Load(chosen));
}

void KeepShadow(storage::Database& history, const Checkpoint& checkpoint) {
  if (checkpoint.shadow.empty() && checkpoint.shadow_accumulators.empty()) {
    return;
  }
  std::vector<storage::ShadowDifference> stretches;
  for (const ShadowDifference& difference : checkpoint.shadow) {
    stretches.push_back(ToStored(difference));
  }
  std::vector<storage::StoredAccumulator> accumulators;
  for (const Accumulator& a : checkpoint.shadow_accumulators) {
    accumulators.push_back(
        {a.valve_id, a.source_id, a.model_hash, a.stamp_ns, a.bytes});
  }
  storage::KeepShadow(history, stretches, accumulators);
}

std::vector<Accumulator> ShadowAccumulators(storage::Database& history) {
  std::vector<Accumulator> accumulators;
  for (storage::StoredAccumulator& stored :
       storage::ShadowAccumulators(history)) {
    accumulators.push_back({stored.valve_id, stored.source_id,
                            stored.model_hash, stored.stamp_ns,
                            std::move(stored.bytes)});
  }
  return accumulators;
}

std::string ShadowMetrics(const ShadowCounts& counts) {
  using Type = Exposition::Type;
  constexpr std::array<std::string_view, 3> kOutcomes{"agreed", "differed",
                                                      "not_judged"};
  Exposition page;
  page.Family("fdi_shadow_samples_total", Type::kCounter,
              "Samples that active set and candidate were both given, by what "
              "they said; not_judged: one of them was not LIVE");
  for (std::size_t i = 0; i < kOutcomes.size(); ++i) {
    page.Value(counts.samples[i].load(), {"outcome", kOutcomes[i]});
  }
  page.Family("fdi_shadow_differences_total", Type::kCounter,
              "Stretches of at least 5 samples in which they differed; "
              "left_out: beyond 60 of a valve in an hour");
  page.Value(counts.recorded.load(), {"outcome", "recorded"});
  page.Value(counts.left_out.load(), {"outcome", "left_out"});
  page.Family("fdi_shadow_valves", Type::kGauge,
              "Valves by whether the candidate runs on them, or why not");
  for (std::size_t i = 0; i < kShadowFitCount; ++i) {
    page.Value(static_cast<std::uint64_t>(
                   std::max<std::int64_t>(counts.valves[i].load(), 0)),
               {"fit", ShadowFitName(static_cast<ShadowFit>(i))});
  }
  return page.text();
}

}  // namespace fdi::monitor
