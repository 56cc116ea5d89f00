#include "monitor/service/shadow.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "monitor/counters.h"

namespace fdi::monitor {

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
