#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/valve_engine.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::AddF6;
using tests::Noise;
using tests::PlantSample;

constexpr int kWindow = 200;

std::shared_ptr<const ModelSet> WatchedPlant(std::uint64_t content_hash = 42) {
  ModelSet models = tests::LinearPlant();
  models.content_hash = content_hash;
  models.channels[1].windows = {
      {kWindow, -0.8 * tests::kNoise, 0.8 * tests::kNoise, 3.0}};
  return std::make_shared<const ModelSet>(std::move(models));
}

// A shift of one deviation from sample 400 on, seen by its window alone.
Sample Drifting(int k, Noise& noise) {
  Sample sample = PlantSample(static_cast<std::uint64_t>(k));
  noise.Add(sample);
  if (k >= 400) {
    AddF6(sample, tests::kNoise / 20.0);
  }
  return sample;
}

struct Resumption {
  bool accepted{false};
  std::optional<int> detected;  // sample
};

// Stops after sample 499, begins again with sample `next` and, if `resume`,
// with what the stopped engine saved.
Resumption DetectionAfterRestart(int next, bool resume,
                                 std::uint64_t content_hash = 42) {
  Noise noise(3);
  ValveEngine before(WatchedPlant());
  for (int k = 0; k < 500; ++k) {
    EXPECT_EQ(before.Step(Drifting(k, noise)).transition_count, 0);
  }
  ValveEngine after(WatchedPlant(content_hash));
  Resumption result;
  if (resume) {
    result.accepted = after.Restore(before.Save());
  }
  for (int k = next; k < next + 600 && !result.detected; ++k) {
    if (after.Step(Drifting(k, noise)).detected) {
      result.detected = k;
    }
  }
  return result;
}

TEST(SnapshotTest, RestoredWindowsDetectWhereNewOnesHaveToFillFirst) {
  const Resumption with = DetectionAfterRestart(505, true);
  const Resumption without = DetectionAfterRestart(505, false);
  ASSERT_TRUE(with.accepted);
  ASSERT_TRUE(with.detected && without.detected);
  EXPECT_LT(*with.detected, 505 + kWindow - 20);
  EXPECT_GE(*without.detected, 505 + kWindow);
}

TEST(SnapshotTest, SnapshotOlderThanTenMinutesCountsForNothing) {
  const int next = 499 + 601;
  const Resumption with = DetectionAfterRestart(next, true);
  const Resumption without = DetectionAfterRestart(next, false);
  EXPECT_TRUE(with.accepted);
  EXPECT_EQ(with.detected, without.detected);
  EXPECT_NE(DetectionAfterRestart(next - 1, true).detected,
            DetectionAfterRestart(next - 1, false).detected);
}

TEST(SnapshotTest, SnapshotOfAnotherModelSetIsRefused) {
  EXPECT_FALSE(DetectionAfterRestart(505, true, 43).accepted);
}

TEST(SnapshotTest, DamagedSnapshotsAreRefused) {
  ValveEngine engine(WatchedPlant());
  for (int k = 0; k < 50; ++k) {
    engine.Step(PlantSample(static_cast<std::uint64_t>(k)));
  }
  const std::vector<std::byte> good = engine.Save();
  EXPECT_TRUE(engine.Restore(good));
  for (std::size_t size = 0; size < good.size(); ++size) {
    EXPECT_FALSE(engine.Restore({good.data(), size})) << size;
  }
  std::vector<std::byte> longer = good;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(engine.Restore(longer));
  std::vector<std::byte> other_format = good;
  other_format[0] ^= std::byte{0x80};
  EXPECT_FALSE(engine.Restore(other_format));
}

TEST(SnapshotTest, OpenEpisodeIsNotCarriedOn) {
  ValveEngine before(WatchedPlant());
  for (int k = 0; k < 100; ++k) {
    Sample sample = PlantSample(static_cast<std::uint64_t>(k));
    AddF6(sample, k >= 50 ? 1.0 : 0.0);
    before.Step(sample);
  }
  ASSERT_TRUE(before.episode_open());
  ValveEngine after(WatchedPlant());
  ASSERT_TRUE(after.Restore(before.Save()));
  EXPECT_FALSE(after.Step(PlantSample(100)).detected);
}

}  // namespace
}  // namespace fdi
