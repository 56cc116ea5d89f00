#include <random>

#include <gtest/gtest.h>

#include "base/error.h"
#include "storage/history/health.h"
#include "storage/history/healthy_hours.h"
#include "storage/history/history_database.h"
#include "storage/history/history_writer.h"
#include "storage/history/retention.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;

// An hour at 1 Hz of a valve with two channels that works in `bins` bins.
HealthHour Typical(const std::string& valve, std::int64_t hour, int bins,
                   std::mt19937& random) {
  std::normal_distribution<double> noise;
  HealthHour h;
  h.valve_id = valve;
  h.hour = hour;
  h.model_hash = 0xFEDC'BA98'7654'3210ULL;
  h.epoch = 2;
  h.flow_unit = FlowUnit::kTPerHour;
  h.seen_ms = 3'600'000;
  h.live_ms = 3'400'000;
  h.shut_ms = 12'000;
  h.live_samples = 3400;
  h.normal_factor = 3'300'000 + static_cast<std::int64_t>(9e3 * noise(random));
  h.travel = 180'000;
  h.reversals = 250;
  h.share = 640;
  h.counts.auto_ms = h.seen_ms;
  h.counts.path = 1'200'000 + static_cast<std::int64_t>(9e4 * noise(random));
  h.counts.turns = 40;
  h.counts.dead_band = 22'000;
  h.counts.opening = 900;
  h.counts.opening_offset = 300'000;
  h.counts.closing = 800;
  h.counts.closing_offset = -280'000;
  h.channels = {{Signal::kX, -7}, {Signal::kF, -7}};
  for (int b = 0; b < bins; ++b) {
    for (const double mean : {70.0, 50.0}) {
      const std::int64_t n = 3400 / bins;
      h.bins[static_cast<std::size_t>(5 + b)].push_back(
          {n, static_cast<std::int64_t>(30.0 * noise(random) * 60.0), n * 4000,
           n * static_cast<std::int64_t>(mean * 128)});
    }
  }
  return h;
}

class HealthRowsTest : public testing::Test {
 protected:
  HealthRowsTest() : writer_(directory_.path() / "history.db") {}
  std::vector<HealthHour> Stored(const std::string& valve = "V1") {
    return ReadHealth(writer_.database(),
                      {valve, -kHourNs * 1000, kHourNs * 100'000});
  }

  TemporaryDirectory directory_;
  HistoryWriter writer_;
  std::mt19937 random_{1};
};

TEST(HealthCodecTest, BytesGiveBackEveryNumber) {
  std::mt19937 random(2);
  HealthHour hour = Typical("V1", 400'000, 3, random);
  hour.alarm_ms = 1;
  hour.bins[9] = {{0, 0, 0, 0}, {1, -1, 1, -1LL << 62}};
  std::int64_t count = -3;
  for (const auto member : loop::kValveCounts) {
    hour.counts.*member = count++;
  }
  hour.AddStrength(19, 60, -30'000);
  hour.AddStrength(3, 61, 15'000);
  HealthHour back;
  back.valve_id = hour.valve_id;
  back.hour = hour.hour;
  back.model_hash = hour.model_hash;
  back.epoch = hour.epoch;
  back.live_ms = hour.live_ms;

  UnpackHealth(PackHealth(hour), back);

  EXPECT_EQ(back, hour);
}

TEST(HealthCodecTest, DamagedBytesAreRefused) {
  std::mt19937 random(3);
  HealthHour hour = Typical("V1", 1, 2, random);
  const auto bytes = PackHealth(hour);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    HealthHour back;
    EXPECT_THROW(UnpackHealth(std::span(bytes).first(size), back), DataError)
        << size;
  }
  auto later = bytes;
  later[0] = std::byte{9};
  HealthHour back;
  EXPECT_THROW(UnpackHealth(later, back), DataError);
}

TEST_F(HealthRowsTest, MinutesOfAnHourAddUpExactly) {
  HealthHour whole = Typical("V1", 7, 2, random_);
  std::vector<HealthHour> parts(60, whole);
  for (int i = 1; i < 60; ++i) {
    whole.Add(parts[static_cast<std::size_t>(i)]);
  }

  for (const HealthHour& part : parts) {
    Checkpoint checkpoint;
    checkpoint.health = {part};
    writer_.CommitCheckpoint(checkpoint);
  }

  EXPECT_EQ(Stored(), std::vector<HealthHour>{whole});
  Statement view =
      writer_.database().Prepare("SELECT hour_utc, hours FROM judged_hours");
  ASSERT_TRUE(view.Step());
  EXPECT_EQ(view.Text(0), "1970-01-01T07:00:00Z");
  EXPECT_DOUBLE_EQ(view.Double(1), static_cast<double>(whole.live_ms) / 3.6e6);
}

TEST_F(HealthRowsTest, HoursComeByTimeWithinTheWindow) {
  std::vector<HealthHour> hours;
  for (const std::int64_t hour : {5, 3, 4, 6}) {
    hours.push_back(Typical("V1", hour, 1, random_));
  }
  hours.push_back(Typical("V2", 4, 1, random_));
  Checkpoint checkpoint;
  checkpoint.health = hours;
  writer_.CommitCheckpoint(checkpoint);

  const auto read =
      ReadHealth(writer_.database(), {"V1", 3 * kHourNs + 1, 6 * kHourNs});
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].hour, 4);
  EXPECT_EQ(read[1].hour, 5);
  EXPECT_EQ(HealthValves(writer_.database(), "V*"),
            (std::vector<std::string>{"V1", "V2"}));
  EXPECT_EQ(HealthValves(writer_.database(), "*2"),
            std::vector<std::string>{"V2"});
}

TEST_F(HealthRowsTest, PruningTakesWhatIsOldAndNothingElse) {
  std::vector<HealthHour> hours;
  for (std::int64_t hour = 0; hour < 10; ++hour) {
    hours.push_back(Typical("V1", hour, 1, random_));
    hours.push_back(Typical("V2", hour, 1, random_));
  }
  Checkpoint checkpoint;
  checkpoint.health = hours;
  writer_.CommitCheckpoint(checkpoint);
  const auto path = directory_.path() / "history.db";

  RetentionLimits limits;
  limits.before_ns = 4 * kHourNs;
  limits.pause = {};
  limits.dry_run = true;
  EXPECT_EQ(PruneHealth(path, limits).deleted, 8);
  EXPECT_EQ(Stored().size(), 10u);
  limits.dry_run = false;
  EXPECT_EQ(PruneHealth(path, limits).deleted, 8);
  EXPECT_EQ(Stored().size(), 6u);
  EXPECT_EQ(Stored().front().hour, 4);
}

// The plant has V1 up to a change of its hour 1, and nothing of V2 yet.
TEST_F(HealthRowsTest, PruningKeepsWhatAPlantHasNot) {
  {
    Transaction transaction(writer_.database());
    writer_.database().Run(
        "INSERT INTO ship_cursor VALUES ('p', 8, 0, 0, 'V1')");
    transaction.Commit();
  }
  Checkpoint checkpoint;
  for (std::int64_t hour = 0; hour < 4; ++hour) {
    checkpoint.health.push_back(Typical("V1", hour, 1, random_));
    checkpoint.health.push_back(Typical("V2", hour, 1, random_));
  }
  writer_.CommitCheckpoint(checkpoint);  // Changes 1 to 8.
  checkpoint.health = {Typical("V1", 1, 1, random_)};
  writer_.CommitCheckpoint(checkpoint);

  RetentionLimits limits;
  limits.before_ns = 4 * kHourNs;
  limits.pause = {};
  const PruneResult result =
      PruneHealth(directory_.path() / "history.db", limits);

  EXPECT_EQ(result.deleted, 3);
  EXPECT_EQ(result.kept, 5);
  ASSERT_EQ(Stored().size(), 1u);
  EXPECT_EQ(Stored().front().hour, 1);
  EXPECT_EQ(Stored("V2").size(), 4u);
}

// 300 valves for a year in 0.4 GB are 152 bytes for an hour of a valve, pages
// and all. Fills a file as a monitor does: hour by hour, all valves.
TEST_F(HealthRowsTest, AnHourOfAValveTakesLessThan152Bytes) {
  constexpr int kValves = 20;
  constexpr int kHours = 24 * 60;
  const std::uintmax_t before = writer_.database().UsedBytes();
  for (int hour = 0; hour < kHours; ++hour) {
    std::vector<HealthHour> hours;
    for (int v = 0; v < kValves; ++v) {
      hours.push_back(Typical("FV-" + std::to_string(1000 + v), 480'000 + hour,
                              1 + v % 3, random_));
    }
    Checkpoint checkpoint;
    checkpoint.health = hours;
    writer_.CommitCheckpoint(checkpoint);
  }
  const double bytes =
      static_cast<double>(writer_.database().UsedBytes() - before) /
      (kValves * kHours);
  RecordProperty("bytes_per_hour_of_a_valve", std::to_string(bytes));
  EXPECT_LT(bytes, 152.0);
  EXPECT_GT(bytes, 60.0);
}

TEST_F(HealthRowsTest, HealthyHoursAreJudgedAndWithoutAnEpisode) {
  std::vector<HealthHour> hours;
  for (int i = 0; i < 30; ++i) {
    hours.push_back(Typical("V1", 400'000 + i, 1, random_));
    hours.back().share = 600 + i;
  }
  hours[3].live_ms = 3'000'000;   // not judged for long enough
  hours[4].alarm_ms = 1'000'000;  // an episode was open
  hours[5].share = 0;             // not known
  hours[0].model_hash = 1;        // of another model set
  hours.push_back(Typical("V2", 400'000, 1, random_));
  hours.back().model_hash = 0;  // nothing judges it
  {
    Transaction transaction(writer_.database());
    StoreHealth(writer_.database(), hours);
    transaction.Commit();
  }

  const std::vector<HealthyHours> valves = ReadHealthyHours(writer_.database());
  ASSERT_EQ(valves.size(), 1U);
  EXPECT_EQ(valves[0].valve_id, "V1");
  ASSERT_EQ(valves[0].hours.size(), 26U);
  EXPECT_EQ(valves[0].hours.front().hour, 400'029);
  EXPECT_NEAR(valves[0].hours.front().share, 0.629, 1e-9);
  EXPECT_NEAR(valves[0].hours.back().share, 0.601, 1e-9);
  EXPECT_EQ(valves[0].days, 2);
}

// Which of two is the newer one is not said by their hashes.
TEST_F(HealthRowsTest, InTheHourOfASwapTheNewSetCounts) {
  for (const bool greater : {false, true}) {
    const std::string id = greater ? "V2" : "V1";
    const std::uint64_t was = greater ? 7 : 8;
    std::vector<HealthHour> hours;
    for (const auto& [hour, hash] : {std::pair{1, 15 - was},
                                     {2, 15 - was},
                                     {3, was},
                                     {4, was},
                                     {5, was},
                                     {5, 15 - was}}) {
      hours.push_back(Typical(id, 400'000 + hour, 1, random_));
      hours.back().model_hash = hash;
    }
    const auto store = [&] {
      Transaction transaction(writer_.database());
      StoreHealth(writer_.database(), hours);
      transaction.Commit();
      return ReadHealthyHours(writer_.database()).back();
    };
    hours.erase(hours.begin(), hours.begin() + 2);
    EXPECT_EQ(store().model_hash, 15 - was);
    EXPECT_EQ(store().hours.size(), 1U);
    // An hour on, the part of the swap's hour counts, too; not the time before.
    hours = {Typical(id, 400'001, 1, random_),
             Typical(id, 400'006, 1, random_)};
    hours[0].model_hash = hours[1].model_hash = 15 - was;
    const HealthyHours valve = store();
    EXPECT_EQ(valve.model_hash, 15 - was);
    EXPECT_EQ(valve.epoch, 2U);
    EXPECT_EQ(valve.hours.size(), 2U);
  }
}

// V1 has 150 hours; of 2000 valves a tail takes 72 each.
TEST_F(HealthRowsTest, ManyValvesHaveHoursEnoughForTails) {
  std::vector<HealthHour> hours;
  for (int i = 0; i < 150; ++i) {
    hours.push_back(Typical("V1", 400'000 + i, 1, random_));
  }
  for (int v = 2; v <= 2000; ++v) {
    hours.push_back(Typical("V" + std::to_string(v), 400'149, 1, random_));
  }
  Transaction transaction(writer_.database());
  StoreHealth(writer_.database(), hours);
  transaction.Commit();

  EXPECT_EQ(ReadHealthyHours(writer_.database()).at(0).hours.size(), 150U);
}

// Each would raise what the budget needs, and have no part in it.
TEST_F(HealthRowsTest, ValvesThatAreGoneOrAuditedAloneAreLeftOut) {
  std::vector<HealthHour> hours = {Typical("V1", 400'168, 1, random_),
                                   Typical("V2", 400'000, 1, random_),
                                   Typical("V3", 399'999, 1, random_)};
  for (const int hour : {400'167, 400'168}) {
    hours.push_back(Typical("V4", hour, 1, random_));
  }
  hours.back().model_hash = 1;
  hours.back().share = 0;
  Transaction transaction(writer_.database());
  StoreHealth(writer_.database(), hours);
  transaction.Commit();

  const std::vector<HealthyHours> valves = ReadHealthyHours(writer_.database());
  ASSERT_EQ(valves.size(), 2U);
  EXPECT_EQ(valves[0].valve_id, "V1");
  EXPECT_EQ(valves[1].valve_id, "V2");
}

TEST_F(HealthRowsTest, ADamagedHourIsThatOfItsValveAlone) {
  {
    Transaction transaction(writer_.database());
    StoreHealth(writer_.database(),
                std::vector{Typical("V1", 400'000, 1, random_),
                            Typical("V2", 400'000, 1, random_)});
    writer_.database()
        .Prepare("UPDATE health_hour SET bytes = x'FF' WHERE valve_id = 'V1'")
        .Run();
    transaction.Commit();
  }

  const std::vector<HealthyHours> valves = ReadHealthyHours(writer_.database());
  ASSERT_EQ(valves.size(), 2U);
  EXPECT_TRUE(valves[0].damaged);
  EXPECT_TRUE(valves[0].hours.empty());
  EXPECT_FALSE(valves[1].damaged);
  EXPECT_EQ(valves[1].hours.size(), 1U);
}

}  // namespace
}  // namespace fdi::storage
