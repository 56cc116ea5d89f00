// What a picture shows, and the script that draws it.
#include <cmath>
#include <sstream>

#include <gmock/gmock.h>

#include "diagnosis/error.h"
#include "storage/plot/episode_figure.h"
#include "storage/plot/figure_data.h"
#include "storage/plot/run_figure.h"
#include "tests/storage/history_fixture.h"
#include "tests/storage/message_of.h"

namespace fdi::storage {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::string Points(const TimeFigure& figure,
                   const std::vector<double>& values) {
  std::ostringstream out;
  WritePoints(figure, values, 1.0, out);
  return out.str();
}

std::vector<std::string> TextsOf(const std::vector<FigureMark>& marks) {
  std::vector<std::string> texts;
  for (const FigureMark& mark : marks) {
    texts.push_back(mark.text);
  }
  return texts;
}

TEST(FigureDataTest, LinesBreakAtGapsAndWhereNothingIs) {
  TimeFigure figure;
  figure.t_s = {0, 1, 5, 6};

  EXPECT_EQ(Points(figure, {1, 2, 3, kNone}), "0 1\n1 2\n5 NaN\n5 3\n6 NaN\n");
}

TEST(FigureDataTest, ThinningKeepsTheOneSampleThatStandsOut) {
  TimeFigure figure;
  std::vector<double> values;
  for (int i = 0; i < 100'000; ++i) {
    figure.t_s.push_back(i);
    values.push_back(i == 77'777 ? -5.0 : 1.0);
  }

  const std::string points = Points(figure, values);

  EXPECT_THAT(points, HasSubstr("\n77777 -5\n"));
  EXPECT_LT(std::count(points.begin(), points.end(), '\n'), 4000);
}

TEST(FigureScriptTest, QuotesAndEmptyPanelsDoNotReachGnuplot) {
  TimeFigure figure;
  figure.title = "O'Hara\nvalve";
  figure.t_s = {0, 1};
  figure.panels = {
      {"a", {{"full", ink::kBlack, 1, Dash::kSolid, {1, 2}}}, {}},
      {"b", {{"void", ink::kBlack, 1, Dash::kSolid, {kNone, kNone}}}, {}}};

  const std::string script = GnuplotScript(figure, "x.svg");

  EXPECT_THAT(script, HasSubstr("'O''Hara valve'"));
  EXPECT_THAT(script, Not(HasSubstr("void")));
  figure.panels.erase(figure.panels.begin());
  EXPECT_THROW(GnuplotScript(figure, "x.svg"), DataError);
}

TEST(FigureScriptTest, OnlyPngAndSvgInAFolderThatIsThere) {
  EXPECT_THAT(MessageOf<ConfigError>([] { DrawFigure({}, "x.bmp"); }),
              HasSubstr("accepted endings are .png and .svg"));
  EXPECT_THAT(MessageOf<DataError>([] { DrawFigure({}, "/nowhere/x.png"); }),
              HasSubstr("no folder /nowhere"));
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
  const TimeFigure figure = EpisodeFigure(Evidence());

  EXPECT_THAT(
      TextsOf(figure.marks),
      ElementsAre("start", "detected", "isolated f7", "cleared", "closed"));
  EXPECT_NEAR(figure.marks[2].t_s, 20.0, 1e-9);
  ASSERT_EQ(figure.bands.size(), 1U);
  EXPECT_EQ(figure.bands[0].text, "monitor_down");
  EXPECT_NEAR(figure.bands[0].to_s, 45.0, 1e-9);
  // Flow, travel, two residuals, factors.
  ASSERT_EQ(figure.panels.size(), 5U);
  EXPECT_EQ(figure.panels[4].curves[0].title, "f7 (isolated)");
  EXPECT_NEAR(figure.t_s.front(), -30.0, 1e-9);
  EXPECT_THAT(figure.footnote, HasSubstr("thresholds are not shown"));
}

TEST_F(EpisodeFigureTest, ThresholdsAreThoseOfTheSetThatGaveTheAnswer) {
  EpisodeEvidence evidence = Evidence();
  models_.channels[1].lower_threshold = -2.5;
  models_.channels[1].upper_threshold = 3.5;
  evidence.models = models_;

  const TimeFigure figure = EpisodeFigure(evidence);

  EXPECT_EQ(figure.panels[3].levels[0].value, 3.5);
  EXPECT_EQ(figure.panels[3].levels[1].value, -2.5);
  EXPECT_EQ(figure.panels[4].levels[0].value, 0.7);
}

TEST_F(EpisodeFigureTest, FaultsHaveFactorsFromTheDetectionOn) {
  const TimeFigure figure = EpisodeFigure(Evidence());

  const std::vector<double>& fault = figure.panels[4].curves[0].values;
  const std::vector<double>& normal = figure.panels[4].curves.back().values;
  ASSERT_EQ(fault.size(), 150U);
  EXPECT_TRUE(std::isnan(fault[29]));
  EXPECT_FALSE(std::isnan(fault[30]));
  EXPECT_FALSE(std::isnan(normal[29]));
}

TEST_F(EpisodeFigureTest, TimeIsCutToWhatIsAskedFor) {
  EpisodeFigureOptions options;
  options.from_s = -10.0;
  options.to_s = 50.0;

  const TimeFigure figure = EpisodeFigure(Evidence(), options);

  EXPECT_NEAR(figure.t_s.front(), -10.0, 1e-9);
  EXPECT_NEAR(figure.t_s.back(), 50.0, 1e-9);
}

TEST(RunFigureTest, ShadesTheTruthAndLeavesRefusedSamplesOut) {
  StoredRun run;
  for (int k = 0; k < 10; ++k) {
    StoredSample stored;
    stored.sample.stamp_ns = k * 1'000'000'000LL;
    stored.sample.Set(Signal::kX, k);
    stored.truth = FaultTruth{k >= 4 && k < 8 ? 19 : 0, 0.1 * k};
    stored.intake = k == 5 ? Intake::kRange : Intake::kAccepted;
    stored.model_swapped = k == 6;
    run.samples.push_back(stored);
  }

  const TimeFigure figure = RunFigure(run);

  EXPECT_EQ(figure.t_s.size(), 9U);
  EXPECT_THAT(figure.footnote, HasSubstr("1 range"));
  ASSERT_EQ(figure.bands.size(), 1U);
  EXPECT_EQ(figure.bands[0].from_s, 4.0);
  EXPECT_EQ(figure.bands[0].text, "f19 0.70");
  EXPECT_THAT(TextsOf(figure.marks), ElementsAre("model set"));
}

}  // namespace
}  // namespace fdi::storage
