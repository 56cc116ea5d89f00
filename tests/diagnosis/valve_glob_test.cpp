#include "diagnosis/records/valve_glob.h"

#include <string>

#include <gtest/gtest.h>

namespace fdi {
namespace {

TEST(GlobMatchesTest, StarsAndQuestionMarks) {
  EXPECT_TRUE(GlobMatches("*", ""));
  EXPECT_TRUE(GlobMatches("FV-1*", "FV-101"));
  EXPECT_TRUE(GlobMatches("*-1*1", "FV-1011"));
  EXPECT_TRUE(GlobMatches("FV-???", "FV-101"));
  EXPECT_FALSE(GlobMatches("FV-?", "FV-101"));
  EXPECT_FALSE(GlobMatches("FV-1*2", "FV-101"));
  EXPECT_FALSE(GlobMatches("", "FV-101"));
  EXPECT_TRUE(GlobMatches("\\*", "\\a"));
}

TEST(GlobMatchesTest, SetsAreNegatedByBothSigns) {
  EXPECT_TRUE(GlobMatches("[a-c]", "b"));
  EXPECT_FALSE(GlobMatches("[a-c]", "d"));
  for (const char* glob : {"[!a-c]", "[^a-c]"}) {
    EXPECT_FALSE(GlobMatches(glob, "b")) << glob;
    EXPECT_TRUE(GlobMatches(glob, "d")) << glob;
    EXPECT_TRUE(GlobMatches(glob, "!")) << glob;
    EXPECT_FALSE(GlobMatches(glob, "")) << glob;
  }
}

TEST(GlobMatchesTest, BracketsAndDashesCanBeMembers) {
  EXPECT_TRUE(GlobMatches("[]a]", "]"));
  EXPECT_FALSE(GlobMatches("[!]a]", "]"));
  EXPECT_TRUE(GlobMatches("V[[]1[]]", "V[1]"));
  EXPECT_FALSE(GlobMatches("V[1]", "V[1]"));
  EXPECT_TRUE(GlobMatches("[a-]", "-"));
  EXPECT_TRUE(GlobMatches("[a-c-e]", "-"));
  EXPECT_FALSE(GlobMatches("[c-a]", "b"));
  EXPECT_FALSE(GlobMatches("[ab", "a"));
  EXPECT_FALSE(GlobMatches("[", "["));
}

TEST(GlobMatchesTest, ACharacterOfUtf8IsOne) {
  EXPECT_TRUE(GlobMatches("V?1", "V\u00e41"));
  EXPECT_TRUE(GlobMatches("V[\u00e0-\u00ff]1", "V\u00e41"));
  EXPECT_FALSE(GlobMatches("V[!\u00e4]1", "V\u00e41"));
  EXPECT_TRUE(GlobMatches("*\u00e4*", "V\u00e41"));
}

// Linear in the number of stars, whoever sent the pattern.
TEST(GlobMatchesTest, ManyStarsTakeNoTime) {
  std::string glob;
  for (int i = 0; i < 100; ++i) {
    glob += "a*";
  }
  EXPECT_FALSE(GlobMatches(glob + "b", std::string(255, 'a')));
}

TEST(GlobOfTest, MatchesTheIdAlone) {
  for (const std::string id : {"V[1]", "V*", "V?", "V]", "[!a]", "FV-101"}) {
    EXPECT_TRUE(GlobMatches(GlobOf(id), id)) << id;
    EXPECT_FALSE(GlobMatches(GlobOf(id), "V1")) << id;
  }
}

}  // namespace
}  // namespace fdi
