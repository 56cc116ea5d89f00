// Samples to runs.db against a bare prepared insert of the same rows in the
// same run, and the bytes per sample that are left on disk.
//
//     fdi-bench-recording [VALVES [SAMPLES_PER_VALVE]]
//
// Six noisy signals at the resolution of their transmitters: 16 bits of span,
// or one decimal. Commits of 100 000 samples, as the monitor's under load.
// Exits with 1 below half the speed of the bare insert or above 20 byte.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "bench/cpu_seconds.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kCommit = 100'000;
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kStart = 1'795'186'571 * kSecond;

struct Range {
  Signal signal;
  double low;
  double span;
};
constexpr Range kRanges[] = {
    {Signal::kCv, 0.0, 100.0},  {Signal::kP1, 0.0, 4000.0},
    {Signal::kP2, 0.0, 4000.0}, {Signal::kT1, 0.0, 200.0},
    {Signal::kX, 0.0, 100.0},   {Signal::kF, 0.0, 250.0}};

enum class Resolution { kConverter, kDecimal };

double Read(double value, const Range& range, Resolution resolution) {
  if (resolution == Resolution::kDecimal) {
    return std::round(value * 10.0) / 10.0;
  }
  const double step = range.span / 65535.0;
  return range.low + step * std::round((value - range.low) / step);
}

// Sample by sample in the order of reception: all valves at k, then at k + 1.
class Plant {
 public:
  Plant(std::size_t valves, Resolution resolution)
      : valves_(valves), resolution_(resolution) {}

  std::vector<StoredSample> Next() {
    std::vector<StoredSample> samples(valves_);
    for (std::size_t v = 0; v < valves_; ++v) {
      Sample& sample = samples[v].sample;
      sample.source_id = v;
      sample.seq = k_;
      sample.stamp_ns = kStart + static_cast<std::int64_t>(k_) * kSecond;
      for (const Range& range : kRanges) {
        const double swing =
            std::sin(0.01 * static_cast<double>(k_ + 100 * v)) * 0.1;
        const double noise = noise_(random_) * 0.002;
        sample.Set(range.signal,
                   Read(range.low + range.span * (0.5 + swing + noise), range,
                        resolution_));
      }
    }
    ++k_;
    return samples;
  }

 private:
  std::size_t valves_;
  Resolution resolution_;
  std::uint64_t k_{0};
  std::mt19937_64 random_{7};
  std::normal_distribution<double> noise_;
};

struct Outcome {
  double seconds{0.0};
  double cpu{0.0};
  double bytes{0.0};  // per sample
};

/// Calls `work(rounds)` for all samples, generated outside the clock.
template <typename Work>
Outcome Measure(std::size_t samples, Work work) {
  const double cpu = CpuSeconds();
  const auto start = Clock::now();
  const std::uintmax_t bytes = work();
  return {std::chrono::duration<double>(Clock::now() - start).count(),
          CpuSeconds() - cpu,
          static_cast<double>(bytes) / static_cast<double>(samples)};
}

using Rounds = std::vector<std::vector<StoredSample>>;

std::uintmax_t Record(const std::filesystem::path& path, const Rounds& rounds) {
  std::uintmax_t bytes = 0;
  {
    RunRecorder recorder(path);
    std::vector<RunRecorder::Key> keys;
    for (std::size_t v = 0; v < rounds[0].size(); ++v) {
      NewRun run;
      run.valve_id = std::string("V").append(std::to_string(v));
      run.source_id = v;
      run.start_ns = kStart;
      run.period_s = 1.0;
      run.origin = RunOrigin::kRecorded;
      run.software = "bench";
      keys.push_back(recorder.Begin(run));
    }
    for (const auto& round : rounds) {
      for (std::size_t v = 0; v < round.size(); ++v) {
        recorder.Append(keys[v], round[v]);
      }
      if (static_cast<std::size_t>(recorder.pending()) >= kCommit) {
        recorder.Commit();
      }
    }
    recorder.Close();
    bytes = recorder.database().UsedBytes();
  }
  return bytes;
}

const Schema& BareSchema() {
  static const Schema schema{
      "bare",
      0x42415245,
      Synchronous::kNormal,
      {"CREATE TABLE sample (run INTEGER, seq INTEGER, stamp_ns INTEGER, "
       "present INTEGER, intake INTEGER, cv REAL, p1 REAL, p2 REAL, t1 REAL, "
       "x REAL, f REAL) STRICT"}};
  return schema;
}

std::uintmax_t InsertBare(const std::filesystem::path& path,
                          const Rounds& rounds) {
  Database database(path, BareSchema(), Access::kWriter);
  Statement insert = database.Prepare(
      "INSERT INTO sample VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  std::optional<Transaction> transaction;
  std::size_t pending = 0;
  for (const auto& round : rounds) {
    if (!transaction) {
      transaction.emplace(database);
    }
    for (const StoredSample& stored : round) {
      const Sample& s = stored.sample;
      insert
          .Bind(s.source_id, s.seq, s.stamp_ns, s.present, stored.intake,
                s[Signal::kCv], s[Signal::kP1], s[Signal::kP2], s[Signal::kT1],
                s[Signal::kX], s[Signal::kF])
          .Run();
    }
    pending += round.size();
    if (pending >= kCommit) {
      transaction->Commit();
      transaction.reset();
      pending = 0;
    }
  }
  if (transaction) {
    transaction->Commit();
    transaction.reset();
  }
  database.Checkpoint();
  return database.UsedBytes();
}

bool Compare(const char* name, Resolution resolution, std::size_t valves,
             std::size_t count) {
  Plant plant(valves, resolution);
  Rounds rounds;
  for (std::size_t k = 0; k < count; ++k) {
    rounds.push_back(plant.Next());
  }
  const std::size_t samples = valves * count;
  const TemporaryDirectory directory;
  const auto in = [&](const char* file) { return directory.path() / file; };
  const Outcome bare =
      Measure(samples, [&] { return InsertBare(in("bare.db"), rounds); });
  const Outcome runs =
      Measure(samples, [&] { return Record(in("runs.db"), rounds); });
  const double ratio = bare.seconds / runs.seconds;
  const auto n = static_cast<double>(samples);
  std::printf(
      "%-10s bare %7.0f samples/s (CPU %.2f s) %5.1f B | runs.db %7.0f "
      "samples/s (CPU %.2f s) %5.1f B | ratio %.2f\n",
      name, n / bare.seconds, bare.cpu, bare.bytes, n / runs.seconds, runs.cpu,
      runs.bytes, ratio);
  return ratio >= 0.5 && runs.bytes <= 20.0;
}

}  // namespace
}  // namespace fdi::storage

int main(int argc, char** argv) {
  using fdi::storage::Resolution;
  const auto argument = [&](int i, std::size_t otherwise) {
    return argc > i ? static_cast<std::size_t>(std::atoll(argv[i])) : otherwise;
  };
  const std::size_t valves = argument(1, 100);
  const std::size_t count = argument(2, 6000);
  const bool converter =
      fdi::storage::Compare("16 bits", Resolution::kConverter, valves, count);
  const bool decimal =
      fdi::storage::Compare("0.1", Resolution::kDecimal, valves, count);
  return converter && decimal ? 0 : 1;
}
