// Cost of one sample in the diagnosis engine: time on one core, memory of an
// engine, time to make many. The model sets are synthetic (synthetic_models.h).
#include <memory>
#include <vector>

#include <benchmark/benchmark.h>
#include <malloc.h>

#include "bench/scalar_observers.h"
#include "bench/synthetic_models.h"
#include "diagnosis/decision/valve_engine.h"
#include "diagnosis/observers/observer_bank.h"

namespace fdi::bench {
namespace {

constexpr int kSettled = 200;   // samples until the valve is judged
constexpr int kSamples = 2000;  // measured in a row
constexpr double kFault = 4.0;  // shift of F that is detected
constexpr int kManyValves = 1000;
constexpr int kRound = 20;  // samples of each of many valves

using Models = std::shared_ptr<const ModelSet>;

Models Paper(int observers) {
  return std::make_shared<const ModelSet>(PaperSet(observers));
}

Models Extended(int observers) {
  return std::make_shared<const ModelSet>(ExtendedSet(observers));
}

std::size_t HeapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

// Moves `sample` on as if it came so many samples later.
void Later(Sample& sample, std::uint64_t samples) {
  sample.seq += samples;
  sample.stamp_ns += static_cast<std::int64_t>(samples) * 1'000'000'000;
}

void CountSamples(benchmark::State& state, std::int64_t samples) {
  state.counters["per_sample"] = benchmark::Counter(
      static_cast<double>(samples),
      benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

// One valve, in normal operation (argument 1 is 0) or in an episode.
template <Models (*MakeModels)(int)>
void StepOneValve(benchmark::State& state) {
  const bool faulty = state.range(1) != 0;
  ValveEngine engine(MakeModels(static_cast<int>(state.range(0))));
  for (const Sample& sample : Samples(kSettled, 0, 0.0)) {
    engine.Step(sample);
  }
  std::vector<Sample> samples =
      Samples(kSamples, kSettled, faulty ? kFault : 0.0);
  for (Sample& sample : samples) {
    Later(sample, kSettled);
    engine.Step(sample);
  }
  std::int64_t open = 0;
  for ([[maybe_unused]] auto _ : state) {
    for (Sample& sample : samples) {
      Later(sample, kSamples);
      benchmark::DoNotOptimize(engine.Step(sample));
      open += engine.episode_open() ? 1 : 0;
    }
  }
  const std::int64_t steps = state.iterations() * kSamples;
  state.counters["in_episode"] =
      static_cast<double>(open) / static_cast<double>(steps);
  CountSamples(state, steps);
}
BENCHMARK(StepOneValve<Paper>)->ArgsProduct({{11, 33}, {0, 1}});
BENCHMARK(StepOneValve<Extended>)->ArgsProduct({{45, 98}, {0, 1}});

// Predictions and residuals of all observers of a valve, one model after the
// other in plain scalar code: what the kernels are to be compared with.
template <Models (*MakeModels)(int)>
void PredictOneByOne(benchmark::State& state) {
  const Models models = MakeModels(static_cast<int>(state.range(0)));
  ScalarObservers observers(*models);
  const std::vector<Sample> samples = Samples(kSamples, 0, 0.0);
  for ([[maybe_unused]] auto _ : state) {
    for (const Sample& sample : samples) {
      benchmark::DoNotOptimize(observers.Step(sample));
    }
  }
  CountSamples(state, state.iterations() * kSamples);
}
BENCHMARK(PredictOneByOne<Paper>)->Arg(11)->Arg(33);
BENCHMARK(PredictOneByOne<Extended>)->Arg(45)->Arg(98);

// The same by the kernels; argument 1 is the InstructionSet.
template <Models (*MakeModels)(int)>
void PredictSideBySide(benchmark::State& state) {
  const Models models = MakeModels(static_cast<int>(state.range(0)));
  ObserverBank bank(std::make_shared<const ObserverPlan>(*models),
                    static_cast<InstructionSet>(state.range(1)));
  const std::vector<Sample> samples = Samples(kSamples, 0, 0.0);
  bank.Initialise(samples.front());
  std::vector<double> factors(models->observers.size());
  for ([[maybe_unused]] auto _ : state) {
    for (const Sample& sample : samples) {
      bank.Step(sample);
      bank.Score(factors);
      benchmark::DoNotOptimize(factors.data());
    }
  }
  CountSamples(state, state.iterations() * kSamples);
}
BENCHMARK(PredictSideBySide<Paper>)->ArgsProduct({{11, 33}, {0, 1}});
BENCHMARK(PredictSideBySide<Extended>)->ArgsProduct({{45, 98}, {0, 1}});

// Valves of one model set in turn, each somewhere else in its cycle. Arguments
// 1 and 2: their number and the InstructionSet.
template <Models (*MakeModels)(int)>
void StepManyValves(benchmark::State& state) {
  EngineParts parts(MakeModels(static_cast<int>(state.range(0))));
  parts.instructions = static_cast<InstructionSet>(state.range(2));
  const auto valves = static_cast<std::size_t>(state.range(1));
  std::vector<ValveEngine> engines;
  std::vector<std::vector<Sample>> samples;
  for (std::size_t v = 0; v < valves; ++v) {
    engines.emplace_back(parts);
    samples.push_back(Samples(kRound, 7 * static_cast<int>(v), 0.0));
  }
  const auto round = [&] {
    for (std::size_t k = 0; k < kRound; ++k) {
      for (std::size_t v = 0; v < valves; ++v) {
        benchmark::DoNotOptimize(engines[v].Step(samples[v][k]));
        Later(samples[v][k], kRound);
      }
    }
  };
  round();
  for ([[maybe_unused]] auto _ : state) {
    round();
  }
  CountSamples(state,
               state.iterations() * kRound * static_cast<std::int64_t>(valves));
}
BENCHMARK(StepManyValves<Paper>)->ArgsProduct({{11, 33}, {8, 1000}, {0, 1}});
BENCHMARK(StepManyValves<Extended>)->ArgsProduct({{45, 98}, {8, 1000}, {0, 1}});

// 1000 engines of one model set; what each needs beside it.
template <Models (*MakeModels)(int)>
void MakeEngines(benchmark::State& state) {
  const Models models = MakeModels(static_cast<int>(state.range(0)));
  EnginePlans plans;
  double bytes = 0.0;
  for ([[maybe_unused]] auto _ : state) {
    std::vector<ValveEngine> engines;
    engines.reserve(kManyValves);
    const std::size_t before = HeapBytes();
    for (int i = 0; i < kManyValves; ++i) {
      engines.emplace_back(plans.For(models));
    }
    bytes = static_cast<double>(HeapBytes() - before) / kManyValves;
  }
  state.counters["bytes_per_engine"] = bytes;
}
BENCHMARK(MakeEngines<Paper>)->Arg(33)->Unit(benchmark::kMillisecond);
BENCHMARK(MakeEngines<Extended>)->Arg(98)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace fdi::bench
