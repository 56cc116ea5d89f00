// Cost of a candidate beside the active set: a sample through the active engine
// alone, and through both with the comparison.
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "bench/synthetic_models.h"
#include "monitor/shadow.h"

namespace fdi::bench {
namespace {

constexpr int kSamples = 2000;
constexpr double kFault = 4.0;  // shift of F that is detected

std::shared_ptr<const ModelSet> Extended(std::uint64_t hash) {
  ModelSet models = ExtendedSet(98);
  models.content_hash = hash;
  return std::make_shared<const ModelSet>(std::move(models));
}

// Argument 0: with the candidate; argument 1: in an episode.
void StepBoth(benchmark::State& state) {
  const auto active = Extended(1);
  ValveEngine engine(active);
  monitor::ShadowCounts counts;
  monitor::ShadowValve shadow("V1", EngineParts(Extended(2)), {}, counts);
  std::vector<Sample> samples =
      Samples(kSamples, 0, state.range(1) != 0 ? kFault : 0.0);
  std::uint64_t later = 0;
  for ([[maybe_unused]] auto _ : state) {
    for (Sample sample : samples) {
      sample.seq += later;
      sample.stamp_ns += static_cast<std::int64_t>(later) * 1'000'000'000;
      const Verdict& verdict = engine.Step(sample);
      if (state.range(0) != 0) {
        benchmark::DoNotOptimize(
            shadow.Step(sample, {verdict, active.get(), false, false}));
      }
    }
    later += kSamples;
  }
  state.counters["per_sample"] = benchmark::Counter(
      static_cast<double>(state.iterations() * kSamples),
      benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(StepBoth)->ArgsProduct({{0, 1}, {0, 1}});

}  // namespace
}  // namespace fdi::bench
