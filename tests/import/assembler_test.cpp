// Samples of fixed period from readings that come by exception.
#include "import/assembler.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/time_units.h"

namespace fdi::importer {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// 2026-01-05T10:00:00Z
constexpr std::int64_t kStartNs = 1'767'607'200 * kNsPerSecond;
using NoteKind = AssemblyNote::Kind;

std::int64_t At(double s) {
  return kStartNs + std::llround(s * 1e9);
}

LiveValve ValveNamed(const std::string& id) {
  LiveValve valve;
  valve.id = id;
  valve.map.columns = {
      {id + ".OP", Signal::kCv, 1.0, 0.0, Sense::kOpening, "%"},
      {id + ".ZT", Signal::kX, 1.0, 0.0, Sense::kOpening, "%"},
      {id + ".PT", Signal::kP1, 100.0, 101.325, Sense::kClosing, "bar g"}};
  valve.map.mode_column = id + ".MODE";
  return valve;
}

LiveValve Periodic(LiveValve valve, double max_age_s) {
  valve.report = Reporting::kPeriodic;
  valve.max_age_ns = std::llround(max_age_s * 1e9);
  return valve;
}

class AssemblerTest : public ::testing::Test {
 protected:
  void Make(std::vector<LiveValve> valves) {
    assembler_.emplace(AssemblerOptions{}, std::move(valves),
                       [this](const AssemblyNote& note) {
                         notes_.emplace_back(note.kind, note.name);
                       });
  }
  // The source has the clock of the host, `ahead_s` ahead, and a way of none.
  Taken Say(double s, const std::string& tag, double value,
            const std::string& source = "") {
    now_s_ = std::max(now_s_, s);
    return assembler_->Take({.tag = tag,
                             .source = source,
                             .stamp_ns = At(s + ahead_s_),
                             .value = value,
                             .word = {}},
                            Now());
  }
  Taken SayBad(double s, const std::string& tag) {
    now_s_ = std::max(now_s_, s);
    return assembler_->Take({.tag = tag,
                             .source = "",
                             .stamp_ns = At(s),
                             .value = {},
                             .word = {},
                             .quality = SignalQuality::kBad},
                            Now());
  }
  void SayAll(double s, const std::string& id, const std::string& source = "") {
    Say(s, id + ".OP", 30.0 + s, source);
    Say(s, id + ".ZT", 29.0, source);
    Say(s, id + ".PT", 2.0, source);
  }
  ArrivalTime Now() const {
    return {At(now_s_), std::llround(now_s_ * 1e9) + 1'000'000'000};
  }
  // Twice: what was said since the last call may not be all of its instant.
  void Advance(double s) {
    AdvanceOnce(s);
    AdvanceOnce(s);
  }
  void AdvanceOnce(double s) {
    now_s_ = std::max(now_s_, s);
    assembler_->Advance(Now(),
                        [this](const LiveValve& valve, const Sample& sample) {
                          samples_.push_back({valve.id, sample});
                        });
  }
  // Seconds of the samples of a valve that have, or lack, a signal.
  std::vector<double> With(const std::string& id, Signal signal,
                           bool has = true) const {
    std::vector<double> seconds;
    for (const auto& [valve, sample] : samples_) {
      if (valve == id && sample.Has(signal) == has) {
        seconds.push_back(
            std::round(1e-9 * static_cast<double>(sample.stamp_ns - kStartNs)));
      }
    }
    return seconds;
  }
  TagCounts CountsOf(const std::string& tag) const {
    return assembler_->tags()[tag];
  }

  std::optional<Assembler> assembler_;
  std::vector<std::pair<std::string, Sample>> samples_;
  std::vector<std::pair<NoteKind, std::string>> notes_;
  double now_s_{0.0};
  double ahead_s_{0.0};
};

TEST_F(AssemblerTest, AnInstantHasTheNewestReadingUpToIt) {
  Make({ValveNamed("V1")});
  Say(0.2, "V1.OP", 40.0);
  Say(0.3, "V1.ZT", 39.0);
  Say(0.7, "V1.ZT", 38.0);
  Say(1.0, "V1.PT", 2.0);
  Say(1.1, "V1.ZT", 37.0);
  Advance(1.1);
  ASSERT_EQ(samples_.size(), 1U);
  const Sample& sample = samples_[0].second;
  EXPECT_EQ(sample.stamp_ns, At(1.0));
  EXPECT_DOUBLE_EQ(sample[Signal::kCv], 60.0);  // % of closing
  EXPECT_DOUBLE_EQ(sample[Signal::kX], 62.0);
  EXPECT_DOUBLE_EQ(sample[Signal::kP1], 301.325);
  EXPECT_EQ(sample.uncertain(), 0);
}

TEST_F(AssemblerTest, WhatIsSaidOfOneInstantMayComeInTwoMessages) {
  Make({ValveNamed("V1")});
  Say(1.0, "V1.OP", 40.0);
  Say(2.0, "V1.OP", 41.0);
  AdvanceOnce(2.0);
  EXPECT_THAT(samples_, IsEmpty());
  EXPECT_EQ(Say(1.0, "V1.ZT", 39.0), Taken::kTaken);
  AdvanceOnce(2.0);
  EXPECT_THAT(With("V1", Signal::kX), ElementsAre(1.0));
}

TEST_F(AssemblerTest, WaitsForWhatIsOnTheWayAndThenDoesNot) {
  Make({ValveNamed("V1")});
  SayAll(1.0, "V1");
  Advance(2.9);
  EXPECT_THAT(samples_, IsEmpty());  // Nobody has spoken of a later time.
  Advance(3.0);                      // 2 s of lateness.
  EXPECT_THAT(With("V1", Signal::kX), ElementsAre(1.0));
  EXPECT_EQ(Say(0.9, "V1.ZT", 20.0), Taken::kLate);
  EXPECT_EQ(CountsOf("V1.ZT").late, 1U);
}

TEST_F(AssemblerTest, AnUnchangedValueIsHeldWhileItsSourceIsAlive) {
  Make({ValveNamed("V1")});
  SayAll(1.0, "V1");
  for (int s = 2; s <= 30; ++s) {
    assembler_->Alive("", At(s), (now_s_ = s, Now()));
    Advance(s);
  }
  EXPECT_EQ(With("V1", Signal::kX).size(), 29U);
  EXPECT_EQ(CountsOf("V1.ZT").held, 28U);
  EXPECT_THAT(notes_, IsEmpty());
}

TEST_F(AssemblerTest, NothingIsHeldOfASilentSource) {
  Make({ValveNamed("V1"), ValveNamed("V2")});
  for (int s = 1; s <= 30; ++s) {
    SayAll(s, "V1", "plc1");
    if (s <= 10) {
      SayAll(s, "V2", "plc2");
    }
    Advance(s);
  }
  EXPECT_THAT(With("V1", Signal::kX, false), IsEmpty());
  // Held for two periods, told three times, then a gap.
  EXPECT_EQ(With("V2", Signal::kX).back(), 12.0);
  EXPECT_THAT(With("V2", Signal::kCv, false), ElementsAre(13.0, 14.0, 15.0));
  EXPECT_THAT(notes_, ElementsAre(std::pair(NoteKind::kSourceSilent, "plc2")));
  // It is back by itself, with the readings that it says.
  for (int s = 31; s <= 33; ++s) {
    SayAll(s, "V1", "plc1");
    SayAll(s, "V2", "plc2");
    Advance(s);
  }
  EXPECT_EQ(With("V2", Signal::kX).back(), 32.0);
  EXPECT_EQ(notes_.back(),
            std::pair(NoteKind::kSourceBack, std::string("plc2")));
}

// It speaks when something changes, and never says that it lives.
TEST_F(AssemblerTest, ASourceWithoutAHeartbeatHasItsOwnRhythm) {
  Make({ValveNamed("V1")});
  double s = 0.0;
  for (int k = 0; k < 200; ++k) {
    SayAll(s, "V1");
    const double next = s + 1.0 + (k * 7 % 10);
    while (s < next) {
      Advance(s += 1.0);
    }
  }
  const std::vector<double> missing = With("V1", Signal::kCv, false);
  EXPECT_TRUE(missing.empty() || missing.back() < 100.0) << missing.back();
  const double last = s;
  SayAll(last, "V1");
  while (s < last + 100.0) {
    Advance(s += 1.0);
  }
  EXPECT_NEAR(With("V1", Signal::kCv).back(), last + 35.0, 15.0);
}

TEST_F(AssemblerTest, ALostConnectionVoidsWhatItSaid) {
  Make({ValveNamed("V1")});
  for (int s = 1; s <= 5; ++s) {
    SayAll(s, "V1");
    Advance(s);
  }
  assembler_->End("");
  Advance(8.0);
  EXPECT_EQ(With("V1", Signal::kX).back(), 5.0);
  EXPECT_THAT(With("V1", Signal::kX, false), ElementsAre(6.0));
  // Only readings of the new connection count.
  for (int s = 10; s <= 12; ++s) {
    Say(s, "V1.OP", 40.0);
    Advance(s);
  }
  EXPECT_EQ(With("V1", Signal::kCv).back(), 11.0);
  EXPECT_EQ(With("V1", Signal::kX).back(), 5.0);
}

TEST_F(AssemblerTest, APeriodicTagThatIsSilentIsMissingAlone) {
  Make({Periodic(ValveNamed("V1"), 3.0)});
  for (int s = 1; s <= 12; ++s) {
    Say(s, "V1.OP", 30.0);
    Say(s, "V1.ZT", 29.0);
    if (s <= 5) {
      Say(s, "V1.PT", 2.0);
    }
    Advance(s);
  }
  EXPECT_THAT(With("V1", Signal::kX, false), IsEmpty());
  EXPECT_THAT(With("V1", Signal::kP1), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8));
  // Beyond one and a half periods it is an estimate.
  std::vector<int> uncertain;
  for (const auto& [valve, sample] : samples_) {
    if (sample.Has(Signal::kP1) && sample.uncertain() != 0) {
      uncertain.push_back(
          static_cast<int>((sample.stamp_ns - kStartNs) / kNsPerSecond));
    }
  }
  EXPECT_THAT(uncertain, ElementsAre(7, 8));
  EXPECT_THAT(notes_, ElementsAre(std::pair(NoteKind::kTagSilent, "V1.PT")));
  EXPECT_TRUE(CountsOf("V1.PT").silent);
}

TEST_F(AssemblerTest, ABadReadingEndsTheGoodOneBeforeIt) {
  Make({ValveNamed("V1")});
  for (int s = 1; s <= 6; ++s) {
    Say(s, "V1.OP", 30.0);
    s == 3 ? SayBad(s, "V1.ZT") : Say(s, "V1.ZT", 29.0);
    Advance(s);
  }
  EXPECT_THAT(With("V1", Signal::kX, false), ElementsAre(3.0));
  EXPECT_EQ(samples_[2].second.quality[Index(Signal::kX)], SignalQuality::kBad);
  EXPECT_EQ(CountsOf("V1.ZT").bad, 1U);
}

TEST_F(AssemblerTest, AClockThatLeapsBeginsAGap) {
  Make({ValveNamed("V1")});
  for (int s = 1; s <= 5; ++s) {
    SayAll(s, "V1");
    Advance(s);
  }
  ahead_s_ = 90.0;
  for (int s = 6; s <= 10; ++s) {
    SayAll(s, "V1");
    Advance(s);
  }
  EXPECT_THAT(With("V1", Signal::kX),
              ElementsAre(1, 2, 3, 4, 5, 96, 97, 98, 99));
  EXPECT_THAT(notes_, ElementsAre(std::pair(NoteKind::kClockLeaps, "")));
}

TEST_F(AssemblerTest, AClockThatRunsBackBeginsAGap) {
  Make({ValveNamed("V1")});
  ahead_s_ = 90.0;
  for (int s = 1; s <= 5; ++s) {
    SayAll(s, "V1");
    Advance(s);
  }
  ahead_s_ = 0.0;
  for (int s = 6; s <= 12; ++s) {
    SayAll(s, "V1");
    Advance(s);
  }
  ASSERT_THAT(notes_, ElementsAre(std::pair(NoteKind::kClockBack, "")));
  const std::vector<double> with = With("V1", Signal::kX);
  EXPECT_EQ(with.back(), 11.0);
  EXPECT_THAT(std::vector<double>(with.end() - 4, with.end()),
              ElementsAre(8, 9, 10, 11));
  for (std::size_t i = 1; i < samples_.size(); ++i) {
    EXPECT_EQ(samples_[i].second.seq, i);  // The monitor takes it for a gap.
  }
}

TEST_F(AssemblerTest, AStampOf1970OrOfNextYearIsRefused) {
  Make({ValveNamed("V1")});
  const ArrivalTime now = Now();
  TagReading reading{
      .tag = "V1.OP", .source = "", .stamp_ns = 0, .value = 1.0, .word = {}};
  EXPECT_EQ(assembler_->Take(reading, now), Taken::kBadStamp);
  reading.stamp_ns = now.utc_ns + 2 * kNsPerHour;
  EXPECT_EQ(assembler_->Take(reading, now), Taken::kBadStamp);
  reading.stamp_ns.reset();
  EXPECT_EQ(assembler_->Take(reading, now), Taken::kTaken);
  reading.tag = "V9.OP";
  EXPECT_EQ(assembler_->Take(reading, now), Taken::kUnknownTag);
  EXPECT_EQ(CountsOf("V1.OP").bad, 2U);
}

TEST_F(AssemblerTest, TextThatIsNoNumberEndsTheReadingBeforeIt) {
  Make({ValveNamed("V1")});
  SayAll(1.0, "V1");
  now_s_ = 2.0;
  EXPECT_EQ(assembler_->Take({.tag = "V1.ZT",
                              .source = "",
                              .stamp_ns = At(2.0),
                              .value = {},
                              .word = "41 percent"},
                             Now()),
            Taken::kBadValue);
  Say(2.0, "V1.OP", 30.0);
  Say(3.0, "V1.OP", 30.0);
  Advance(3.0);
  EXPECT_THAT(With("V1", Signal::kX), ElementsAre(1.0));
  EXPECT_THAT(With("V1", Signal::kCv), ElementsAre(1.0, 2.0));
}

TEST_F(AssemblerTest, AFloodOfOneTagIsBoundedAndCostsNoOther) {
  Make({ValveNamed("V1")});
  for (int i = 0; i < 50'000; ++i) {
    Say(1.0 + 1e-5 * i, "V1.ZT", i % 100);
  }
  Say(1.5, "V1.OP", 30.0);
  Say(2.0, "V1.ZT", 29.0);
  Say(2.1, "V1.ZT", 12.0);
  Advance(2.1);
  EXPECT_THAT(With("V1", Signal::kCv), ElementsAre(2.0));
  EXPECT_DOUBLE_EQ(samples_.back().second[Signal::kX], 71.0);
}

TEST_F(AssemblerTest, NamesOfSourcesThatSomebodyMakesUpAreForgotten) {
  Make({ValveNamed("V1")});
  for (int s = 1; s <= 100; ++s) {
    for (int k = 0; k < 100; ++k) {
      const std::string name = std::to_string(100 * s + k);
      Say(s, "V1.ZT", 29.0, "reads " + name);
      assembler_->Alive("lives " + name, At(s), Now());
    }
    SayAll(s, "V1", "plc");
    Advance(s);
  }
  EXPECT_LE(assembler_->sources().second, 1000U);
  EXPECT_EQ(With("V1", Signal::kX).size(), 99U);
  EXPECT_THAT(notes_, IsEmpty());
  Advance(110.0);  // What tags wait for is not forgotten.
  EXPECT_EQ(assembler_->sources(), (std::pair<std::size_t, std::size_t>(0, 1)));
  EXPECT_THAT(notes_, ElementsAre(std::pair(NoteKind::kSourceSilent, "plc")));
}

TEST_F(AssemblerTest, AHeaderOfTwoValvesIsReadByBoth) {
  LiveValve second = ValveNamed("V2");
  second.map.columns[2].column = "V1.PT";
  Make({ValveNamed("V1"), second});
  SayAll(1.0, "V1");
  Say(1.0, "V2.OP", 10.0);
  Say(1.5, "V2.OP", 10.0);
  Advance(1.5);
  EXPECT_THAT(With("V2", Signal::kP1), ElementsAre(1.0));
  EXPECT_THAT(With("V1", Signal::kP1), ElementsAre(1.0));
}

TEST(ConvertedTest, TheFlowOfAPressureDifferenceGoesWithItsRoot) {
  ColumnMapping mapping{"DP", Signal::kF, 2.5, -10.0};
  mapping.root = std::pair(4.0, 20.0);
  EXPECT_EQ(Converted(mapping, 8.0), 20.0);
  EXPECT_EQ(Converted(mapping, 3.9), 0.0);
}

TEST_F(AssemblerTest, WordsOfAModeAreThoseOfTheRowThenTheUsualOnes) {
  LiveValve valve = ValveNamed("V1");
  valve.map.mode_words["2"] = ValveMode::kAuto;
  Make({valve});
  const auto say = [&](double s, std::string_view word,
                       std::optional<double> value) {
    now_s_ = s;
    return assembler_->Take({.tag = "V1.MODE",
                             .source = "",
                             .stamp_ns = At(s),
                             .value = value,
                             .word = word},
                            Now());
  };
  Say(1.0, "V1.OP", 1.0);
  EXPECT_EQ(say(1.0, "MAN", {}), Taken::kTaken);
  EXPECT_EQ(say(2.0, "", 2.0), Taken::kTaken);
  EXPECT_EQ(say(2.5, "", 7.0), Taken::kBadValue);
  assembler_->Alive("", At(4.0), (now_s_ = 4.0, Now()));
  Advance(4.0);
  ASSERT_EQ(samples_.size(), 3U);
  EXPECT_EQ(samples_[0].second.mode, ValveMode::kManual);
  EXPECT_EQ(samples_[1].second.mode, ValveMode::kAuto);
  EXPECT_EQ(samples_[2].second.mode, ValveMode::kAuto);  // Not known.
}

TEST_F(AssemblerTest, AValveOfAnotherTableGoesOn) {
  Make({ValveNamed("V1")});
  SayAll(1.0, "V1");
  SayAll(2.0, "V1");
  Advance(2.0);
  assembler_->Replace({ValveNamed("V2"), ValveNamed("V1")});
  SayAll(3.0, "V1");
  Advance(3.0);
  EXPECT_THAT(With("V1", Signal::kX), ElementsAre(1.0, 2.0));
  EXPECT_EQ(samples_.back().second.seq, 1U);
  EXPECT_EQ(CountsOf("V1.OP").readings, 3U);
}

TEST_F(AssemblerTest, ASilentValveIsNotToldAgainByAnotherTable) {
  Make({ValveNamed("V1"), ValveNamed("V2")});
  SayAll(1.0, "V1", "plc1");
  for (int s = 1; s <= 20; ++s) {
    if (s == 12) {
      assembler_->Replace({ValveNamed("V1"), ValveNamed("V2")});
    }
    SayAll(s, "V2", "plc2");
    Advance(s);
  }
  EXPECT_THAT(With("V1", Signal::kCv, false), ElementsAre(4.0, 5.0, 6.0));
}

TEST_F(AssemblerTest, TheEndWritesWhatWasSaid) {
  Make({ValveNamed("V1")});
  SayAll(1.0, "V1");
  SayAll(2.0, "V1");
  assembler_->Finish([this](const LiveValve& valve, const Sample& sample) {
    samples_.push_back({valve.id, sample});
  });
  EXPECT_THAT(With("V1", Signal::kX), ElementsAre(1.0, 2.0));
}

// Zeros of all signals are no reading of a valve that jumps shut and back; one
// that comes there by way of other readings is shut.
TEST_F(AssemblerTest, ZerosOfAllSignalsAreNoReading) {
  Make({ValveNamed("V1")});
  const auto zeros = [&](double s) {
    for (const char* tag : {"V1.OP", "V1.ZT", "V1.PT"}) {
      Say(s, tag, 0.0);
    }
  };
  SayAll(0, "V1");
  zeros(1);
  zeros(2);
  SayAll(3, "V1");
  Say(4, "V1.OP", 0.0);
  Say(4, "V1.ZT", 5.0);
  zeros(5);
  zeros(7);
  SayAll(8, "V1");
  Advance(9);
  EXPECT_THAT(With("V1", Signal::kX, false), ElementsAre(1.0, 2.0));
  EXPECT_EQ(samples_[1].second.quality[Index(Signal::kX)], SignalQuality::kBad);
}

TEST_F(AssemblerTest, ZerosAreNoReadingsAfterTheTableIsReadAgain) {
  Make({ValveNamed("V1")});
  const auto zeros = [&](int from, int to) {
    for (int s = from; s <= to; ++s) {
      for (const char* tag : {"V1.OP", "V1.ZT", "V1.PT"}) {
        Say(s, tag, 0.0);
      }
    }
  };
  SayAll(0, "V1");
  zeros(1, 6);
  Advance(6);
  assembler_->Replace({ValveNamed("V1")});
  zeros(7, 9);
  Advance(12);
  EXPECT_THAT(With("V1", Signal::kX), ElementsAre(0.0));
}

}  // namespace
}  // namespace fdi::importer
