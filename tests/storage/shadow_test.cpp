#include "storage/history/shadow.h"

#include <gmock/gmock.h>

#include "storage/history/history_database.h"
#include "storage/history/history_writer.h"
#include "storage/history/retention.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;
using testing::SizeIs;

class ShadowTest : public HistoryFixture {
 protected:
  static ShadowDifference Stretch(const std::string& valve, double from_s,
                                  std::int64_t samples) {
    ShadowDifference d;
    d.valve_id = valve;
    d.source_id = 0xF00D'0000'0000'0001ULL;  // Beyond a signed integer.
    d.from_ns = kDetected + static_cast<std::int64_t>(from_s * 1e9);
    d.to_ns = d.from_ns + (samples - 1) * kSecond;
    d.samples = samples;
    d.active_set = "demo@3";
    d.active_hash = 0xFEDC'BA98'7654'3210ULL;
    d.active.state = State::kIsolated;
    d.active.fault = "f1|f7";
    d.candidate_set = "demo@4";
    d.candidate_hash = 4;
    d.candidate.state = State::kDetected;
    return d;
  }
  void Keep(const std::vector<ShadowDifference>& stretches) {
    Transaction transaction(database_);
    StoreShadow(database_, stretches);
    transaction.Commit();
  }

  Database database_{path_, HistorySchema(), Access::kOccasionalWriter};
};

TEST_F(ShadowTest, StretchReadsBackWhole) {
  Keep({Stretch("LV-1", 0, 10)});

  const auto read = ListShadow(database_);

  ASSERT_THAT(read, SizeIs(1));
  const ShadowDifference d = Stretch("LV-1", 0, 10);
  EXPECT_EQ(read[0].source_id, d.source_id);
  EXPECT_EQ(read[0].to_ns, d.to_ns);
  EXPECT_EQ(read[0].active_hash, d.active_hash);
  EXPECT_EQ(read[0].active.fault, "f1|f7");
  EXPECT_EQ(read[0].candidate.state, State::kDetected);
  EXPECT_EQ(read[0].candidate.fault, "");
}

TEST_F(ShadowTest, StretchGrowsAndNeverShrinks) {
  Keep({Stretch("LV-1", 0, 10)});
  Keep({Stretch("LV-1", 0, 30)});
  Keep({Stretch("LV-1", 0, 20)});
  EXPECT_THAT(ListShadow(database_),
              ElementsAre(Field(&ShadowDifference::samples, 30)));
}

TEST_F(ShadowTest, FiltersAreValveCandidateTimeAndNumber) {
  ShadowDifference other = Stretch("LV-3", 300, 10);
  other.candidate_set = "demolished@4";
  Keep({Stretch("LV-1", 100, 10), Stretch("PV-2", 200, 10), other});
  const auto valves = [this](const ShadowFilter& filter) {
    std::vector<std::string> names;
    for (const ShadowDifference& d : ListShadow(database_, filter)) {
      names.push_back(d.valve_id);
    }
    return names;
  };

  EXPECT_THAT(valves({}), ElementsAre("LV-1", "PV-2", "LV-3"));
  EXPECT_THAT(valves({.valve_glob = "LV*"}), ElementsAre("LV-1", "LV-3"));
  EXPECT_THAT(valves({.candidate = "demo"}), ElementsAre("LV-1", "PV-2"));
  EXPECT_THAT(valves({.candidate = "demo@4"}), ElementsAre("LV-1", "PV-2"));
  EXPECT_THAT(valves({.candidate = "demo@5"}), IsEmpty());
  EXPECT_THAT(valves({.since_ns = kDetected + 150 * kSecond}),
              ElementsAre("PV-2", "LV-3"));
  EXPECT_THAT(valves({.until_ns = kDetected + 200 * kSecond}),
              ElementsAre("LV-1"));
  EXPECT_THAT(valves({.limit = 1}), ElementsAre("LV-3"));
}

TEST_F(ShadowTest, OldStretchesArePruned) {
  Keep({Stretch("LV-1", 0, 10), Stretch("LV-1", 100, 10)});
  RetentionLimits limits;
  limits.before_ns = kDetected + 50 * kSecond;
  limits.dry_run = true;
  EXPECT_EQ(PruneShadow(path_, limits).deleted, 1);
  EXPECT_THAT(ListShadow(database_), SizeIs(2));

  limits.dry_run = false;
  EXPECT_EQ(PruneShadow(path_, limits).deleted, 1);

  EXPECT_THAT(ListShadow(database_),
              ElementsAre(Field(&ShadowDifference::from_ns,
                                kDetected + 100 * kSecond)));
}

TEST_F(ShadowTest, AccumulatorsAreThoseKeptLast) {
  const std::vector<std::byte> old(3, std::byte{1});
  const std::vector<std::byte> fresh(5, std::byte{2});
  HistoryWriter writer(path_);
  Checkpoint checkpoint;
  checkpoint.shadow_accumulators = {{"LV-1", 1, 0x9999, 10, old}};
  writer.CommitCheckpoint(checkpoint);
  checkpoint.shadow_accumulators = {
      {"LV-1", 2, 0xFFFF'0000'0000'0000ULL, 20, fresh}};
  writer.CommitCheckpoint(checkpoint);

  const auto read = writer.ShadowAccumulators();

  ASSERT_THAT(read, SizeIs(1));
  EXPECT_EQ(read[0].model_hash, 0xFFFF'0000'0000'0000ULL);
  EXPECT_EQ(read[0].bytes, fresh);
}

}  // namespace
}  // namespace fdi::storage
