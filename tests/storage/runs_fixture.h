#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "storage/runs/runs.h"
#include "tests/storage/message_of.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {

inline constexpr std::int64_t kSecond = 1'000'000'000;
inline constexpr std::int64_t kStart = 1'700'000'000 * kSecond;

inline NewRun RunOf(const std::string& valve) {
  NewRun run;
  run.valve_id = valve;
  run.source_id = 0xFEDCBA9876543210;
  run.start_ns = kStart;
  run.software = "test";
  return run;
}

inline StoredSample SampleAt(std::int64_t k, int valve = 0) {
  StoredSample stored;
  stored.sample.stamp_ns = kStart + k * kSecond;
  stored.sample.source_id = 0xFEDCBA9876543210;
  stored.sample.seq = static_cast<std::uint64_t>(k);
  stored.sample.Set(Signal::kCv, 50.0 + valve);
  stored.sample.Set(Signal::kX, std::sin(0.1 * static_cast<double>(k)));
  return stored;
}

/// A runs.db of its own.
class RunsFixture : public ::testing::Test {
 protected:
  /// Content of a run, as its samples' positions.
  std::vector<std::int64_t> Positions(const std::string& selector) {
    RunStore store(file_);
    std::vector<std::int64_t> positions;
    for (const StoredSample& s : store.Load(selector).samples) {
      positions.push_back((s.sample.stamp_ns - kStart) / kSecond);
    }
    return positions;
  }
  std::int64_t Query(const std::string& sql) {
    Database database(file_, RunsSchema(), Access::kReader);
    return database.QueryInt64(sql).value_or(-1);
  }

  TemporaryDirectory directory_;
  std::filesystem::path file_{directory_.path() / "runs.db"};
};

}  // namespace fdi::storage
