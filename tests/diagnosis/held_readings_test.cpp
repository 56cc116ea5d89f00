// Repeats of a transmitter that is polled.
#include "diagnosis/model/held_readings.h"

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/decision.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

constexpr int kPoll = 30;

// X as it was at the last poll, in steps of `resolution`.
Sample Polled(int k, double resolution, int poll = kPoll) {
  Sample sample = tests::PlantSample(static_cast<std::uint64_t>(k));
  const int at = k - k % poll;
  const double x =
      tests::PlantSample(static_cast<std::uint64_t>(at))[Signal::kX] +
      0.07 * ((at / poll) % 5);
  sample.Set(Signal::kX, resolution * std::round(x / resolution));
  return sample;
}

bool IsHeld(const Sample& sample, Signal signal) {
  return (sample.uncertain() & MaskOf(signal)) != 0;
}

TEST(HeldReadingsTest, RepeatsOfAPolledPositionAreUncertain) {
  HeldReadings held(1.0);
  int marked = 0;
  int last = 0;
  for (int k = 0; k < 40 * kPoll; ++k) {
    Sample sample = Polled(k, 0.1);
    held.Mark(sample);
    EXPECT_FALSE(IsHeld(sample, Signal::kF));
    EXPECT_FALSE(IsHeld(sample, Signal::kX) && k % kPoll == 0);
    marked += IsHeld(sample, Signal::kX) ? 1 : 0;
    last = k >= 39 * kPoll && IsHeld(sample, Signal::kX) ? last + 1 : last;
  }
  EXPECT_EQ(held.every().x, kPoll);
  EXPECT_EQ(held.every().f, 0);
  EXPECT_EQ(last, kPoll - 1);
  EXPECT_LE(marked, 24 * kPoll) << "before sixteen changes nobody knows";
}

TEST(HeldReadingsTest, AnUnchangedValueIsAReadingAfterThePoll) {
  HeldReadings held(1.0, {.x = kPoll});
  for (int k = 0; k < 10 * kPoll; ++k) {
    Sample sample = Polled(k, 0.1);
    sample.Set(Signal::kX, 40.0);
    held.Mark(sample);
    EXPECT_EQ(IsHeld(sample, Signal::kX), k % kPoll != 0) << k;
  }
}

TEST(HeldReadingsTest, ARodThatRestsIsNotPolled) {
  HeldReadings held(1.0);
  std::mt19937 random(5);
  double x = 50.0;
  for (int k = 0; k < 20000; ++k) {
    Sample sample = Polled(k, 0.1);
    x += random() % 12 == 0 ? 0.1 : 0.0;
    sample.Set(Signal::kX, x);
    held.Mark(sample);
    EXPECT_EQ(held.every().x, 0) << k;
  }
}

// X in steps of `resolution`, told when it has changed by more than a dead band
// of 0.4 %.
class OnChange {
 public:
  explicit OnChange(double resolution, double step = 0.2)
      : resolution_(resolution), step_(step) {}

  Sample Next() {
    x_ += step_ * (static_cast<double>(random_() % 1000) / 999.0 - 0.5);
    const double x = resolution_ * std::round(x_ / resolution_);
    is_new_ = std::abs(x - told_) > 0.4;
    told_ = is_new_ ? x : told_;
    Sample sample = tests::PlantSample(k_++);
    sample.Set(Signal::kX, told_);
    return sample;
  }
  bool is_new() const { return is_new_; }

 private:
  double resolution_;
  double step_;
  std::mt19937 random_{7};
  std::uint64_t k_{0};
  double x_{50.0};
  double told_{50.0};
  bool is_new_{false};
};

TEST(HeldReadingsTest, WhatIsToldOnChangeIsNewWhenItChanges) {
  HeldReadings held(1.0);
  OnChange source(0.01);
  int late = 0;
  for (int k = 0; k < 4000; ++k) {
    Sample sample = source.Next();
    held.Mark(sample);
    EXPECT_FALSE(IsHeld(sample, Signal::kX) && source.is_new());
    EXPECT_FALSE(IsHeld(sample, Signal::kF));
    if (k >= 2000) {
      late += IsHeld(sample, Signal::kX) == source.is_new() ? 1 : 0;
    }
  }
  EXPECT_EQ(held.every().x, ReadEvery::kOnChange);
  EXPECT_EQ(late, 0);
}

// A transmitter of 0.5 % repeats itself while the rod does, and all its changes
// are multiples of that.
TEST(HeldReadingsTest, ACoarseTransmitterIsReadForEachSample) {
  HeldReadings held(1.0);
  OnChange source(0.5, 1.2);
  for (int k = 0; k < 20000; ++k) {
    Sample sample = source.Next();
    // Through another unit and back.
    sample.Set(Signal::kX, (1.8 * sample[Signal::kX] + 32.0 - 32.0) / 1.8);
    held.Mark(sample);
    ASSERT_EQ(held.every().x, 0) << k;
  }
}

TEST(HeldReadingsTest, TheEndsOfARangeAreReadings) {
  for (const double end : {0.0, 100.0, 40.0}) {
    HeldReadings held(1.0, {.x = ReadEvery::kOnChange});
    int marked = 0;
    for (std::uint64_t k = 0; k < 50; ++k) {
      Sample sample = tests::PlantSample(k);
      sample.Set(Signal::kX, end);
      held.Mark(sample);
      marked += IsHeld(sample, Signal::kX) ? 1 : 0;
    }
    EXPECT_EQ(marked, end == 40.0 ? 49 : 0);
  }
}

// A file says itself which of its rows are filled in: the others are readings,
// also those that say the same again.
TEST(HeldReadingsTest, AnUnchangedValueAfterHeldOnesIsAReading) {
  HeldReadings held(1.0, {.x = ReadEvery::kOnChange});
  for (std::uint64_t k = 0; k < 50; ++k) {
    Sample sample = tests::PlantSample(k);
    sample.Set(Signal::kX, 40.0);
    const bool filled = k % 10 != 0;
    sample.quality[Index(Signal::kX)] =
        filled ? SignalQuality::kUncertain : SignalQuality::kGood;
    held.Mark(sample);
    EXPECT_EQ(IsHeld(sample, Signal::kX), filled) << k;
  }
}

TEST(HeldReadingsTest, ARecordIsMarkedFromItsFirstSampleOn) {
  std::vector<Sample> record;
  for (int k = 0; k < 2000; ++k) {
    record.push_back(Polled(k, 0.1));
  }
  const ReadEvery every = MarkHeld(
      1.0, record.size(), [&](std::size_t k) -> Sample& { return record[k]; });
  EXPECT_EQ(every, (ReadEvery{.x = kPoll}));
  for (std::size_t k = 0; k < record.size(); ++k) {
    EXPECT_EQ(IsHeld(record[k], Signal::kX), k % kPoll != 0) << k;
  }
}

// The command goes on between two polls, so each repeat is far from it.
TEST(HeldReadingsDecisionTest, APolledPositionIsNoFault) {
  for (const bool known : {false, true}) {
    auto models = std::make_shared<ModelSet>(tests::LinearPlant());
    models->every.x = known ? kPoll : 0;
    Decision decision{EngineParts(models), nullptr};
    int transitions = 0;
    for (int k = 0; k < 1200; ++k) {
      Sample sample = tests::PlantSample(static_cast<std::uint64_t>(k));
      sample.Set(Signal::kX, Polled(k, 0.01)[Signal::kX]);
      transitions += decision.Step(sample).transition_count;
    }
    EXPECT_EQ(transitions > 0, !known);
  }
}

}  // namespace
}  // namespace fdi
