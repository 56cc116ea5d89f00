#include "monitor/health_book.h"

#include <cmath>
#include <random>
#include <utility>

#include <gtest/gtest.h>

#include "monitor/checkpoint.h"
#include "monitor/valve_monitor.h"
#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"
#include "tests/monitor/test_support.h"

namespace fdi::monitor {
namespace {

constexpr std::int64_t kHour = 3600 * kSecond;

Sample At(std::int64_t stamp_ns, double cv, double x) {
  Sample sample = PlantSample(0);
  sample.stamp_ns = stamp_ns;
  sample.Set(Signal::kCv, cv);
  sample.Set(Signal::kX, x);
  return sample;
}

Verdict Live(double residual, double normal_factor = 1.0) {
  Verdict verdict;
  verdict.quality = Quality::kLive;
  verdict.residuals[0] = residual;
  verdict.normal_factor = normal_factor;
  return verdict;
}

std::vector<HealthHour> Taken(HealthBook& book) {
  std::vector<HealthHour> hours;
  book.DrainInto("V1", hours);
  return hours;
}

double Mean(const ResidualSums& sums, const HealthChannel& channel) {
  return static_cast<double>(sums.residual) /
         static_cast<double>(sums.samples) * channel.quantum();
}

TEST(StrokeCountTest, NoiseBelowTheDeadBandIsNoTravel) {
  StrokeCount count;
  count.Push(50.0);
  for (const double x : {50.4, 49.7, 50.9, 50.1}) {
    EXPECT_EQ(count.Push(x).travel, 0.0) << x;
  }
}

TEST(StrokeCountTest, TravelGoesThereAndBackAndTurnsCount) {
  StrokeCount count;
  double travel = 0.0;
  int reversals = 0;
  for (const double x : {50.0, 60.0, 70.0, 69.5, 71.0, 40.0, 39.5, 80.0}) {
    const StrokeCount::Step step = count.Push(x);
    travel += step.travel;
    reversals += step.reversal ? 1 : 0;
  }
  EXPECT_DOUBLE_EQ(travel, 21.0 + 31.5 + 40.5);
  EXPECT_EQ(reversals, 2);
}

TEST(HealthBookTest, ResidualsAreBookedByTheBinOfTheCommand) {
  const ModelSet models = LinearModels();
  HealthBook book;
  for (int i = 0; i < 100; ++i) {
    book.Add(At(i * kSecond, 25.0, 24.0), Live(i % 2 == 0 ? 1.5 : 0.5), &models,
             1.0);
    book.Add(At(i * kSecond, 99.9, 80.0), Live(-2.0), &models, 1.0);
  }

  const auto hours = Taken(book);
  ASSERT_EQ(hours.size(), 1u);
  const HealthChannel& x = hours[0].channels.at(0);
  const ResidualSums& low = hours[0].bins[2].at(0);
  EXPECT_EQ(low.samples, 100);
  EXPECT_NEAR(Mean(low, x), 1.0, x.quantum());
  EXPECT_NEAR(
      static_cast<double>(low.square) / 100.0 * x.quantum() * x.quantum(), 1.25,
      0.01);
  EXPECT_NEAR(static_cast<double>(low.output) / 100.0 * x.quantum(), 24.0,
              x.quantum());
  EXPECT_NEAR(Mean(hours[0].bins[9].at(0), x), -2.0, x.quantum());
  EXPECT_TRUE(hours[0].bins[5].empty());
}

TEST(HealthBookTest, OnlyLiveSamplesHaveResidualsAllHaveTime) {
  const ModelSet models = LinearModels();
  HealthBook book;
  Verdict uncovered = Live(3.0);
  uncovered.quality = Quality::kUncovered;
  book.Add(At(0, 50.0, 0.5), uncovered, &models, 0.5);
  book.Add(At(kSecond / 2, 50.0, 99.5), Live(0.0, 0.25), &models, 0.5);

  const auto hours = Taken(book);
  ASSERT_EQ(hours.size(), 1u);
  EXPECT_EQ(hours[0].seen_ms, 1000);
  EXPECT_EQ(hours[0].live_ms, 500);
  EXPECT_EQ(hours[0].open_ms, 500);
  EXPECT_EQ(hours[0].shut_ms, 500);
  EXPECT_EQ(hours[0].live_samples, 1);
  EXPECT_EQ(hours[0].normal_factor, 250);
  EXPECT_EQ(hours[0].bins[5].at(0).samples, 1);
  EXPECT_EQ(hours[0].travel, 99'000);
}

TEST(HealthBookTest, SingleReadingsAreCountedBySignal) {
  const ModelSet models = LinearModels();
  HealthBook book;
  for (int i = 0; i < 4; ++i) {
    Verdict verdict = Live(0.0);
    verdict.single = i < 3 ? MaskOf(Signal::kF) : MaskOf(Signal::kX);
    book.Add(At(i * kSecond, 50.0, 30.0), verdict, &models, 1.0);
  }
  const auto hours = Taken(book);
  EXPECT_EQ(hours.at(0).counts.single_f, 3);
  EXPECT_EQ(hours.at(0).counts.single_x, 1);
  EXPECT_EQ(hours.at(0).counts.single_t1, 0);
}

TEST(HealthBookTest, StrengthIsOfWhatIsIsolated) {
  const ModelSet models = LinearModels();  // f1, f7
  HealthBook book;
  Verdict verdict = Live(10.0);
  verdict.detected = true;
  verdict.isolated = 2;
  verdict.strengths[0] = 0.9;
  verdict.strengths[1] = -0.5;
  book.Add(At(0, 50.0, 30.0), verdict, &models, 1.0);
  book.Add(At(kSecond, 50.0, 30.0), verdict, &models, 1.0);

  const auto hours = Taken(book);
  EXPECT_EQ(hours.at(0).strengths, (std::vector<StrengthSums>{{7, 2, -1000}}));
  EXPECT_EQ(hours[0].alarm_ms, 2000);
}

TEST(HealthBookTest, HourModelSetAndEpochEachBeginAnotherRow) {
  const ModelSet models = LinearModels();
  ModelSet next = models;
  next.content_hash = 7;
  HealthBook book;
  Sample sample = At(kHour - kSecond, 50.0, 50.0);
  book.Add(sample, Live(0.0), &models, 1.0);
  sample.stamp_ns = kHour;
  book.Add(sample, Live(0.0), &models, 1.0);
  book.Add(sample, Live(0.0), &next, 1.0);
  sample.epoch = 3;
  book.Add(sample, Live(0.0), &next, 1.0);

  const auto hours = Taken(book);
  ASSERT_EQ(hours.size(), 4u);
  EXPECT_EQ(hours[0].hour, 0);
  EXPECT_EQ(hours[1].hour, 1);
  EXPECT_EQ(hours[2].model_hash, 7u);
  EXPECT_EQ(hours[3].epoch, 3u);
  EXPECT_TRUE(Taken(book).empty());
}

// A rod of a play of 1.2 %: what is counted belongs to the hour, and a gap or
// another source is no movement.
TEST(HealthBookTest, CountsBelongToTheHourAndAreNotMadeOverAGap) {
  HealthBook book;
  const auto give = [&book](std::int64_t from_s, int length,
                            std::uint64_t source) {
    double x = 39.4;
    for (int k = 0; k < length; ++k) {
      const double cv = k < 200 ? 40.0 + 0.1 * k : 80.0 - 0.1 * k;
      x = std::clamp(x, cv - 0.6, cv + 0.6);
      Sample sample = At((from_s + k) * kSecond, cv, x);
      sample.source_id = source;
      sample.mode = k % 2 == 0 ? ValveMode::kAuto : ValveMode::kManual;
      book.Add(sample, Live(0.0), nullptr, 1.0);
    }
  };
  give(0, 400, 1);
  const auto once = Taken(book);
  ASSERT_EQ(once.size(), 1u);
  EXPECT_EQ(once[0].counts.turns, 1);
  EXPECT_NEAR(static_cast<double>(once[0].counts.dead_band), 1200.0, 2.0);
  EXPECT_EQ(once[0].counts.auto_ms, 200'000);

  give(500, 400, 1);
  give(900, 400, 2);
  const auto twice = Taken(book);
  ASSERT_EQ(twice.size(), 1u);
  EXPECT_EQ(twice[0].counts.turns, 2);
  EXPECT_EQ(twice[0].counts.path, 2 * once[0].counts.path);
}

TEST(HealthBookTest, PartsMergeToTheWholeExactly) {
  const ModelSet models = LinearModels();
  HealthBook whole;
  HealthBook cut;
  Checkpoint merged;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.1, 1.0);
  for (int i = 0; i < 5000; ++i) {
    const Sample sample =
        At(i * kSecond, 50.0 + 20.0 * std::sin(i * 0.01), 50.0 + noise(random));
    const Verdict verdict = Live(noise(random), 0.9);
    whole.Add(sample, verdict, &models, 1.0);
    cut.Add(sample, verdict, &models, 1.0);
    if (i % 61 == 0) {
      Checkpoint part;
      cut.DrainInto("V1", part.health);
      merged = Merged(std::move(merged), std::move(part));
    }
  }
  Checkpoint rest;
  cut.DrainInto("V1", rest.health);
  merged = Merged(std::move(merged), std::move(rest));

  EXPECT_EQ(merged.health, Taken(whole));
}

TEST(HealthBooksTest, WhatAMonitorSaysIsHandedOverWithTheCheckpoint) {
  const auto models = SharedLinearModels();
  ValveMonitor valve("V1", EngineParts(models), {});
  FakeOutlet outlet;
  Counters counters;
  HealthBooks books(counters);
  const auto give = [&](const Sample& sample) {
    books.OnVerdict("V1", sample, valve.Step(sample, 1, {}, outlet));
  };
  for (std::uint64_t k = 0; k < 60; ++k) {
    give(PlantSample(k));
  }
  give(PlantSample(5));  // Late: no time.

  Checkpoint checkpoint;
  books.TakeCheckpoint(checkpoint, true);
  EXPECT_TRUE(checkpoint.empty());
  books.TakeCheckpoint(checkpoint, false);
  ASSERT_EQ(checkpoint.health.size(), 1u);
  EXPECT_EQ(checkpoint.health[0].valve_id, "V1");
  EXPECT_EQ(checkpoint.health[0].seen_ms, 60'000);
  EXPECT_EQ(checkpoint.health[0].live_ms, (60 - kSettlingSamples) * 1000);
  EXPECT_EQ(checkpoint.health[0].bins[5].at(0).samples, 60 - kSettlingSamples);
  EXPECT_EQ(counters[Counter::kReversals],
            static_cast<std::uint64_t>(checkpoint.health[0].reversals));
}

}  // namespace
}  // namespace fdi::monitor
