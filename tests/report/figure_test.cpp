// The content of a picture, and the script that draws it.
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stop_token>

#include <gmock/gmock.h>

#include "base/error.h"
#include "report/plot/episode_figure.h"
#include "report/plot/episode_text.h"
#include "report/plot/gnuplot.h"
#include "tests/storage/history_fixture.h"
#include "tests/storage/message_of.h"

namespace fdi::plot {
namespace {

using storage::HistoryFixture;
using storage::HistoryReader;
using storage::HistoryWriter;
using storage::MessageOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

TEST(IntervalTextTest, AWidthThatCannotBeSeenIsLeftOut) {
  EXPECT_EQ(IntervalText(0.42, 0.38, 0.46, 2), "0.42 (0.38 to 0.46)");
  EXPECT_EQ(IntervalText(0.19, 0.189, 0.191, 2), "0.19");
  EXPECT_EQ(IntervalText(0.19, 0.19, 0.19, 2), "0.19");
}

// The data of the only series of a figure, as the script has them.
std::string Points(const Figure& figure) {
  const std::string script = GnuplotScript(figure, Format::kSvg, "x.svg");
  const std::string begin = "$p0s0 << EOD\n";
  const std::size_t from = script.find(begin) + begin.size();
  return script.substr(from, script.find("EOD\n", from) - from);
}

std::vector<std::string> TextsOf(const std::vector<Mark>& marks) {
  std::vector<std::string> texts;
  for (const Mark& mark : marks) {
    texts.push_back(mark.text);
  }
  return texts;
}

TEST(FigureDataTest, LinesBreakAtGapsAndWhereNothingIs) {
  Figure figure;
  figure.x = {0, 1, 5, 6};
  figure.gap = 1.5;
  figure.panels = {{"a", {{.y = {1, 2, 3, kNone}}}}};

  EXPECT_EQ(Points(figure), "0 1\n1 2\n5 NaN\n5 3\n6 NaN\n");
}

TEST(FigureDataTest, ThinningKeepsTheOneSampleThatStandsOut) {
  Figure figure;
  std::vector<double> values;
  for (int i = 0; i < 100'000; ++i) {
    figure.x.push_back(i);
    values.push_back(i == 77'777 ? -5.0 : 1.0);
  }

  figure.panels = {{"a", {{.y = values}}}};

  const std::string points = Points(figure);

  EXPECT_THAT(points, HasSubstr("\n77777 -5\n"));
  EXPECT_LT(std::count(points.begin(), points.end(), '\n'), 4000);
}

// Both kinds of quotes, a command in backquotes, and a quote at the beginning,
// which gnuplot does not accept doubled.
TEST(FigureScriptTest, AnyNameIsDrawnAsItIs) {
  for (const std::string name :
       {"'1\" O'Hara `echo ran`\\n", "\"quoted\"", "''", "`17`8", "a\nb"}) {
    Figure figure{name};
    figure.x = {0, 1};
    figure.panels = {{name, {{.title = name, .y = {1, 2}}}}};
    figure.marks = {{0.5, name}};
    if (!HaveGnuplot()) {
      GTEST_SKIP() << "gnuplot is not installed";
    }

    const std::string svg = DrawFigure(figure, Format::kSvg);

    EXPECT_EQ(svg.find(">ran"), std::string::npos);
    EXPECT_THAT(svg, HasSubstr(name == "a\nb" ? "a b" : name));
  }
}

TEST(FigureScriptTest, SeriesAndPanelsWithoutNumbersDoNotReachGnuplot) {
  Figure figure;
  figure.x = {0, 1};
  figure.panels = {{"a", {{.title = "full", .y = {1, 2}}}},
                   {"b", {{.title = "void", .y = {kNone, kNone}}}}};

  EXPECT_THAT(GnuplotScript(figure, Format::kSvg, "x.svg"),
              Not(HasSubstr("void")));
  figure.panels.erase(figure.panels.begin());
  EXPECT_THROW(GnuplotScript(figure, Format::kSvg, "x.svg"), DataError);
}

// The stem of a mark reaches up to its name, and would strike out a name to the
// left of it in a lower row.
TEST(FigureScriptTest, NamesOfMarksStandAboveThoseFurtherRight) {
  Figure figure;
  figure.x = {0, 1000};
  figure.panels = {{"a", {{.y = {1, 2}}}}};
  figure.marks = {{0, "start"}, {1, "detected"}, {900, "closed"}};

  const std::string script = GnuplotScript(figure, Format::kSvg, "x.svg");

  const auto height_of = [&script](const std::string& name) {
    const std::size_t at = script.find("screen ", script.find('"' + name));
    return std::stod(script.substr(at + 7));
  };
  EXPECT_GT(height_of("start"), height_of("detected"));
  EXPECT_EQ(height_of("detected"), height_of("closed"));
}

TEST(FigureScriptTest, StripsBarsStepsAndNotesAreDrawn) {
  if (!HaveGnuplot()) {
    GTEST_SKIP() << "gnuplot is not installed";
  }
  Figure figure;
  figure.x_label = "X [%]";
  figure.panels = {{.label = "share [%]",
                    .series = {{.title = "bars",
                                .y = {1, 2, 3},
                                .x = {10, 20, 30},
                                .shape = Shape::kBars},
                               {.title = "steps",
                                .y = {3, 2, 1},
                                .x = {10, 20, 30},
                                .shape = Shape::kSteps}},
                    .notes = {"90 residuals"}},
                   {.label = "isolated",
                    .bands = {{12, 28, "f19", ink::kGreen}},
                    .height = 18.0}};

  const std::string svg = DrawFigure(figure, Format::kSvg);

  for (const char* text :
       {"bars", "steps", "90 residuals", "f19", "isolated"}) {
    EXPECT_THAT(svg, HasSubstr(text));
  }
  EXPECT_EQ(DrawFigure(figure, Format::kPng).substr(1, 3), "PNG");
}

TEST(FigureScriptTest, TheLastPanelMayHaveAnAxisOfItsOwn) {
  if (!HaveGnuplot()) {
    GTEST_SKIP() << "gnuplot is not installed";
  }
  Figure figure;
  figure.is_time = true;
  figure.x_label = "time";
  figure.x = {0, 60, 120};
  figure.panels = {{.label = "PV", .series = {{.title = "PV", .y = {1, 2, 1}}}},
                   {.label = "PV",
                    .series = {{.title = "samples",
                                .y = {1, 2, 1},
                                .x = {5050, 5000, 5025},
                                .shape = Shape::kPoints}},
                    .own_axis = Range{4990, 5060},
                    .own_label = "OP [%]"}};

  const std::string svg = DrawFigure(figure, Format::kSvg);

  EXPECT_THAT(svg, HasSubstr("time [s]"));
  EXPECT_THAT(svg, HasSubstr("OP [%]"));
  EXPECT_THAT(svg, HasSubstr("5020"));  // Not in the unit of the time.
}

TEST(FigureScriptTest, TheAxisShowsTheClockOverMidnight) {
  Figure figure{"V1"};
  figure.is_time = true;
  figure.clock_s = 23 * 3600.0 + 40 * 60.0;
  figure.x = {-1800, 0, 1800};
  figure.panels = {{"F", {{.title = "F", .y = {1, 2, 3}}}}};
  if (!HaveGnuplot()) {
    GTEST_SKIP() << "gnuplot is not installed";
  }

  const std::string svg = DrawFigure(figure, Format::kSvg);

  EXPECT_THAT(svg, HasSubstr("23:30"));
  EXPECT_THAT(svg, HasSubstr("00:00"));
}

TEST(FigureScriptTest, OnlyPngAndSvgInAFolderThatIsThere) {
  EXPECT_THAT(MessageOf<ConfigError>([] { DrawFigure({}, "x.bmp"); }),
              HasSubstr("accepted endings are .png and .svg"));
  EXPECT_THAT(MessageOf<DataError>([] { DrawFigure({}, "/nowhere/x.png"); }),
              HasSubstr("no folder /nowhere"));
}

TEST(GnuplotTest, IsKilledOnceItTakesTooLong) {
  const storage::TemporaryDirectory tools;
  const auto program = tools.path() / "gnuplot";
  std::ofstream(program) << "#!/bin/sh\nsleep 1000\n";
  std::filesystem::permissions(program, std::filesystem::perms(0700));
  const std::string path = std::getenv("PATH");
  setenv("PATH", (tools.path().string() + ":" + path).c_str(), 1);
  const auto run = [](const GnuplotLimits& limits) {
    return MessageOf<std::runtime_error>(
        [&] { RunGnuplot([](const auto&) { return std::string(); }, limits); });
  };
  std::stop_source stop;
  stop.request_stop();

  EXPECT_THAT(run({std::chrono::milliseconds(200), {}}),
              HasSubstr("gnuplot was killed: it took longer than 200 ms"));
  EXPECT_THAT(run({std::chrono::hours(1), stop.get_token()}),
              HasSubstr("gnuplot was killed"));
  setenv("PATH", path.c_str(), 1);
}

class EpisodeFigureTest : public HistoryFixture {
 protected:
  EpisodeFigureTest() {
    HistoryWriter writer(path_);
    RecordEpisode(writer, 0b010);
    writer.AppendTrace(Id(), Instants(150, -30));
    writer.AddGap({"LV-1", kDetected + 40 * kSecond, kDetected + 45 * kSecond,
                   "monitor_down"});
    writer.AddGap({"LV-2", kDetected, kDetected + kSecond, "other"});
    writer.EndSession(kDetected, true);
  }

  EpisodeEvidence Evidence() {
    HistoryReader reader(path_);
    return LoadEvidence(reader, "last", directory_.path() / "models.db");
  }
};

TEST_F(EpisodeFigureTest, HasTheMarksOfTheEpisodeAndTheGapsOfTheValve) {
  const Figure figure = EpisodeFigure(Evidence());

  EXPECT_THAT(
      TextsOf(figure.marks),
      ElementsAre("start", "detected", "isolated f7", "cleared", "closed"));
  EXPECT_NEAR(figure.marks[2].x, 20.0, 1e-9);
  EXPECT_EQ(figure.x_label, "UTC of 2026-11-20");
  EXPECT_EQ(figure.clock_s, 14 * 3600 + 56 * 60 + 11);
  ASSERT_EQ(figure.bands.size(), 1U);
  EXPECT_EQ(figure.bands[0].text, "monitor_down");
  EXPECT_NEAR(figure.bands[0].to, 45.0, 1e-9);
  // Flow, travel, two residuals, factors.
  ASSERT_EQ(figure.panels.size(), 5U);
  EXPECT_EQ(figure.panels[4].series[0].title, "f7 (isolated)");
  EXPECT_NEAR(figure.x.front(), -30.0, 1e-9);
  EXPECT_THAT(figure.footnote, HasSubstr("thresholds are not shown"));
}

TEST_F(EpisodeFigureTest, ARepairIsDrawn) {
  storage::ValveEvent repair;
  repair.kind = storage::ValveEventKind::kRepacked;
  repair.at_ns = kDetected + 25 * kSecond;
  storage::ModelStore models(directory_.path() / "models.db",
                             storage::Access::kOccasionalWriter);
  models.AddValveEvent("*", repair);
  repair.kind = storage::ValveEventKind::kOrdered;
  ++repair.at_ns;
  models.AddValveEvent("*", repair);
  const Figure figure = EpisodeFigure(Evidence());
  EXPECT_EQ(figure.marks.back().text, "repacked");
  EXPECT_NEAR(figure.marks.back().x, 25.0, 1e-9);
}

// The monitor was down for 5 s, and its successor settled for 14 s more.
TEST_F(EpisodeFigureTest, WhatIsMissingIsGreyUntilTheNextSample) {
  EpisodeEvidence evidence = Evidence();
  std::erase_if(evidence.trace, [](const TracePoint& point) {
    return point.sample.stamp_ns > kDetected + 40 * kSecond &&
           point.sample.stamp_ns < kDetected + 60 * kSecond;
  });

  const Figure figure = EpisodeFigure(evidence);

  ASSERT_EQ(figure.bands.size(), 1U);
  EXPECT_EQ(figure.bands[0].text, "monitor_down");
  EXPECT_NEAR(figure.bands[0].from, 40.0, 1e-9);
  EXPECT_NEAR(figure.bands[0].to, 60.0, 1e-9);
}

TEST_F(EpisodeFigureTest, ThresholdsAreThoseOfTheSetThatGaveTheAnswer) {
  EpisodeEvidence evidence = Evidence();
  models_.channels[1].lower_threshold = -2.5;
  models_.channels[1].upper_threshold = 3.5;
  evidence.models = models_;

  const Figure figure = EpisodeFigure(evidence);

  EXPECT_EQ(figure.panels[3].limits[0].value, 3.5);
  EXPECT_EQ(figure.panels[3].limits[1].value, -2.5);
  EXPECT_EQ(figure.panels[4].limits[0].value, 0.7);
}

TEST_F(EpisodeFigureTest, FaultsHaveFactorsFromTheDetectionOn) {
  const Figure figure = EpisodeFigure(Evidence());

  const std::vector<double>& fault = figure.panels[4].series[0].y;
  const std::vector<double>& normal = figure.panels[4].series.back().y;
  ASSERT_EQ(fault.size(), 150U);
  EXPECT_TRUE(std::isnan(fault[29]));
  EXPECT_FALSE(std::isnan(fault[30]));
  EXPECT_FALSE(std::isnan(normal[29]));
}

// The residual of F(CV) is small, and only its mean over 30 samples passes a
// limit when the episode begins.
TEST_F(EpisodeFigureTest, TheWindowThatMadeTheDetectionIsDrawnWithItsLimits) {
  EpisodeEvidence evidence = Evidence();
  evidence.episode.channels[1] = "F(CV)";
  models_.channels[1].name = "F(CV)";
  models_.channels[1].output = Signal::kF;
  models_.channels[1].lower_threshold = -100.0;
  models_.channels[1].upper_threshold = 100.0;
  WindowLimits limits;
  limits.length = 30;
  limits.lower_mean = -1.4;
  limits.upper_mean = 1.4;
  limits.upper_log_rms = 10.0;
  models_.channels[1].windows = {limits};
  models_.channels[0].windows = {limits};
  evidence.models = models_;

  const Figure figure = EpisodeFigure(evidence);

  ASSERT_EQ(figure.panels.size(), 6U);
  EXPECT_EQ(figure.panels[3].label, "residual of F(CV) [m3/h]");
  EXPECT_EQ(figure.panels[4].label, "residual of F(CV) [m3/h]");
  EXPECT_EQ(figure.panels[4].series[0].title, "mean over 30 samples");
  EXPECT_NEAR(figure.panels[4].series[0].y[30], -1.5, 0.06);
  EXPECT_EQ(figure.panels[4].limits[1].value, -1.4);
  EXPECT_EQ(figure.panels[5].label, "decision factor d [-]");
}

TEST_F(EpisodeFigureTest, ChannelsOfSeveralSignalsHaveTheUnitOfTheirOutput) {
  EpisodeEvidence evidence = Evidence();
  evidence.episode.channels = {"X(CV)", "F(CV)"};

  const Figure figure = EpisodeFigure(evidence);

  EXPECT_EQ(figure.panels[2].label, "residual of X(CV) [%]");
  EXPECT_EQ(figure.panels[3].label, "residual of F(CV) [m3/h]");
}

TEST_F(EpisodeFigureTest, TimeIsCutToWhatIsAskedFor) {
  EpisodeFigureOptions options;
  options.from_s = -10.0;
  options.to_s = 50.0;

  const Figure figure = EpisodeFigure(Evidence(), options);

  EXPECT_NEAR(figure.x.front(), -10.0, 1e-9);
  EXPECT_NEAR(figure.x.back(), 50.0, 1e-9);
}

}  // namespace
}  // namespace fdi::plot
