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
