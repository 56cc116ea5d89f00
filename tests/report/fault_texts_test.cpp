#include "report/fault_texts.h"

#include <fstream>
#include <functional>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "report/shared_files.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::report {
namespace {

using testing::HasSubstr;

class FaultTextsTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name,
                              const std::string& text) {
    std::ofstream(directory_.path() / name) << text;
    return directory_.path() / name;
  }
  std::string Refusal(const std::string& text) {
    try {
      texts_.Override(Write("own.toml", text));
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "accepted";
  }

  storage::TemporaryDirectory directory_;
  FaultTexts texts_{SharedFile("faults.toml")};
};

TEST_F(FaultTextsTest, ShippedCatalogueHasWordsOfItsOwnForEveryFault) {
  std::set<std::string> names{texts_.Of(0).name};
  for (const int fault : kFaultsAndFindings) {
    EXPECT_GT(texts_.Of(fault).check.size(), 60u) << fault;
    EXPECT_TRUE(names.insert(texts_.Of(fault).name).second) << fault;
  }
  EXPECT_EQ(texts_.Of(16).discipline, Discipline::kAir);
  EXPECT_EQ(texts_.Of(19).namur, NamurClass::kFailure);
}

// Or else who finds the plug at its end takes the name for a contradiction.
TEST_F(FaultTextsTest, FlashingSaysWhereThePlugEnds) {
  EXPECT_THAT(texts_.Of(7).check, HasSubstr("X at its open end (0 %)"));
}

TEST_F(FaultTextsTest, SeverityFollowsTheSizeOfTheStrength) {
  texts_.Override(Write("own.toml",
                        "[f19]\nseverity = [{from = 0.0, level = 'low'},"
                        "{from = 0.5, level = 'critical'}]"));

  EXPECT_EQ(SeverityAt(texts_.Of(19).bands, 0.49), Severity::kLow);
  EXPECT_EQ(SeverityAt(texts_.Of(19).bands, -0.5), Severity::kCritical);
}

TEST_F(FaultTextsTest, FiguresHaveLimitsThatAreAccepted) {
  const auto& band = texts_.Of(loop::Figure::kDeadBand);
  EXPECT_FALSE(band.Exceeded(1.0));
  EXPECT_TRUE(band.Exceeded(1.01));
  const auto& gain = texts_.Of(loop::Figure::kTravelGain);
  EXPECT_TRUE(gain.Exceeded(0.89));
  EXPECT_TRUE(gain.Exceeded(1.11));
  EXPECT_FALSE(texts_.Of(loop::Figure::kT63).Exceeded(1e9));

  texts_.Override(Write("own.toml", "[figure.t63]\nhighest = 3"));
  EXPECT_TRUE(texts_.Of(loop::Figure::kT63).Exceeded(3.1));
  EXPECT_FALSE(texts_.Of(loop::Figure::kT63).name.empty());
  EXPECT_THAT(Refusal("[figure.dead_bend]\nhighest = 3"),
              HasSubstr("dead_bend"));
  EXPECT_THAT(Refusal("[figure.dead_band]\nlowest = 4"),
              HasSubstr("lowest is above highest"));
}

TEST_F(FaultTextsTest, OverrideLeavesWhatItDoesNotName) {
  const std::string check = texts_.Of(9).check;

  texts_.Override(Write("own.toml", "[f9]\nname = 'West header leaks'"));

  EXPECT_EQ(texts_.Of(9).name, "West header leaks");
  EXPECT_EQ(texts_.Of(9).check, check);
}

TEST_F(FaultTextsTest, MistypedKeysAreRefusedWithASuggestion) {
  EXPECT_THAT(Refusal("[f9]\nnane = 'x'"), HasSubstr("did you mean 'name'"));
  EXPECT_THAT(Refusal("[unknwon]\nname = 'x'"),
              HasSubstr("did you mean 'unknown'"));
  EXPECT_THAT(Refusal("[f9]\ndiscipline = 'plumber'"),
              HasSubstr("operator, instrument, air, mechanical"));
  EXPECT_THAT(Refusal("[f9]\nseverity = [{from = 0.5, level = 'low'}]"),
              HasSubstr("begin at 0"));
}

TEST_F(FaultTextsTest, CatalogueWithAMissingFaultIsRefused) {
  EXPECT_THROW(FaultTexts(Write("part.toml", "[f9]\nname = 'x'")), ConfigError);
}

TEST_F(FaultTextsTest, GroupIsNamedWholeAndAsGraveAsItsGravestMember) {
  const FaultWords words = texts_.Words("f3|f19", 0.8);

  EXPECT_EQ(words.name, texts_.Of(3).name + " or " + texts_.Of(19).name);
  EXPECT_EQ(words.check, texts_.Of(3).check);
  EXPECT_EQ(words.discipline, "mechanical|instrument");
  EXPECT_EQ(words.namur, NamurClass::kFailure);
  EXPECT_EQ(words.severity, Severity::kCritical);
}

TEST_F(FaultTextsTest, WhatHasNoNameIsUnknown) {
  EXPECT_EQ(texts_.Words("", 0.0).name, texts_.Of(0).name);
  EXPECT_EQ(texts_.Words("unknown", 0.0).name, texts_.Of(0).name);
}

TEST_F(FaultTextsTest, FileInTheDataDirectoryOverrides) {
  GlobalOptions options;
  options.data_dir = directory_.path();
  Write("faults.toml", "[f9]\nname = 'mine'");

  const FaultTexts texts = LoadFaultTexts(options);

  EXPECT_EQ(texts.Of(9).name, "mine");
  EXPECT_EQ(texts.Of(8).name, texts_.Of(8).name);
}

TEST(SharedFileTest, MissingFileNamesWhereItWasLookedFor) {
  try {
    SharedFile("no-such-file");
    FAIL();
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr("share/fdi/no-such-file"));
  }
}

}  // namespace
}  // namespace fdi::report
