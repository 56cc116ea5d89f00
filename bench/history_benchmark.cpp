// A year of 1000 valves in history.db: how long the filters and the statistics
// of the public contract take, and what it costs to store many events at once.
//
//     fdi-bench-history [EPISODES]
//
// Prints name, time [ms] and rows; exits with 1 if a limit is exceeded.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"
#include "tests/storage/many_episodes.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kNow = kLastDetectedNs;

double MillisecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start)
      .count();
}

struct Query {
  const char* name;
  EpisodeFilter filter;
};

std::vector<Query> Queries() {
  std::vector<Query> queries;
  const auto add = [&queries](const char* name, const char* valve,
                              const char* fault,
                              EpisodeState state = EpisodeState::kAny) {
    EpisodeFilter filter;
    filter.valve_glob = valve;
    filter.fault = fault;
    filter.state = state;
    filter.limit = 200;
    queries.push_back({name, filter});
  };
  add("newest", "*", "");
  add("valve", "V0042", "");
  add("valve prefix", "V004*", "");
  add("valve glob, none", "X*", "");
  add("fault", "*", "f7");
  add("fault, none", "*", "t1");
  add("unknown", "*", "unknown");
  add("open", "*", "", EpisodeState::kOpen);
  add("isolated", "*", "", EpisodeState::kIsolated);
  add("closed", "*", "", EpisodeState::kClosed);
  add("unacked", "*", "", EpisodeState::kUnacked);
  add("valve, fault", "V0042", "f7");
  add("glob, fault", "V004*", "f7");
  add("glob, unknown", "V004*", "unknown");
  add("glob, unacked", "V004*", "", EpisodeState::kUnacked);
  add("glob, fault, unacked", "V004*", "f7", EpisodeState::kUnacked);
  add("unknown, unacked", "*", "unknown", EpisodeState::kUnacked);
  add("month of last winter", "*", "");
  queries.back().filter.since_ns = kNow - kYear / 2 * kSecond;
  queries.back().filter.until_ns = kNow - kYear * 5 / 12 * kSecond;
  return queries;
}

// The median of five, each with a connection of its own as the program has.
template <typename Ask>
double MedianOf(Ask ask) {
  std::vector<double> times;
  for (int i = 0; i < 5; ++i) {
    const auto start = Clock::now();
    ask();
    times.push_back(MillisecondsSince(start));
  }
  std::sort(times.begin(), times.end());
  return times[2];
}

bool Report(const char* name, double ms, double limit_ms, std::size_t rows) {
  std::printf("%-28s %8.1f ms  limit %4.0f ms  %6zu rows%s\n", name, ms,
              limit_ms, rows, ms > limit_ms ? "  TOO SLOW" : "");
  return ms <= limit_ms;
}

bool TimeQueries(const std::filesystem::path& path) {
  bool good = true;
  for (const Query& query : Queries()) {
    std::size_t rows = 0;
    const double ms =
        MedianOf([&] { rows = HistoryReader(path).List(query.filter).size(); });
    good &= Report(query.name, ms, 50.0, rows);
  }
  EpisodeFilter month;
  month.since_ns = kNow - kYear / 12 * kSecond;
  for (const auto& [name, filter] :
       {Query{"statistics", {}}, Query{"statistics of a month", month}}) {
    std::size_t rows = 0;
    const double ms = MedianOf([&] {
      rows = HistoryReader(path).AlarmFigures(filter, kNow).valves.size();
    });
    good &= Report(name, ms, 500.0, rows);
  }
  return good;
}

// 100 valves fail in the same sample: three hundred events.
void TimeEvents(const std::filesystem::path& path) {
  auto models = std::make_shared<ModelSet>();
  models->name = "demo";
  models->faults = {1, 7};
  HistoryWriter writer(path);
  const auto record = [&](std::int64_t base) {
    for (int v = 0; v < 300; ++v) {
      FaultEvent event;
      event.valve_id = std::string("B").append(std::to_string(v));
      event.source_id = 1;
      event.transition.kind = TransitionKind::kDetected;
      event.transition.stamp_ns = base;
      event.transition.detection_stamp_ns = base;
      event.episode_id = EpisodeId(event.valve_id, 1, base);
      event.models = models;
      writer.Record(event, base);
    }
  };
  auto start = Clock::now();
  record(kNow + kSecond);
  const double alone = MillisecondsSince(start);
  start = Clock::now();
  writer.CommitBatch([&] { record(kNow + 2 * kSecond); });
  std::printf("300 events, a commit each: %.1f ms; one batch: %.1f ms\n", alone,
              MillisecondsSince(start));
}

int Main(std::int64_t episodes) {
  const TemporaryDirectory directory;
  const auto path = directory.path() / "history.db";
  GenerateEpisodes(path, episodes);
  std::printf("%lld episodes of 1000 valves, %.1f MB\n",
              static_cast<long long>(episodes),
              static_cast<double>(std::filesystem::file_size(path)) / 1e6);
  const bool good = TimeQueries(path);
  TimeEvents(path);
  return good ? 0 : 1;
}

}  // namespace
}  // namespace fdi::storage

int main(int argc, char** argv) {
  return fdi::storage::Main(argc > 1 ? std::atoll(argv[1]) : 100'000);
}
