#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <unistd.h>

#include "diagnosis/error.h"
#include "storage/cli/envelope.h"
#include "storage/cli/output_folder.h"
#include "storage/cli/svg.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::cli {
namespace {

using storage::TemporaryDirectory;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr SvgArea kArea{0.0, 0.0, 100.0, 50.0};
constexpr SvgScale kHeight{0.0, 1.0, 50.0, 0.0};

TEST(SvgTest, TextIsEscaped) {
  EXPECT_EQ(XmlText("a<b> & \"c\""), "a&lt;b&gt; &amp; &quot;c&quot;");
}

TEST(SvgTest, NumbersAreHalvesOfAPixel) {
  EXPECT_EQ(SvgNumber(12.0), "12");
  EXPECT_EQ(SvgNumber(12.3), "12.5");
  EXPECT_EQ(SvgNumber(0.5), ".5");
  EXPECT_EQ(SvgNumber(-0.5), "-.5");
  EXPECT_EQ(SvgNumber(-0.1), "0");
}

TEST(SvgTest, TicksAreRound) {
  EXPECT_THAT(RoundTicks(-1.7, 1.7, 4), ElementsAre(-1.0, 0.0, 1.0));
  EXPECT_THAT(RoundTicks(0.0, 1000.0, 5),
              ElementsAre(0.0, 200.0, 400.0, 600.0, 800.0, 1000.0));
  EXPECT_TRUE(RoundTicks(1.0, 1.0, 5).empty());
  EXPECT_FALSE(std::signbit(RoundTicks(-1.0, 1.0, 2)[1]));
}

TEST(SvgTest, DocumentNeedsNothingOutsideItself) {
  SvgCanvas canvas(10.0, 10.0, "a < b");
  canvas.Text(1.0, 2.0, "x & y");
  const std::string document = canvas.Document();
  EXPECT_THAT(document, HasSubstr("prefers-color-scheme:dark"));
  EXPECT_THAT(document, HasSubstr("<title>a &lt; b</title>"));
  EXPECT_THAT(document, HasSubstr("x &amp; y"));
  EXPECT_THAT(document, Not(HasSubstr("href")));
  EXPECT_THAT(canvas.Element(), Not(HasSubstr("<style>")));
}

// Each column is drawn once, whatever the number of values.
TEST(EnvelopeTest, PathDoesNotGrowWithTheSeries) {
  const auto length = [](int values) {
    Envelope envelope(0.0, 1.0, 100);
    for (int i = 0; i < values; ++i) {
      envelope.Add((i + 0.5) / values, 0.5 + 0.5 * std::sin(2.7 * i));
    }
    return envelope.PathData(kArea, kHeight).size();
  };
  EXPECT_LT(length(100000), 2000U);
  EXPECT_NEAR(static_cast<double>(length(100000)),
              static_cast<double>(length(10000)), 100.0);
}

TEST(EnvelopeTest, PeakOfOneValueIsKept) {
  Envelope envelope(0.0, 1.0, 100);
  for (int i = 0; i < 100000; ++i) {
    envelope.Add((i + 0.5) / 1e5, i == 50001 ? 1.0 : 0.0);
  }
  EXPECT_EQ(envelope.maximum(), 1.0);
  // From the bottom up to the top, and down again in the next column.
  EXPECT_EQ(envelope.PathData(kArea, kHeight), "M.5 50l50 0 0-50 1 50 48 0");
}

TEST(EnvelopeTest, MergedColumnsKeepTheirExtremes) {
  Envelope envelope(0.0, 8.0, 8);
  for (const double x : {0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5}) {
    envelope.Add(x, x == 2.5 ? 1.0 : 0.0);
  }
  EXPECT_EQ(envelope.PathData({0.0, 0.0, 80.0, 50.0}, kHeight, 4),
            "M20 50l0-50 40 50");
}

TEST(EnvelopeTest, NaNBreaksTheLineAndEmptyColumnsDoNot) {
  Envelope envelope(0.0, 10.0, 10);
  envelope.Add(0.5, 0.0);
  envelope.Add(4.5, 1.0);
  envelope.Add(6.5, std::numeric_limits<double>::quiet_NaN());
  envelope.Add(8.5, 0.0);
  EXPECT_EQ(envelope.PathData(kArea, kHeight), "M5 50l40-50M85 50l1 0");
}

TEST(EnvelopeTest, ValuesBeyondTheScaleStayWithinTheArea) {
  Envelope envelope(0.0, 10.0, 10);
  envelope.Add(0.5, 0.0);
  envelope.Add(1.5, 1e9);
  EXPECT_EQ(envelope.PathData(kArea, kHeight), "M5 50l10-50");
  EXPECT_EQ(Envelope(0.0, 1.0, 3).PathData(kArea, kHeight), "");
  EXPECT_TRUE(Envelope(0.0, 1.0, 3).empty());
}

template <typename Action>
std::string MessageOf(const Action& action) {
  try {
    action();
  } catch (const DataError& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(OutputFolderTest, FolderIsMadeOnlyWithinOneThatIsThere) {
  const TemporaryDirectory directory;
  const auto folder = directory.path() / "report";
  EnsureFolder(folder);
  EnsureFolder(folder);
  EXPECT_TRUE(std::filesystem::is_directory(folder));
  EXPECT_THAT(
      MessageOf([&] { EnsureFolder(directory.path() / "no" / "report"); }),
      HasSubstr("there is no folder " + (directory.path() / "no").string()));
  std::ofstream(directory.path() / "file") << "x";
  EXPECT_THAT(MessageOf([&] { EnsureFolder(directory.path() / "file"); }),
              HasSubstr((directory.path() / "file").string()));
}

TEST(OutputFolderTest, FolderWithoutPermissionIsNamed) {
  if (geteuid() == 0) {
    GTEST_SKIP() << "root may write anywhere";
  }
  const TemporaryDirectory directory;
  const auto folder = directory.path() / "closed";
  EnsureFolder(folder);
  std::filesystem::permissions(folder, std::filesystem::perms::owner_read);
  EXPECT_THAT(MessageOf([&] { EnsureFolder(folder); }),
              HasSubstr(folder.string()));
  std::filesystem::permissions(folder, std::filesystem::perms::owner_all);
}

TEST(OutputFolderTest, FileThatCannotBeWrittenIsNamedAndLeavesNoPart) {
  const TemporaryDirectory directory;
  std::filesystem::create_directory(directory.path() / "taken");
  EXPECT_THAT(MessageOf([&] { WriteFile(directory.path() / "taken", "x"); }),
              HasSubstr((directory.path() / "taken").string()));
  EXPECT_FALSE(std::filesystem::exists(directory.path() / "taken.part"));
}

}  // namespace
}  // namespace fdi::cli
