// Cost of what runs beside the engine: the counters of a valve, the sliding
// window of a loop and its audit. A row of bench/engine_benchmark.cpp is what
// they are to be compared with.
#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>
#include <malloc.h>

#include "bench/synthetic_models.h"
#include "diagnosis/decision/valve_engine.h"
#include "diagnosis/loop/loop_watch.h"
#include "diagnosis/loop/valve_counters.h"

namespace fdi::bench {
namespace {

constexpr int kRound = 20;
constexpr std::int64_t kSecond = 1'000'000'000;

void CountSamples(benchmark::State& state, std::int64_t samples) {
  state.counters["per_sample"] = benchmark::Counter(
      static_cast<double>(samples),
      benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

// A sample each second of a loop with noise.
Sample LoopSample(std::uint64_t k, std::uint64_t valve) {
  Sample sample;
  sample.source_id = 1;
  sample.seq = k;
  sample.stamp_ns = static_cast<std::int64_t>(k) * kSecond;
  const double t = static_cast<double>(k) + 37.0 * static_cast<double>(valve);
  const double noise = 0.05 * std::sin(12.9898 * t);
  const double cv = 50.0 + 8.0 * std::sin(0.01 * t) + noise;
  sample.Set(Signal::kCv, cv);
  sample.Set(Signal::kX, cv - noise);
  sample.Set(Signal::kF, 100.0 - cv + 2.0 * noise);
  return sample;
}

// The engine of 1000 valves in turn, and the same with the counters of each
// (argument 0: 0, 1).
void StepManyValves(benchmark::State& state) {
  const bool counts = state.range(0) != 0;
  constexpr std::size_t kValves = 1000;
  const EngineParts parts(std::make_shared<const ModelSet>(PaperSet(33)));
  std::vector<ValveEngine> engines;
  std::vector<std::vector<Sample>> samples;
  std::vector<loop::ValveCounters> counters(kValves);
  std::vector<loop::ValveCounts> sums(kValves);
  for (std::size_t v = 0; v < kValves; ++v) {
    engines.emplace_back(parts);
    samples.push_back(Samples(kRound, 7 * static_cast<int>(v), 0.0));
  }
  const auto round = [&] {
    for (std::size_t k = 0; k < kRound; ++k) {
      for (std::size_t v = 0; v < kValves; ++v) {
        Sample& sample = samples[v][k];
        benchmark::DoNotOptimize(engines[v].Step(sample));
        if (counts) {
          counters[v].Push({sample[Signal::kCv], sample[Signal::kX], 1.0, true},
                           sums[v]);
        }
        sample.seq += kRound;
        sample.stamp_ns += kRound * kSecond;
      }
    }
  };
  round();
  for ([[maybe_unused]] auto _ : state) {
    round();
  }
  benchmark::DoNotOptimize(sums.data());
  CountSamples(state, state.iterations() * kRound * std::int64_t{kValves});
}
BENCHMARK(StepManyValves)->Arg(0)->Arg(1);

std::size_t HeapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

// 10 000 loops, a sample each second, whose windows are full: 1200 s in a row,
// in which each is audited once. Argument 0: with the
// audits, or only the windows.
void FollowManyLoops(benchmark::State& state) {
  const bool audits = state.range(0) != 0;
  constexpr std::uint64_t kLoops = 10'000;
  constexpr auto kSeconds =
      static_cast<std::uint64_t>(LoopWatch::kHop * LoopWatch::kInterval_s);
  const std::size_t before = HeapBytes();
  std::vector<LoopWatch> loops;
  const auto severities = std::make_shared<const SeverityCatalogue>();
  for (std::uint64_t v = 0; v < kLoops; ++v) {
    loops.emplace_back(v % LoopWatch::kHop, severities);
    for (std::uint64_t k = 1; k <= LoopWatch::kPoints; ++k) {
      loops[v].Step(LoopSample(10 * k, v), 1.0);
    }
    loops[v].TakeWindow();  // The one that is due by now.
    loops[v].Enter({});
  }
  const double bytes = static_cast<double>(HeapBytes() - before) / kLoops;
  std::uint64_t now = 10 * LoopWatch::kPoints;
  std::int64_t windows = 0;
  for ([[maybe_unused]] auto _ : state) {
    for (std::uint64_t s = 0; s < kSeconds; ++s) {
      ++now;
      for (std::uint64_t v = 0; v < kLoops; ++v) {
        loops[v].Step(LoopSample(now, v), 1.0);
        if (auto window = loops[v].TakeWindow()) {
          ++windows;
          loops[v].Enter(audits ? std::optional(AuditValve(std::move(*window)))
                                : std::nullopt);
        }
      }
    }
  }
  state.counters["bytes_per_loop"] = bytes;
  state.counters["audits"] = static_cast<double>(windows);
  CountSamples(
      state, state.iterations() * static_cast<std::int64_t>(kLoops * kSeconds));
}
BENCHMARK(FollowManyLoops)
    ->Arg(0)
    ->Arg(1)
    ->Iterations(1)
    ->Unit(benchmark::kSecond);

}  // namespace
}  // namespace fdi::bench
