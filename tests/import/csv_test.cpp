#include "import/csv.h"

#include <bit>
#include <cmath>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::importer {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr std::string_view kHeader =
    "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h";

/// Rows at the given times, all signals 1..6.
std::string Table(const std::vector<std::string>& times) {
  std::string text(kHeader);
  for (const std::string& t : times) {
    text += "\n" + t + ",1,2,3,4,5,6";
  }
  return text;
}

CsvTable Read(const std::string& text, const CsvOptions& options = {}) {
  return ReadCsv(text, options);
}

std::string Refusal(const std::string& text, CsvOptions options = {}) {
  options.source = {"plant.csv"};
  try {
    Read(text, options);
  } catch (const DataError& error) {
    return error.what();
  }
  return "not refused";
}

TEST(CsvTest, ColumnsAreFoundByNameInAnyOrderAndCase) {
  const CsvTable table = Read(
      "\xEF\xBB\xBF"
      "F_t_h, x_PCT ,\"T1_degC\",P2_kPa,P1_kPa,CV_pct,t_s,level_pct\r\n"
      "13.5,68.3,100.7,2601.2,3541.9,68.6,10,49.0\r\n"
      "11.9,67.9,100.7,2609.0,3523.3,60.1,12,50.0\r\n"
      "\r\n");

  ASSERT_EQ(table.runs.size(), 1U);
  const SampleSeries& run = table.runs[0];
  EXPECT_EQ(run.flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(run.period_s, 2.0);
  EXPECT_FALSE(run.has_truth);
  EXPECT_EQ(run.signals, kBasicSignals);
  EXPECT_THAT(table.header.ignored_columns, ElementsAre("level_pct"));
  ASSERT_EQ(run.samples.size(), 2U);
  const Sample& sample = run.samples[1].sample;
  EXPECT_EQ(sample[Signal::kCv], 60.1);
  EXPECT_EQ(sample[Signal::kP1], 3523.3);
  EXPECT_EQ(sample[Signal::kP2], 2609.0);
  EXPECT_EQ(sample[Signal::kT1], 100.7);
  EXPECT_EQ(sample[Signal::kX], 67.9);
  EXPECT_EQ(sample[Signal::kF], 11.9);
  EXPECT_EQ(sample.flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(sample.stamp_ns, 12'000'000'000);
  EXPECT_EQ(sample.seq, 1U);
  EXPECT_FALSE(run.samples[1].truth);
}

TEST(CsvTest, NameAndSizeOfTheFirstCellTellTheFormOfTimes) {
  const auto unit = [](const char* name, double first) {
    return std::string(TimeUnitName(TimeUnitOf(name, first)));
  };
  EXPECT_EQ(unit("t_s", 1.7e9), "s");
  EXPECT_EQ(unit("Time", 46027.4), "serial");
  EXPECT_EQ(unit("Time", 30000.0), "s");
  EXPECT_EQ(unit("Time", 1.7e9), "unix");
  for (const char* name : {"time_s", "Time [s]", "Zeit (s)"}) {
    EXPECT_EQ(unit(name, 30000.5), "s") << name;
    EXPECT_EQ(unit(name, 1.7e9), "unix") << name;
  }
  EXPECT_EQ(unit("Zeit [ms]", 250.0), "ms");
  EXPECT_EQ(unit("ts", 1.7e15), "unix us");
}

TEST(CsvTest, TruthNeedsAStrengthOtherThanZero) {
  const CsvTable by_number = Read(
      "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h,fault_no,fault_strength\n"
      "0,1,2,3,4,5,6,18,0\n"
      "1,1,2,3,4,5,6,18,-0.25\n"
      "2,1,2,3,4,5,6,22,1\n");
  const CsvTable by_name = Read(
      "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h,fault,fault_strength\n"
      "0,1,2,3,4,5,6,normal,0\n"
      "1,1,2,3,4,5,6,F18,-0.25\n"
      "2,1,2,3,4,5,6,P2,1\n");

  for (const CsvTable& table : {by_number, by_name}) {
    const auto& samples = table.runs.at(0).samples;
    ASSERT_TRUE(samples[0].truth && samples[1].truth);
    EXPECT_EQ(samples[0].truth->fault, 0);
    EXPECT_EQ(samples[1].truth->fault, 18);
    EXPECT_EQ(samples[1].truth->strength, -0.25);
    EXPECT_EQ(samples[2].truth->fault, 22);
  }
}

TEST(CsvTest, ModeIsAnOptionalColumn) {
  const std::string text =
      "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h,mode\n"
      "0,1,2,3,4,5,6,AUTO\n"
      "1,1,2,3,4,5,6,MANUAL\n"
      "2,1,2,3,4,5,6,OUT_OF_SERVICE\n";
  const CsvTable table = Read(text);
  const auto& samples = table.runs.at(0).samples;
  EXPECT_EQ(samples[0].sample.mode, ValveMode::kAuto);
  EXPECT_EQ(samples[1].sample.mode, ValveMode::kManual);
  EXPECT_EQ(samples[2].sample.mode, ValveMode::kOutOfService);
  EXPECT_THAT(table.header.ignored_columns, IsEmpty());

  std::ostringstream written;
  WriteCsv(written, samples, FlowUnit::kM3PerHour, 0);
  EXPECT_EQ(written.str(), text);
  std::ostringstream plain;
  WriteCsv(plain, std::span(samples).first(1), FlowUnit::kM3PerHour, 0);
  EXPECT_THAT(plain.str(), Not(HasSubstr("mode")));

  EXPECT_THAT(Refusal(std::string(kHeader) + ",Mode\n0,1,2,3,4,5,6,HAND"),
              AllOf(HasSubstr("\"HAND\" is none of AUTO, MANUAL"),
                    HasSubstr("plant.csv:2:")));
}

TEST(CsvTest, ModesHaveTheWordsOfControllersOrAColumnOfOnesAndZeros) {
  const std::string rows =
      "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h,mode\n"
      "0,1,2,3,4,5,6,cas\n1,1,2,3,4,5,6,Man\n2,1,2,3,4,5,6,OOS\n";
  const auto words = Read(rows).runs.at(0).samples;
  EXPECT_EQ(words[0].sample.mode, ValveMode::kAuto);
  EXPECT_EQ(words[1].sample.mode, ValveMode::kManual);
  EXPECT_EQ(words[2].sample.mode, ValveMode::kOutOfService);
  const std::string ones =
      std::string(kHeader) + ",auto\n0,1,2,3,4,5,6,1\n1,1,2,3,4,5,6,0\n";
  const auto numbers = Read(ones).runs.at(0).samples;
  EXPECT_EQ(numbers[0].sample.mode, ValveMode::kAuto);
  EXPECT_EQ(numbers[1].sample.mode, ValveMode::kManual);
  // Elsewhere nobody knows which number is which mode.
  EXPECT_THAT(Refusal(std::string(kHeader) + ",mode\n0,1,2,3,4,5,6,1"),
              HasSubstr("\"1\" is none of AUTO, MANUAL"));
  CsvOptions named;
  named.map.mode_column = "MD";
  EXPECT_EQ(Read(std::string(kHeader) + ",MD\n0,1,2,3,4,5,6,MAN\n"
                                        "1,1,2,3,4,5,6,MAN",
                 named)
                .runs.at(0)
                .samples[0]
                .sample.mode,
            ValveMode::kManual);
}

TEST(CsvTest, RowsWithTheTimeOfTheRowBeforeAreLeftOutOnRequest) {
  const CsvTable same = Read(Table({"0", "1", "1", "2"}));
  EXPECT_EQ(same.runs.at(0).samples.size(), 3U) << "cell for cell the same";
  const std::string text = Table({"0", "1"}) + "\n1,1,2,3,4,5,7\n2,1,2,3,4,5,6";
  EXPECT_THAT(Refusal(text), HasSubstr("stands still"));
  CsvOptions options;
  options.skip_repeats = true;
  const CsvTable table = Read(text, options);
  EXPECT_EQ(table.runs.at(0).samples.size(), 3U);
  EXPECT_THAT(table.notes, Contains(HasSubstr("1 rows have the time")));
}

TEST(CsvTest, RefusalsNameFileLineColumnAndReason) {
  EXPECT_THAT(Refusal("t_s,CV_pct,P2_kPa,T1_degC,X_pct\n0,1,2,3,4"),
              AllOf(HasSubstr("plant.csv:1:"),
                    HasSubstr("missing column P1_kPa, F_m3_h or F_t_h")));
  EXPECT_THAT(Refusal(Table({"0", "1"}) + "\n2,1,2,3,4,abc,6"),
              AllOf(HasSubstr("plant.csv:4:"),
                    HasSubstr("column \"X_pct\": \"abc\" is not a finite")));
  for (const std::string bad : {"inf", "-inf", "NaN?", "1e999", "1.5x"}) {
    EXPECT_THAT(Refusal(Table({"0"}) + "\n1,1," + bad + ",3,4,5,6"),
                AllOf(HasSubstr("plant.csv:3:"), HasSubstr("P1_kPa"),
                      HasSubstr("is not a finite number")));
  }
  EXPECT_THAT(Refusal(""), HasSubstr("plant.csv: is empty"));
  EXPECT_THAT(Refusal("\n\n"), HasSubstr("is empty"));
  EXPECT_THAT(Refusal(std::string(kHeader)), HasSubstr("no rows"));
  EXPECT_THAT(Refusal(Table({"0"})), HasSubstr("sample period"));
  EXPECT_THAT(Refusal(std::string(kHeader) + ",CV_pct\n0,1,2,3,4,5,6,7"),
              HasSubstr("signal CV occurs twice"));
  EXPECT_THAT(Refusal(std::string(kHeader) + ",F_t_h\n0,1,2,3,4,5,6,7"),
              HasSubstr("signal F occurs twice"));
  EXPECT_THAT(Refusal(std::string(kHeader) + ",t_s\n0,1,2,3,4,5,6,7"),
              HasSubstr("\"t_s\" occurs twice"));
  EXPECT_THAT(Refusal(Table({"0"}) + ",7"),
              AllOf(HasSubstr("plant.csv:2:"), HasSubstr("8 cells")));
  EXPECT_THAT(Refusal(std::string(kHeader) + ",fault\n0,1,2,3,4,5,6,f1"),
              HasSubstr("missing column fault_strength"));
  const std::string truth =
      std::string(kHeader) + ",fault,fault_strength\n0,1,2,3,4,5,6,";
  EXPECT_THAT(Refusal(truth + "f99,0.5"), HasSubstr("\"f99\" is not a fault"));
  EXPECT_THAT(Refusal(truth + "f99,0.5"), HasSubstr("f1..f19, t1, p1, p2"));
  EXPECT_THAT(Refusal(truth + "normal,0.5"), HasSubstr("needs a fault"));
  EXPECT_THAT(Refusal(truth + "f1,1.5"), HasSubstr("not in [-1, 1]"));
}

TEST(CsvTest, AJumpInTimeIsRefusedWhereItIs) {
  EXPECT_THAT(Refusal(Table({"0", "1", "2", "7", "8"})),
              AllOf(HasSubstr("plant.csv:5:"), HasSubstr("jumps by 5 s")));
  EXPECT_THAT(Refusal(Table({"0", "5", "6", "7", "8"})),
              AllOf(HasSubstr("plant.csv:3:"), HasSubstr("jumps by 5 s")));
  EXPECT_THAT(Refusal(Table({"0", "1", "1.5", "2.5", "3.5"})),
              AllOf(HasSubstr("plant.csv:4:"), HasSubstr("by 0.5 s")));
  EXPECT_THAT(Refusal(Table({"0", "1", "2", "1", "2"})),
              AllOf(HasSubstr("plant.csv:5:"), HasSubstr("goes back")));
  EXPECT_THAT(Refusal(Table({"0", "1"}) + "\n1,1,2,3,4,5,7"),
              HasSubstr("stands still"));
  CsvOptions other_period;
  other_period.period_s = 2.0;
  EXPECT_THAT(Refusal(Table({"0", "1", "2"}), other_period),
              HasSubstr("the sample period is 2 s"));
}

TEST(CsvTest, PeriodsThatDecimalsOnlyRoundAreAccepted) {
  const CsvTable table = Read(Table({"0", "0.333", "0.667", "1", "1.333"}));
  EXPECT_EQ(table.runs.at(0).samples.size(), 5U);
}

TEST(CsvTest, SplitGapsBeginsARunAtEachGap) {
  CsvOptions options;
  options.split_gaps = true;
  options.start_ns = 1'000;
  const CsvTable table = Read(Table({"0", "1", "2", "7", "8", "20"}), options);

  ASSERT_EQ(table.runs.size(), 3U);
  EXPECT_EQ(table.runs[0].samples.size(), 3U);
  EXPECT_EQ(table.runs[1].samples.size(), 2U);
  EXPECT_EQ(table.runs[2].samples.size(), 1U);
  EXPECT_EQ(table.runs[1].samples[0].sample.stamp_ns, 7'000'001'000);
  EXPECT_EQ(table.runs[2].period_s, 1.0);
  EXPECT_THAT(Refusal(Table({"0", "1", "2", "1", "2"}), options),
              HasSubstr("goes back"));
}

TEST(CsvTest, AMapRenamesScalesAndTurnsColumns) {
  CsvOptions options;
  options.map.time_column = "ms";
  options.map.time_unit = *FindTimeUnit("ms");
  options.map.columns = {
      {"LIC01.OP", Signal::kCv, 1.0, 0.0, Sense::kOpening},
      {"PI02", Signal::kP1, 100.0, 101.3, Sense::kClosing},  // bar gauge
      {"FI03", Signal::kF, 1.0, 0.0, Sense::kClosing}};
  const std::string text =
      "ms,LIC01.OP,PI02,FI03,X_pct\n0,30,2,9,1\n500,20,2,9,1";
  EXPECT_THROW(Read(text, options), ConfigError);
  options.map.flow_unit = FlowUnit::kTPerHour;

  const SampleSeries run = Read(text, options).runs.at(0);
  EXPECT_EQ(run.period_s, 0.5);
  EXPECT_EQ(run.flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(run.samples[1].sample[Signal::kCv], 80.0);
  EXPECT_EQ(run.samples[1].sample[Signal::kP1], 301.3);
  EXPECT_EQ(run.samples[1].sample[Signal::kX], 1.0);
  EXPECT_FALSE(run.samples[1].sample.Has(Signal::kP2));
  EXPECT_THAT(Refusal("ms,LIC01.OP,FI03\n0,30,2", options),
              HasSubstr("missing column PI02"));
}

TEST(CsvTest, AValveMayLackSignalsIfTheCallerSaysSo) {
  CsvOptions options;
  options.required = MaskOf(Signal::kCv);
  EXPECT_EQ(Read("t_s,CV_pct,X_pct\n0,1,2\n1,1,2", options).header.signals,
            MaskOf(Signal::kCv) | MaskOf(Signal::kX));
  EXPECT_THAT(Refusal("t_s,CV_pct,P1_kPa\n0,1,2", options),
              HasSubstr("one of X_pct, F_m3_h, F_t_h"));
  EXPECT_THAT(Refusal("t_s,X_pct\n0,1", options), HasSubstr("column CV_pct"));
}

// Its own unit, and with it that of SP.
TEST(CsvTest, APvNeedsNoPositionAndNoFlow) {
  CsvOptions options;
  options.required = MaskOf(Signal::kCv);
  const CsvTable table = Read(
      "t_s,CV_pct,pv,SP\n0,41,3.125,3.5\n1,42,,3.5\n2,43,-9e11,4", options);
  EXPECT_EQ(table.header.signals,
            MaskOf(Signal::kCv) | MaskOf(Signal::kPv) | MaskOf(Signal::kSp));
  const auto& samples = table.runs.at(0).samples;
  EXPECT_EQ(samples[0].sample[Signal::kPv], 3.125);
  EXPECT_EQ(samples[0].sample[Signal::kSp], 3.5);
  // Nobody knows the unit of a set point alone.
  EXPECT_EQ(samples[1].sample.present, MaskOf(Signal::kCv));
  EXPECT_EQ(samples[2].sample[Signal::kPv], -9e11);
  // Without PV, SP is a name of somebody else's.
  EXPECT_EQ(Read("t_s,CV_pct,X_pct,SP\n0,1,2,3\n1,1,2,3", options)
                .header.ignored_columns,
            std::vector<std::string>{"SP"});
}

TEST(CsvTest, AMapNamesThePvOrThereIsNone) {
  CsvOptions options;
  options.required = MaskOf(Signal::kCv);
  options.map.columns = {{"OP", Signal::kCv}, {"F", Signal::kF}};
  options.map.flow_unit = FlowUnit::kM3PerHour;
  const char* text = "t_s,OP,F,PV\n0,1,2,3\n1,1,2,3";
  EXPECT_EQ(Read(text, options).header.ignored_columns,
            std::vector<std::string>{"PV"});
  options.map.columns = {{"OP", Signal::kCv}, {"PV", Signal::kPv, 10.0}};
  EXPECT_EQ(Read(text, options).runs.at(0).samples[0].sample[Signal::kPv],
            30.0);
}

TEST(CsvTest, LineByLineReaderAnswersWithEachRow) {
  CsvReader reader({});
  EXPECT_FALSE(reader.TakeLine(kHeader));
  EXPECT_THROW(reader.Finish(), DataError);
  EXPECT_EQ(reader.TakeLine("0,1,2,3,4,5,6")->t_s, 0.0);
  EXPECT_EQ(reader.TakeLine("0.5,1,2,3,4,5,6")->t_s, 0.5);
}

TEST(CsvTest, WrittenNumbersReadBackAsTheSameBits) {
  std::mt19937_64 random(11);
  std::vector<LabelledSample> samples(500);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    Sample& s = samples[k].sample;
    s.stamp_ns =
        1'700'000'000'123'456'789 + static_cast<std::int64_t>(k) * 333'333'333;
    s.flow_unit = FlowUnit::kTPerHour;
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      double value = std::bit_cast<double>(random());
      s.Set(static_cast<Signal>(i), std::isfinite(value) ? value : 5e-324);
    }
    samples[k].truth = k < 250 ? FaultTruth{} : FaultTruth{7, -1.0 / 3.0};
  }
  std::ostringstream output;
  WriteCsv(output, samples, FlowUnit::kTPerHour, 1'700'000'000'000'000'000);

  CsvOptions options;
  options.start_ns = 1'700'000'000'000'000'000;
  const SampleSeries run = Read(output.str(), options).runs.at(0);
  ASSERT_EQ(run.samples.size(), samples.size());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const Sample& s = run.samples[k].sample;
    ASSERT_EQ(s.stamp_ns, samples[k].sample.stamp_ns);
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      ASSERT_EQ(std::bit_cast<std::uint64_t>(s.values[i]),
                std::bit_cast<std::uint64_t>(samples[k].sample.values[i]));
    }
    ASSERT_EQ(run.samples[k].truth->fault, samples[k].truth->fault);
    ASSERT_EQ(run.samples[k].truth->strength, samples[k].truth->strength);
  }
}

// A transmitter that fails for some samples, and one that never answers.
TEST(CsvTest, RunWithMissingReadingsIsReadBackBitForBit) {
  std::vector<LabelledSample> samples(20);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    Sample& s = samples[k].sample;
    s.stamp_ns = static_cast<std::int64_t>(k) * 1'000'000'000;
    s.seq = k;
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      const auto signal = static_cast<Signal>(i);
      // A set point is there with its PV.
      const std::size_t phase = signal == Signal::kSp ? Index(Signal::kPv) : i;
      if (signal != Signal::kPz && (k + phase) % 3 != 0) {
        s.Set(signal, 0.1 * static_cast<double>(k + i));
      }
    }
  }
  std::ostringstream written;
  WriteCsv(written, samples, FlowUnit::kM3PerHour, 0);
  EXPECT_THAT(written.str(), Not(HasSubstr("nan")));

  const SampleSeries run = Read(written.str()).runs.at(0);

  ASSERT_EQ(run.samples.size(), samples.size());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const Sample& s = run.samples[k].sample;
    ASSERT_EQ(s.present, samples[k].sample.present) << k;
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      if (s.Has(static_cast<Signal>(i))) {
        ASSERT_EQ(std::bit_cast<std::uint64_t>(s.values[i]),
                  std::bit_cast<std::uint64_t>(samples[k].sample.values[i]));
      }
    }
  }
  std::ostringstream again;
  WriteCsv(again, run.samples, FlowUnit::kM3PerHour, 0);
  EXPECT_EQ(again.str(), written.str());
}

TEST(CsvTest, EmptyAndNanCellsOfASignalAreMissingReadings) {
  const SampleSeries run =
      Read(std::string(kHeader) +
           "\n0,1,,3,4,5,6\n1,1,NaN,3,4,5,6\n2,1,2,3,4,5,6")
          .runs.at(0);

  EXPECT_FALSE(run.samples[0].sample.Has(Signal::kP1));
  EXPECT_FALSE(run.samples[1].sample.Has(Signal::kP1));
  EXPECT_TRUE(run.samples[1].sample.Has(Signal::kP2));
  EXPECT_THAT(Refusal(Table({"0", ""})), HasSubstr("column \"t_s\": \"\" is "
                                                   "not a finite number"));
}

TEST(CsvTest, QuotedCellsHoldSeparatorsQuotesAndLineBreaks) {
  CsvCells record;
  const std::vector<std::string> cells = {
      "plain", "a,b", "say \"no\"", "two\nlines", " blanks ", ""};
  std::ostringstream written;
  WriteCsvLine(written, cells);
  EXPECT_EQ(written.str(),
            "plain,\"a,b\",\"say \"\"no\"\"\",\"two\nlines\",\" blanks \",\n");

  EXPECT_FALSE(record.TakeLine("plain,\"a,b\",\"say \"\"no\"\"\",\"two"));
  EXPECT_TRUE(record.open());
  EXPECT_TRUE(record.TakeLine("lines\",\" blanks \",\r"));
  EXPECT_EQ(record.cells(), cells);
  EXPECT_TRUE(record.TakeLine(" \r"));
  EXPECT_TRUE(record.blank());

  const CsvTable table = Read(
      "\xEF\xBB\xBFt_s,\"CV_pct\",P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h,note\r\n"
      "0,1,2,3,4,5,6,\"tag, \"\"old\"\"\r\nunit\"\r\n"
      "1,\"1\",2,3,4,5,6,\r\n");
  EXPECT_EQ(table.runs.at(0).samples.size(), 2U);
  EXPECT_THAT(Refusal(Table({"0", "1"}) + "\n2,\"1,2,3,4,5,6\n"),
              HasSubstr("a quote is not closed"));
}

TEST(CsvTest, AByteOrderMarkDoesNotHideTheSeparator) {
  CsvOptions options;
  options.required = MaskOf(Signal::kX);
  const CsvTable table = ReadCsv(
      ToUtf8("\xEF\xBB\xBFsep=|\nt_s|CV_pct|X_pct\n0|1,5|2\n1|1|2\n", "input"),
      options);
  EXPECT_EQ(table.runs.at(0).samples.size(), 2U);
}

TEST(CsvTest, WhatIsSkippedTellsNothingAboutTheDecimalSign) {
  CsvOptions options;
  options.required = MaskOf(Signal::kX);
  options.map.skip = 1;
  const CsvTable table = ReadCsv(
      "Plant 2;1.234,5;t\nt_s;CV_pct;X_pct\n0;1.5;2.25\n1;1.5;2.25\n", options);
  EXPECT_DOUBLE_EQ(table.runs.at(0).samples.at(0).sample[Signal::kX], 2.25);
}

// A long table in UTF-16, with an hour that clocks show twice.
TEST(CsvTest, TagsOfALongTableAreResampledAndWhatIsFilledIsMarked) {
  CsvOptions options;
  options.map.long_table = LongTable{"Tag", "Wert", "Q"};
  options.map.time_column = "Zeit";
  options.map.zone = "Europe/Warsaw";
  options.map.columns = {{"CV", Signal::kCv, 1.0, 0.0, Sense::kOpening, "%"},
                         {"X", Signal::kX, 1.0, 0.0, Sense::kOpening, "%"}};
  options.map.resampling = Resampling{1.0, true, 5.0};
  std::string wide("\xFF\xFE", 2);
  for (const char c : std::string("Tag;Zeit;Wert;Q\r\n"
                                  "CV;25.10.2026 02:59:58;40,5;Good\r\n"
                                  "X;25.10.2026 02:59:58;40,5;Good\r\n"
                                  "CV;25.10.2026 02:00:00;42,5;Good\r\n"
                                  "X;25.10.2026 02:00:00;7,5;Bad\r\n"
                                  "X;25.10.2026 02:00:02;48,5;Good\r\n"
                                  "CV;25.10.2026 02:00:02;44,5;Good\r\n")) {
    wide += c;
    wide += '\0';
  }

  const CsvTable table = ReadCsv(ToUtf8(wide, "input"), options);

  // date -d 2026-10-25T02:59:58+02:00 +%s
  EXPECT_EQ(table.start_ns, 1'792'889'998'000'000'000);
  ASSERT_EQ(table.runs.size(), 1U);
  const auto& samples = table.runs[0].samples;
  ASSERT_EQ(samples.size(), 5U);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const Sample& sample = samples[k].sample;
    const auto quality = [&](bool filled) {
      return filled ? SignalQuality::kUncertain : SignalQuality::kGood;
    };
    EXPECT_DOUBLE_EQ(sample[Signal::kCv], 59.5 - static_cast<double>(k));
    EXPECT_DOUBLE_EQ(sample[Signal::kX], 59.5 - 2.0 * static_cast<double>(k));
    EXPECT_EQ(sample.quality[Index(Signal::kCv)], quality(k % 2 == 1));
    EXPECT_EQ(sample.quality[Index(Signal::kX)], quality(k % 4 != 0));
  }
}

// Pieces of an export meet in rows that are there twice; the tags of one
// instant are not such rows.
TEST(CsvTest, RepeatsOfALongTableAreThoseOfATag) {
  CsvOptions options;
  options.map.long_table = LongTable{};
  options.map.time_column = "time";
  options.map.zone = "UTC";
  options.map.columns = {{"OP", Signal::kCv}, {"ZT", Signal::kX}};
  options.skip_repeats = true;

  const CsvTable table = ReadCsv(
      "time,tag,value\n"
      "2026-01-05 10:00:00,OP,40\n2026-01-05 10:00:00,ZT,41\n"
      "2026-01-05 10:00:01,OP,42\n2026-01-05 10:00:01,ZT,43\n"
      "2026-01-05 10:00:01,OP,42\n2026-01-05 10:00:01,ZT,43\n",
      options);

  ASSERT_EQ(table.runs.size(), 1U);
  ASSERT_EQ(table.runs[0].samples.size(), 2U);
  EXPECT_EQ(table.runs[0].samples[1].sample[Signal::kCv], 42.0);
  EXPECT_EQ(table.runs[0].samples[1].sample[Signal::kX], 43.0);
}

// A long table names its signals in rows: without a map of tags it has none.
TEST(CsvTest, ALongTableWithoutAMappedTagIsRefusedWithItsTags) {
  for (const bool resampled : {false, true}) {
    CsvOptions options;
    options.map.long_table = LongTable{"Tag", "Value", ""};
    options.map.time_column = "Time";
    if (resampled) {
      options.map.resampling = Resampling{5.0, true, 600.0};
    }
    const auto read = [&](const std::string& rows) {
      try {
        ReadCsv("Time,Tag,Value\n" + rows, options);
      } catch (const DataError& error) {
        return std::string(error.what());
      }
      return std::string();
    };

    EXPECT_THAT(
        read("2026-03-10T08:00:00Z,FIC23.OP,45.11\n"
             "2026-03-10T08:00:00Z,FIC23.PV,4.929\n"),
        AllOf(HasSubstr("no tag of column \"Tag\" is mapped"),
              HasSubstr("FIC23.OP,FIC23.PV"), HasSubstr("[signal.CV]")));
    EXPECT_THAT(read(""), Not(IsEmpty()));
  }
}

TEST(CsvTest, FilesThatCannotBeReadAreNamedWithTheReason) {
  const storage::TemporaryDirectory directory;
  const auto message = [](const std::filesystem::path& path) {
    try {
      ReadCsvFile(path);
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THROW(ReadCsvFile(directory.path() / "none.csv"), NotFoundError);
  EXPECT_THAT(message(directory.path()),
              HasSubstr("is a folder without a table"));
}

}  // namespace
}  // namespace fdi::importer
