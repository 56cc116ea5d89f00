// A candidate beside the active set in the built monitor, over DDS.
#include "storage/history/shadow.h"

#include <csignal>

#include <gmock/gmock.h>

#include "storage/history/history_reader.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

class ShadowTest : public MonitorFixture {
 protected:
  // linear@1 is active; linear@2 does not know f7.
  void SetUp() override {
    StoreModels(data_, LinearModels());
    ModelSet candidate = LinearModels();
    candidate.observers.pop_back();
    candidate.faults = {1};
    storage::ModelStore store(data_ / "models.db",
                              storage::Access::kOccasionalWriter);
    store.Save(candidate);
  }
  std::vector<ShadowDifference> Stretches() const {
    storage::HistoryReader history(data_ / "history.db");
    return storage::ListShadow(history.database());
  }
};

TEST_F(ShadowTest, DifferencesAreRecordedOverARestartAndNotPublished) {
  auto monitor = StartMonitor({"--shadow", "linear"});  // The newest: @2.
  Publish(0, 50);
  Publish(50, 90, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated));
  ASSERT_TRUE(AwaitVectors(90));
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();

  ASSERT_THAT(Stretches(), SizeIs(1));
  const ShadowDifference first = Stretches()[0];
  EXPECT_EQ(first.valve_id, "V1");
  EXPECT_EQ(first.active_set, "linear@1");
  EXPECT_EQ(first.active.state, State::kIsolated);
  EXPECT_EQ(first.active.fault, "f7");
  EXPECT_EQ(first.candidate_set, "linear@2");
  EXPECT_EQ(first.candidate.state, State::kDetected);
  EXPECT_EQ(first.candidate.fault, "");
  for (const auto& event : faults_) {
    EXPECT_EQ(event.model_hash, first.active_hash);
  }

  ASSERT_TRUE(Await([this] {
    return decisions_->status().matched == 0 && samples_->matched() == 0;
  }));
  monitor = StartMonitor({"--shadow", "linear@2"});
  Publish(90, 150, kF7Offset);
  ASSERT_TRUE(Await([this] { return vectors_.back().verdict.seq == 149; }));
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  ASSERT_THAT(Stretches(), SizeIs(2));
  EXPECT_EQ(Stretches()[0].samples, first.samples);
  EXPECT_EQ(Stretches()[1].active.fault, "f7");
}

TEST_F(ShadowTest, CandidateThatIsNotThereEndsTheProgram) {
  ChildProcess monitor(Command({"--shadow", "linear@9"}));
  EXPECT_EQ(monitor.AwaitExit(), 5);
  EXPECT_THAT(monitor.errors(),
              AllOf(HasSubstr("linear@9"), HasSubstr("linear@2")));
}

}  // namespace
}  // namespace fdi::monitor
