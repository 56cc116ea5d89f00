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

// A set of each reading meets data told on change: nobody knows which of the
// first values are readings.
TEST(HeldReadingsTest, WhereNoneRepeatedItselfARepeatIsNoReading) {
  HeldReadings held(1.0, {.x = ReadEvery::kNoRepeats});
  OnChange source(0.01);
  int news = 0;
  for (int k = 0; k < 4000; ++k) {
    Sample sample = source.Next();
    held.Mark(sample);
    news += source.is_new() ? 1 : 0;
    const bool first = k == 0;
    EXPECT_EQ(IsHeld(sample, Signal::kX), !first && !source.is_new()) << k;
    EXPECT_EQ(held.unseen().unknown, !first && news < 16) << k;
  }
  EXPECT_EQ(held.every().x, ReadEvery::kOnChange);
  EXPECT_EQ(held.held(), MaskOf(Signal::kX));
  // No change came at once, so it is not known that 0.4 is a dead band.
  EXPECT_GT(held.unseen().changes[Index(Signal::kX)], 0.4);
  EXPECT_LT(held.unseen().changes[Index(Signal::kX)], 0.75);
  EXPECT_EQ(held.unseen().changes[Index(Signal::kF)], 0.0);
  EXPECT_EQ(held.unseen().changes[Index(Signal::kCv)], 0.0);
}

// A source that tells of a change at once says by its silence where the value
// is, whether it marks what it holds or not. Lines between readings say
// nothing.
TEST(HeldReadingsTest, WithinItsDeadBandAnUnchangedValueIsAReading) {
  for (const bool marks : {false, true}) {
    HeldReadings held(1.0, {.x = ReadEvery::kNoRepeats});
    OnChange source(0.001, 1.5);
    double last = -1.0;
    int unusual = 0;
    for (int k = 0; k < 4000; ++k) {
      Sample sample = source.Next();
      if (sample[Signal::kX] == last && marks) {
        sample.quality[Index(Signal::kX)] = SignalQuality::kUncertain;
      }
      last = sample[Signal::kX];
      held.Mark(sample);
      if (k > 200) {
        EXPECT_EQ(held.unseen().within, MaskOf(Signal::kX)) << k;
        unusual += IsHeld(sample, Signal::kX) ? 1 : 0;
      }
    }
    EXPECT_LT(unusual, 400) << "silent for longer than lately";
    EXPECT_GT(held.unseen().changes[Index(Signal::kX)], 0.4);
    EXPECT_LT(held.unseen().changes[Index(Signal::kX)], 0.75);
    int silent = 0;
    Sample sample = source.Next();
    for (; silent < 100 && !IsHeld(sample, Signal::kX); ++silent) {
      sample = source.Next();
      sample.Set(Signal::kX, last);
      held.Mark(sample);
    }
    EXPECT_GT(silent, 1);
    EXPECT_LT(silent, 30);
    sample = source.Next();
    sample.Set(Signal::kX, last + 0.1);
    sample.quality[Index(Signal::kX)] = SignalQuality::kUncertain;
    held.Mark(sample);
    EXPECT_TRUE(IsHeld(sample, Signal::kX));
  }
}

TEST(HeldReadingsTest, ReadingsThatDoNotRepeatLeaveNothingUnseen) {
  HeldReadings held(1.0, {.x = ReadEvery::kNoRepeats});
  tests::Noise noise(3);
  for (std::uint64_t k = 0; k < 1000; ++k) {
    Sample sample = tests::PlantSample(k);
    noise.Add(sample);
    held.Mark(sample);
    EXPECT_EQ(sample.uncertain(), 0);
    EXPECT_FALSE(held.unseen().unknown);
  }
  EXPECT_FALSE(held.unseen().any());
}

TEST(HeldReadingsTest, WhatWasKnownIsNotUnseen) {
  for (const int known : {ReadEvery::kOnChange, 0}) {
    HeldReadings held(1.0, {.x = known});
    OnChange source(0.01);
    for (int k = 0; k < 4000; ++k) {
      Sample sample = source.Next();
      held.Mark(sample);
      EXPECT_FALSE(held.unseen().unknown);
    }
    EXPECT_EQ(held.unseen().any(), known == 0);
  }
}

// What is lost on the way did not stand.
TEST(HeldReadingsTest, LostSamplesAreNoReportsOnChange) {
  for (const int known : {0, ReadEvery::kNoRepeats}) {
    HeldReadings held(1.0, {.x = known});
    tests::Noise noise(3);
    std::mt19937 random(2);
    for (std::uint64_t k = 0; k < 3000; ++k) {
      Sample sample = tests::PlantSample(k);
      noise.Add(sample);
      if (random() % 2 == 0) {
        held.Mark(sample);
      }
      EXPECT_FALSE(held.unseen().any());
    }
    EXPECT_NE(held.every().x, ReadEvery::kOnChange);
  }
}

// Two publishers in turn, an hour apart, as while one takes over.
TEST(HeldReadingsTest, TwoPublishersAreNoReportsOnChange) {
  HeldReadings held(1.0, {.x = ReadEvery::kNoRepeats});
  tests::Noise noise(3);
  for (std::uint64_t k = 0; k < 1000; ++k) {
    for (const std::uint64_t source : {1, 2}) {
      Sample sample = tests::PlantSample(k + 3600 * source);
      noise.Add(sample);
      sample.source_id = source;
      held.Mark(sample);
      EXPECT_EQ(sample.uncertain(), 0);
    }
    EXPECT_FALSE(held.unseen().any());
    EXPECT_FALSE(held.unseen().unknown);
  }
  EXPECT_EQ(held.every().x, ReadEvery::kNoRepeats);
}

// A transmitter may be frozen from the first sample on.
TEST(HeldReadingsTest, NothingIsUnknownForLongerThanAnHour) {
  HeldReadings held(1.0, {.x = ReadEvery::kNoRepeats});
  for (std::uint64_t k = 0; k < 4000; ++k) {
    Sample sample = tests::PlantSample(k);
    sample.Set(Signal::kX, 40.0);
    held.Mark(sample);
    EXPECT_EQ(held.unseen().unknown, k > 0 && k < 3600) << k;
  }
}

TEST(HeldReadingsTest, ARecordSaysWhetherReadingsRepeatThemselves) {
  for (const double resolution : {0.001, 0.5}) {
    tests::Noise noise(4);
    std::vector<Sample> record;
    for (std::uint64_t k = 0; k < 2000; ++k) {
      Sample& sample = record.emplace_back(tests::PlantSample(k, 2.0));
      noise.Add(sample);
      sample.Set(Signal::kT1, sample[Signal::kF]);
      const double x = sample[Signal::kX];
      sample.Set(Signal::kX, resolution * std::round(x / resolution));
    }
    const ReadEvery every =
        MarkHeld(1.0, record.size(),
                 [&](std::size_t k) -> Sample& { return record[k]; });
    EXPECT_EQ(every.x, resolution < 0.1 ? ReadEvery::kNoRepeats : 0);
    EXPECT_EQ(every.f, ReadEvery::kNoRepeats);
    EXPECT_EQ(every.p1, 0) << "not measured";
    EXPECT_EQ(every.t1, 0) << "that of X and F alone";
  }
}

TEST(HeldReadingsTest, ARecordIsMarkedFromItsFirstSampleOn) {
  std::vector<Sample> record;
  for (int k = 0; k < 2000; ++k) {
    record.push_back(Polled(k, 0.1));
  }
  const ReadEvery every = MarkHeld(
      1.0, record.size(), [&](std::size_t k) -> Sample& { return record[k]; });
  EXPECT_EQ(every, (ReadEvery{.x = kPoll, .f = ReadEvery::kNoRepeats}));
  for (std::size_t k = 0; k < record.size(); ++k) {
    EXPECT_EQ(IsHeld(record[k], Signal::kX), k % kPoll != 0) << k;
  }
}

// The command goes on between two polls, so each repeat is far from it.
TEST(HeldReadingsDecisionTest, APolledPositionIsNoFault) {
  for (const int known : {0, ReadEvery::kNoRepeats, kPoll}) {
    auto models = std::make_shared<ModelSet>(tests::LinearPlant());
    models->every.x = known;
    Decision decision{EngineParts(models), nullptr};
    int transitions = 0;
    for (int k = 0; k < 1200; ++k) {
      Sample sample = tests::PlantSample(static_cast<std::uint64_t>(k));
      sample.Set(Signal::kX, Polled(k, 0.01)[Signal::kX]);
      transitions += decision.Step(sample).transition_count;
    }
    EXPECT_EQ(transitions > 0, known == 0);
  }
}

// A plant whose floor knows that F changes by some 1 to 2 for each % of X, and
// finds nothing itself.
std::shared_ptr<ModelSet> PlantOfEveryReading(int known) {
  auto models = std::make_shared<ModelSet>(tests::LinearPlant());
  models->every.x = models->every.f = known;
  models->floor.emplace();
  models->floor->flow_gain = 200.0;
  models->floor->flow_exponent = 2.0;
  models->floor->dp_level = 1.0;
  models->floor->deviation = 50.0;
  models->floor->flow_factor = 10.0;
  AddFindings(*models);
  return models;
}

struct Detected {
  int before{0};  // a fault [samples]
  int after{0};
  int settling{0};
};

// CV and X are told when they have changed by more than 4 %, where no residual
// is beyond 2 %. The flow is read for each sample.
Detected Replay(double fault, Decision& decision) {
  std::mt19937 random(11);
  Sample last = tests::PlantSample(0);
  Detected detected;
  for (int k = 0; k < 3000; ++k) {
    Sample sample = tests::PlantSample(static_cast<std::uint64_t>(k));
    const double at =
        sample[Signal::kCv] + 0.001 * static_cast<double>(random() % 1000);
    for (const Signal signal : {Signal::kCv, Signal::kX}) {
      sample.Set(signal, std::abs(at - last[signal]) > 4.0 ? at : last[signal]);
    }
    sample.Set(Signal::kF, 100.0 - at);
    tests::AddF6(sample, k < 2000 ? 0.0 : fault);
    last = sample;
    const Verdict& verdict = decision.Step(sample);
    detected.settling += verdict.quality == Quality::kSettling ? 1 : 0;
    (k < 2000 ? detected.before : detected.after) += verdict.detected ? 1 : 0;
  }
  return detected;
}

TEST(HeldReadingsDecisionTest, AllowsForTheDeadBandsThatASetDoesNotKnow) {
  for (const double fault : {0.0, 1.0}) {
    for (const int known : {0, ReadEvery::kNoRepeats}) {
      Decision decision{EngineParts(PlantOfEveryReading(known)), nullptr};
      const Detected detected = Replay(fault, decision);
      EXPECT_EQ(detected.before > 0, known == 0);
      EXPECT_EQ(detected.after > 900, fault > 0.0) << "it also clears";
      EXPECT_EQ(detected.settling > 50, known == ReadEvery::kNoRepeats);
      EXPECT_EQ(decision.held(), MaskOf(Signal::kX));
    }
  }
}

// An unchanged flow is a reading of what is within 4 of it.
TEST(HeldReadingsDecisionTest, AnUnchangedValueIsOffByItsDeadBandAtMost) {
  const auto detects = [](double off, SignalMask within) {
    ValveEngine engine(PlantOfEveryReading(ReadEvery::kNoRepeats));
    Unseen unseen;
    unseen.changes[Index(Signal::kF)] = 4.0;
    unseen.within = within;
    bool detected = false;
    for (std::uint64_t k = 0; k < 200; ++k) {
      Sample sample = tests::PlantSample(k);
      sample.values[Index(Signal::kF)] += k < 100 ? 0.0 : off;
      engine.Allow(unseen);
      detected = engine.Step(sample).detected || detected;
    }
    return detected;
  };
  EXPECT_FALSE(detects(5.0, MaskOf(Signal::kF)));
  EXPECT_TRUE(detects(7.0, MaskOf(Signal::kF)));
  EXPECT_TRUE(detects(5.0, 0)) << "new each time";
}

}  // namespace
}  // namespace fdi
