// Two monitors and a year of 1000 valves in the plant's history: how fast it is
// shipped, and how long the filters of the public views take.
//
//     fdi-bench-plant [EPISODES [BYTES OF EACH EVIDENCE]]
//
// On a PostgreSQL server of its own, as Debian configures it. Prints name, time
// [ms] and rows; exits with 1 if a limit is exceeded.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "plant/shipper.h"
#include "tests/storage/many_episodes.h"
#include "tests/storage/private_postgres.h"

namespace fdi::storage {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

bool TimeShipping(const std::filesystem::path& folder, const std::string& url,
                  std::int64_t episodes, int bytes) {
  double seconds = 0.0;
  for (const char* monitor : {"a", "b"}) {
    const DataDirectory data{folder / monitor};
    std::filesystem::create_directories(data.path);
    GenerateEpisodes(data.history(), episodes / 2,
                     *monitor == 'a' ? "aaaa" : "bbbb", bytes / 2);
    const auto start = Clock::now();
    Shipper(data, url, {"host", monitor}).Ship();
    seconds += SecondsSince(start);
  }
  const double rate = static_cast<double>(episodes) / seconds;
  std::printf(
      "%lld episodes with %d bytes of evidence each in %.1f s: %.0f/s\n",
      static_cast<long long>(episodes), bytes, seconds, rate);
  return rate >= 5000.0;
}

// Each column of fault_history by which one asks, and some together.
constexpr const char* kFilters[] = {
    "true",
    "episode_id = 'aaaa000000001000'",
    "valve_id = 'V0042'",
    "valve_id LIKE 'V004%'",
    "valve_id = 'none'",
    "fault = 'f7'",
    "fault = 'none'",
    "fault IS NULL",
    "valve_id = 'V0042' AND fault = 'f7'",
    "end_reason IS NULL",
    "end_reason = 'cleared'",
    "acked_by IS NULL",
    "acked_by = 'anna'",
    "label = 'true'",
    "label = 'false'",
    "model_set = 'paper@1'",
    "monitor = 'a'",
    "monitor = 'none'",
    "host = 'host'",
    "monitor = 'b' AND valve_id = 'V0042'",
    "monitor = 'b' AND fault = 'f7' AND acked_by IS NULL",
    "detected_utc >= '2026-06-01' AND detected_utc < '2026-07-01'",
    "detected_utc >= '2026-06-01' AND detected_utc < '2026-07-01' "
    "AND fault = 'f7'",
    "detected_utc < '2026-01-01' AND monitor = 'a'",
    "isolated_utc IS NULL",
    "cleared_utc IS NULL",
};

bool TimeFilters(PlantDatabase& plant) {
  bool good = true;
  for (const char* filter : kFilters) {
    const std::string query =
        std::string("SELECT * FROM fdi.fault_history WHERE ") + filter +
        " ORDER BY detected_utc DESC LIMIT 200";
    std::vector<double> times;
    int rows = 0;
    for (int i = 0; i < 5; ++i) {
      const auto start = Clock::now();
      rows = plant.Run(query).size();
      times.push_back(SecondsSince(start) * 1e3);
    }
    std::sort(times.begin(), times.end());
    std::printf("%-78s %6.1f ms %4d rows%s\n", filter, times[2], rows,
                times[2] > 50.0 ? "  TOO SLOW" : "");
    good &= times[2] <= 50.0;
  }
  return good;
}

int Main(std::int64_t episodes, int bytes) {
  PrivatePostgres server;
  server.Create("plant");
  PlantDatabase plant = PlantDatabase::Init(server.Url("plant"));
  const TemporaryDirectory folder;
  bool good = TimeShipping(folder.path(), server.Url("plant"), episodes, bytes);
  plant.Run("VACUUM ANALYZE");  // As autovacuum does within minutes.
  good &= TimeFilters(plant);
  return good ? 0 : 1;
}

}  // namespace
}  // namespace fdi::storage

int main(int argc, char** argv) {
  return fdi::storage::Main(argc > 1 ? std::atoll(argv[1]) : 100'000,
                            argc > 2 ? std::atoi(argv[2]) : 1200);
}
