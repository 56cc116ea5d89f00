#include "base/text_lines.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/csv_cells.h"
#include "base/error.h"
#include "tests/storage/message_of.h"

namespace fdi {
namespace {

using testing::HasSubstr;

class TextLinesTest : public testing::Test {
 protected:
  ~TextLinesTest() override { std::filesystem::remove(path_); }

  TextLines Written(const std::string& bytes) const {
    std::ofstream(path_, std::ios::binary) << bytes;
    return TextLines::OfFile(path_);
  }

  // Tests of one program may run side by side.
  const std::string path_ =
      testing::TempDir() +
      testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv";
};

// Lines of many lengths, more than are kept in memory.
std::string LongText() {
  std::string text;
  for (std::size_t i = 0; text.size() < 17U << 20U; ++i) {
    text += std::to_string(i) + std::string(i * 7919 % 1000, 'x') + '\n';
  }
  return text + "the last, without a break";
}

std::string Forwards(const TextLines& lines, std::size_t first = 1) {
  std::string text;
  lines.ForEach(
      [&](std::string_view line, std::size_t) {
        text += line;
        text += '\n';
        return true;
      },
      first);
  return text;
}

TEST_F(TextLinesTest, ALongFileIsReadLikeAShortOneInBothDirections) {
  const std::string text = LongText();
  const TextLines lines = Written("\xEF\xBB\xBF" + text);
  std::vector<std::pair<std::size_t, std::string>> all;
  lines.ForEach([&](std::string_view line, std::size_t number) {
    all.emplace_back(number, line);
    return true;
  });

  EXPECT_TRUE(Forwards(lines) == text + '\n');
  EXPECT_EQ(all.front().second, "0");
  EXPECT_EQ(all.back().second, "the last, without a break");
  std::size_t left = all.size();
  std::size_t wrong = 0;
  lines.ForEachBackwards(
      [&](std::string_view line, std::size_t number) {
        --left;
        wrong += all[left] != std::pair(number, std::string(line)) ? 1U : 0U;
        return true;
      },
      10);
  EXPECT_EQ(left, 9U);  // Lines 1 to 9.
  EXPECT_EQ(wrong, 0U);
  EXPECT_TRUE(Forwards(lines, 3) == Forwards(TextLines(text), 3));
}

TEST_F(TextLinesTest, LongFilesInOtherEncodingsAreConvertedInPieces) {
  // A pair of units at every place of a block, because lines differ in length.
  std::u16string wide = u"\uFEFF";
  std::string plain;
  for (std::size_t i = 0; wide.size() < 9U << 20U; ++i) {
    wide += std::u16string(i % 501, u'x') + u"\U0001F600\n";
    plain += std::string(i % 501, 'x') + "\xF0\x9F\x98\x80\n";
  }
  std::string bytes;
  for (const char16_t unit : wide) {
    bytes += static_cast<char>(unit & 0xFFU);
    bytes += static_cast<char>(unit >> 8U);
  }
  EXPECT_TRUE(Forwards(Written(bytes)) == plain);

  std::string latin = LongText();
  latin += "\nm\xB3/h";
  EXPECT_TRUE(Forwards(Written(latin)) == ToUtf8(latin, "input") + '\n');
}

class FolderTest : public testing::Test {
 protected:
  FolderTest() { std::filesystem::create_directory(path_); }
  ~FolderTest() override { std::filesystem::remove_all(path_); }

  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ + "/" + name, std::ios::binary) << text;
  }
  std::string Text() const { return Forwards(TextLines::OfFile(path_)); }

  const std::string path_ =
      testing::TempDir() +
      testing::UnitTest::GetInstance()->current_test_info()->name();
};

TEST_F(FolderTest, AFileForEachTagMakesOneTable) {
  Write("FIC1.OP.csv",
        "\xEF\xBB\xBF\nTime,Status,Value\r\n1,ok,5\r\n2,ok,6\r\n");
  Write("FIC1.PV.csv", "Time,Status,Value\n1,\"not\nok\",7\n\n2,ok,8");
  Write("map.toml", "[time]\n");
  EXPECT_EQ(Text(),
            "tag,\"Time\",\"Status\",\"Value\"\n"
            "\"FIC1.OP\",1,ok,5\r\n\"FIC1.OP\",2,ok,6\r\n"
            "\"FIC1.PV\",1,\"not\nok\",7\n\n\"FIC1.PV\",2,ok,8\n");
}

TEST_F(FolderTest, ColumnsNameTheTagsWhereTheyDiffer) {
  Write("a.txt", "t;FIC1.OP\n1;5\n");
  Write("b.txt", "t;FIC1.PV\n1;7\n");
  EXPECT_EQ(Text(), "tag;\"t\";\"value\"\n\"FIC1.OP\";1;5\n\"FIC1.PV\";1;7\n");
}

TEST_F(FolderTest, CommentsAndQuotesOfTheHeaderAreNoPartOfIt) {
  Write("a.CSV", "sep=;\n# PI\n\"Time, UTC\";\"FIC1.OP\"\n1;5\n");
  Write("b.csv", "\"Time, UTC\";FIC1.PV\n1;7\n");
  EXPECT_EQ(Text(),
            "tag;\"Time, UTC\";\"value\"\n\"FIC1.OP\";1;5\n"
            "\"FIC1.PV\";1;7\n");
}

TEST_F(FolderTest, TwoFilesOfOneTagAreRefused) {
  Write("a.csv", "Time,Value\n1,5\n");
  Write("a.txt", "Time,Value\n1,5\n");
  EXPECT_THAT(storage::MessageOf<DataError>([&] { Text(); }),
              HasSubstr("a.txt: is a second file for the tag \"a\""));
  Write("a.txt", "Time,Wert\n1,5\n");
  Write("b.csv", "Time,Value\n1,5\n");
  EXPECT_THAT(storage::MessageOf<DataError>([&] { Text(); }),
              HasSubstr("b.csv: is a second file for the tag \"Value\""));
  Write("b.csv", "");
  EXPECT_THAT(storage::MessageOf<DataError>([&] { Text(); }),
              HasSubstr("b.csv: has no names of columns"));
}

TEST_F(FolderTest, AnErrorNamesTheFileAndItsLine) {
  Write("a.csv", "t,Value\n1,5\n2,6\n");
  Write("b.csv", "\nt,Value\n1,5\n2,six\n");
  Write("c.csv", "t,Value\n");
  Write("d.csv", "t,Value\n1,5\n");
  const LinePlaces places = TextLines::OfFile(path_).places();
  EXPECT_EQ(places.At(3), path_ + "/a.csv:3");
  EXPECT_EQ(places.At(5), path_ + "/b.csv:4");
  EXPECT_EQ(places.At(6), path_ + "/d.csv:2");
  EXPECT_EQ(places.At(1), path_ + ":1");
}

TEST_F(FolderTest, WhatIsNoTableOfTagsIsRefused) {
  EXPECT_THAT(storage::MessageOf<DataError>([&] { Text(); }),
              HasSubstr("a folder without a table"));
  Write("a.csv", "Time,Value\n1,5\n");
  Write("b.csv", "Zeit,Wert\n1,5\n");
  EXPECT_THAT(
      storage::MessageOf<DataError>([&] { Text(); }),
      HasSubstr("b.csv:1: its header is \"Zeit,Wert\", that of a.csv is "
                "\"Time,Value\": expected one header"));
}

TEST_F(TextLinesTest, WhatIsNoTextIsRefusedHoweverLong) {
  const auto refusal = [&](const std::string& bytes) {
    return storage::MessageOf<DataError>([&] { Forwards(Written(bytes)); });
  };
  EXPECT_THAT(refusal(LongText() + std::string(3, '\0') + '\n'),
              HasSubstr("is binary"));
  EXPECT_THAT(refusal("a\n" + std::string(3U << 20U, 'x')),
              HasSubstr(":2: the line is longer than 2 MiB"));
  EXPECT_THAT(refusal("a\n" + std::string(18U << 20U, 'x')),
              HasSubstr(":2: the line is longer than 2 MiB"));
}

}  // namespace
}  // namespace fdi
