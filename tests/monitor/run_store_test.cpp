#include "monitor/service/run_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/monitor/linear_models.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::monitor {
namespace {

constexpr std::uint64_t kDay = 86'400;  // samples

class RunStoreTest : public testing::Test {
 protected:
  std::vector<std::int64_t> RunLengths() {
    std::vector<std::int64_t> lengths;
    for (const auto& info : storage::RunStore(file_).List()) {
      lengths.push_back(info.samples);
    }
    return lengths;
  }

  storage::TemporaryDirectory directory_;
  const std::filesystem::path file_{directory_.path() / "runs.db"};
};

TEST_F(RunStoreTest, ARunThatIsADayLongIsFollowedByTheNext) {
  RunStore store(file_, "test");
  for (std::uint64_t k = 0; k < 3 * kDay; k += 600) {
    store.Append({"V1", PlantSample(k), Intake::kAccepted});
  }
  store.Close();

  EXPECT_THAT(RunLengths(), testing::ElementsAre(144, 144, 144));
  EXPECT_EQ(store.recorded(), 432U);
  for (const auto& info : storage::RunStore(file_).List()) {
    EXPECT_EQ(info.run.period_s, 1.0);
    EXPECT_EQ(info.state, storage::RunState::kComplete);
  }
}

// The period of the plant is 1 s; its clock ticks in ms, and gaps come first.
TEST_F(RunStoreTest, JitterIsNotThePeriod) {
  RunStore store(file_, "test");
  const auto append = [&](const char* valve, std::uint64_t k,
                          std::int64_t off_ns) {
    Sample sample = PlantSample(k);
    sample.stamp_ns += off_ns;
    store.Append({valve, sample, Intake::kAccepted});
  };
  for (std::uint64_t k = 0; k < 40; ++k) {
    append("blurred", k, k % 2 == 0 ? 0 : 1'000'000);
    append("rough", k, k == 1 ? 300'000'000 : 0);
    append("odd", k, static_cast<std::int64_t>(k) * 20'000'000);
  }
  append("short", 0, 0);
  append("short", 1, 1'000'000);
  store.Commit();
  append("short", 2, 0);
  store.Close();

  for (const auto& info : storage::RunStore(file_).List()) {
    EXPECT_EQ(info.run.period_s, info.run.valve_id == "odd" ? 1.02 : 1.0)
        << info.run.valve_id;
  }
}

TEST_F(RunStoreTest, AStampThatWasNotAcceptedEndsNoRun) {
  RunStore store(file_, "test");
  store.Append({"V1", PlantSample(0), Intake::kAccepted});
  store.Append({"V1", PlantSample(1), Intake::kAccepted});
  store.Append({"V1", PlantSample(5 * kDay), Intake::kPeriod});
  store.Append({"V1", PlantSample(2), Intake::kAccepted});
  store.Close();

  EXPECT_THAT(RunLengths(), testing::ElementsAre(4));
}

}  // namespace
}  // namespace fdi::monitor
