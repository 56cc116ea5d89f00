// Tables, suggestions, event lines and strict TOML.
#include <algorithm>
#include <array>
#include <fstream>
#include <limits>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include "base/error.h"
#include "base/printable.h"
#include "base/suggestion.h"
#include "base/toml_reader.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/json_output.h"
#include "report/logging.h"
#include "report/text_table.h"

namespace fdi::report {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

template <typename Function>
std::string MessageOf(const Function& function) {
  try {
    function();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(TextTableTest, ColumnsAlignAlsoBehindMultiByteLetters) {
  TextTable table({{"valve", Align::kLeft}, {"MSE [%²]", Align::kRight}});
  table.AddRow({"zażółć", "1.25"});
  table.AddRow({"a", "100.00"});
  std::ostringstream out;

  table.Print(out);

  EXPECT_EQ(out.str(),
            "valve   MSE [%²]\n"
            "zażółć      1.25\n"
            "a         100.00\n");
}

// For people in front of it; the first to go is the one most spare.
TEST(TextTableTest, SpareColumnsGoUntilTheTableFits) {
  TextTable table({{"valve"}, {"note", Align::kLeft, 1}, {"set", {}, 2}});
  table.AddRow({"LV-1", "long note", "demo@1"});
  const auto printed = [&table](std::size_t width) {
    std::ostringstream out;
    table.Print(out, {false, width});
    return out.str();
  };

  EXPECT_EQ(printed(24), "valve  note       set\nLV-1   long note  demo@1\n");
  EXPECT_EQ(printed(23),
            "valve  note\nLV-1   long note\n(too narrow for: set)\n");
  EXPECT_EQ(printed(3), "valve\nLV-1\n(too narrow for: note, set)\n");
}

// Before any column is left out, and no more than has to be.
TEST(TextTableTest, CellsThatMayBeCutGiveWay) {
  TextTable table({{"id"}, {"name", Align::kLeft, 0, 5}, {"set", {}, 1}});
  table.AddRow({"7", "Ventil größer", "set"});
  const auto printed = [&table](std::size_t width) {
    std::ostringstream out;
    table.Print(out, {.colour = false, .width = width});
    return out.str();
  };
  EXPECT_EQ(printed(0), printed(22));
  EXPECT_EQ(printed(20), "id  name         set\n7   Ventil grö…  set\n");
  EXPECT_EQ(printed(14), "id  name   set\n7   Vent…  set\n");
  EXPECT_EQ(printed(13), "id  name\n7   Ventil g…\n(too narrow for: set)\n");
}

TEST(TextTableTest, ColourIsAskedForAndMovesNoColumn) {
  TextTable table({{"a"}, {"b"}});
  table.AddRow({"x", "y"});
  table.SetTone(0, Tone::kAlarm);
  std::ostringstream plain;
  std::ostringstream coloured;

  table.Print(plain);
  table.Print(coloured, {true, 0});

  EXPECT_EQ(plain.str(), "a  b\nx  y\n");
  EXPECT_THAT(coloured.str(), HasSubstr("\x1b[1;31mx\x1b[0m  y\n"));
}

TEST(TextTableTest, RowOfAnotherLengthIsRefused) {
  TextTable table({{"a", Align::kLeft}});

  EXPECT_THROW(table.AddRow({"1", "2"}), std::invalid_argument);
}

TEST(FormatNumberTest, NotFiniteIsADash) {
  EXPECT_EQ(FormatNumber(1.0 / 3.0, 3), "0.333");
  EXPECT_EQ(FormatNumber(std::numeric_limits<double>::quiet_NaN(), 3), "-");
}

TEST(SuggestTest, AFaultIsSuggestedUnlessItsNumberIsWrong) {
  EXPECT_EQ(DidYouMeanFault("ff7"), " (did you mean 'f7'?)");
  EXPECT_EQ(DidYouMeanFault("F_19"), " (did you mean 'f19'?)");
  EXPECT_EQ(DidYouMeanFault("ture", {"true"}), " (did you mean 'true'?)");
  EXPECT_EQ(DidYouMeanFault("f99"), "");
  EXPECT_EQ(DidYouMeanFault("seat"), "");
  EXPECT_EQ(DidYouMeanFault("x_stuck"),
            " (a finding: it says what is seen, not what is wrong)");
}

TEST(SuggestTest, NearWordsAreMeantAndFarOnesAreNot) {
  const std::vector<std::string> verbs = {"list", "show", "import", "export"};

  EXPECT_EQ(Suggest("lsit", verbs), "list");
  EXPECT_EQ(Suggest("improt", verbs), "import");
  EXPECT_EQ(Suggest("shw", verbs), "show");
  EXPECT_EQ(Suggest("delete", verbs), std::nullopt);
}

TEST(EventLineTest, ValuesWithBlanksOrQuotesAreQuoted) {
  EXPECT_EQ(EventLine("import", {{"file", "a b"}, {"rows", "3"}, {"x", ""}}),
            "import file=\"a b\" rows=3 x=\"\"");
  EXPECT_EQ(EventLine("e", {{"m", "say \"no\"\nnow"}}),
            "e m=\"say \\\"no\\\"\\x0anow\"");
  EXPECT_EQ(EventLine("e", {{"id", "V\x1b[2J"}}), "e id=V\\x1b[2J");
}

// ESC, BEL, OSC 52, DEL, C1 (CSI in UTF-8), half a letter, a line of its own.
constexpr const char* kHostile =
    "\x1b]52;c;aGk=\x07|\x7f|\xc2\x9b"
    "2J|\xe2\x82|V\r\n2026 error";

TEST(PrintableTest, OnlyLettersReachATerminal) {
  EXPECT_EQ(
      Printable(kHostile),
      "\\x1b]52;c;aGk=\\x07|\\x7f|\\xc2\\x9b2J|\\xe2\\x82|V\\x0d\\x0a2026 "
      "error");
  EXPECT_EQ(Printable(std::string("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(Printable("FV-101 \u00b5\u20ac\U0001f600"),
            "FV-101 \u00b5\u20ac\U0001f600");
  EXPECT_EQ(Printable("a\nb\x1b", "\n"), "a\nb\\x1b");
  EXPECT_FALSE(IsPrintable(kHostile));
  EXPECT_TRUE(IsPrintable("\u00b5"));
  // ESC in a longer form, a surrogate, a longer form, beyond U+10FFFF.
  for (const char* text : {"\xe0\x80\x9b", "\xed\xa0\x80", "\xf0\x82\x82\xac",
                           "\xf4\x90\x80\x80"}) {
    EXPECT_FALSE(IsPrintable(text)) << Printable(text);
  }
}

// Redirects stderr to a pipe that nobody reads until Read() is called.
class StalledStderr {
 public:
  StalledStderr() : saved_(dup(STDERR_FILENO)) {
    std::array<int, 2> ends{};
    EXPECT_EQ(pipe(ends.data()), 0);
    read_end_ = ends[0];
    dup2(ends[1], STDERR_FILENO);
    close(ends[1]);
  }
  ~StalledStderr() { Restore(); }
  StalledStderr(const StalledStderr&) = delete;
  StalledStderr& operator=(const StalledStderr&) = delete;

  // Reads what is in the pipe by now.
  std::string Read() const {
    std::string text;
    std::array<char, 4096> part{};
    pollfd entry{read_end_, POLLIN, 0};
    while (poll(&entry, 1, 0) == 1 && (entry.revents & POLLIN) != 0) {
      const ssize_t got = read(read_end_, part.data(), part.size());
      text.append(part.data(), static_cast<std::size_t>(got));
    }
    return text;
  }

 private:
  void Restore() const {
    dup2(saved_, STDERR_FILENO);
    close(saved_);
    close(read_end_);
  }

  int saved_;
  int read_end_ = -1;
};

TEST(LogSinkTest, StalledReaderCostsLinesAndNoTime) {
  const StalledStderr stalled;
  const LogSink sink = MakeStderrSink(LogLevel::kInfo);
  const std::string line(1000, 'x');

  for (int i = 0; i < 200; ++i) {  // Three times what a pipe holds.
    sink(LogLevel::kInfo, line);   // Would wait for ever.
  }
  const std::string first = stalled.Read();
  sink(LogLevel::kInfo, "again");
  const std::string then = stalled.Read();

  const auto kept = std::count(first.begin(), first.end(), '\n');
  EXPECT_GT(kept, 30);
  EXPECT_THAT(then, HasSubstr("warning log_lines_dropped lines=" +
                              std::to_string(200 - kept) + "\n"));
  EXPECT_THAT(then, HasSubstr(" again\n"));
}

TEST(LogSinkTest, AnErrorGivesUpOnAReaderThatDoesNotRead) {
  const StalledStderr stalled;
  constexpr auto kPatience = std::chrono::milliseconds(20);
  while (WriteToStderr(std::string(1000, 'x'), kPatience)) {
  }
  EXPECT_FALSE(WriteToStderr("error: lost\n", kPatience));
  stalled.Read();
  EXPECT_TRUE(WriteToStderr("error: read\n", kPatience));
  EXPECT_EQ(stalled.Read(), "error: read\n");
}

TEST(LogSinkTest, NoTextMakesALineOrCommandsTheTerminal) {
  testing::internal::CaptureStderr();
  MakeStderrSink(LogLevel::kInfo)(LogLevel::kWarning,
                                  std::string("valve_stale valve=") + kHostile);
  const std::string log = testing::internal::GetCapturedStderr();

  EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 1);
  EXPECT_TRUE(IsPrintable(log.substr(0, log.size() - 1))) << log;
}

TEST(LogValueTest, AValueCannotLookLikeAnotherField) {
  EXPECT_EQ(LogValue("FV-101"), "FV-101");
  EXPECT_EQ(LogValue("V1 level=error"), "\"V1 level=error\"");
  EXPECT_EQ(LogValue("V\" x=\"1"), "\"V\\\" x=\\\"1\"");
}

TEST(JsonTextTest, ControlsThatJsonAllowsAreEscapedToo) {
  EXPECT_EQ(JsonText(Json("\x1b|\x7f|\xc2\x9b|\u00b5")),
            "\"\\u001b|\\u007f|\\u009b|\u00b5\"");
}

constexpr const char* kToml =
    "seed = 7\n"
    "name = \"x\"\n"
    "[loop]\n"
    "gain = 2\n"
    "[[fault]]\n"
    "id = \"f1\"\n"
    "[[fault]]\n"
    "id = \"f7\"\n"
    "strength = 0.5\n";

TEST(TomlReaderTest, TypedKeysAreReadAndAbsentOnesAreNothing) {
  TomlReader file(kToml, "c.toml");
  std::vector<std::string> ids;

  EXPECT_EQ(file.Integer("seed"), 7);
  EXPECT_EQ(file.Text("name"), "x");
  EXPECT_EQ(file.Number("absent"), std::nullopt);
  auto loop = file.Table("loop");
  ASSERT_TRUE(loop.has_value());
  EXPECT_EQ(loop->Number("gain", 0.0, 10.0), 2.0);
  for (TomlReader& fault : file.Tables("fault")) {
    ids.push_back(fault.Text("id").value_or(""));
    fault.Number("strength");
  }
  EXPECT_THAT(ids, ElementsAre("f1", "f7"));
  EXPECT_NO_THROW(file.Finish());
}

TEST(TomlReaderTest, KeyThatNobodyAskedForIsRefusedWithItsLine) {
  TomlReader file(kToml, "c.toml");
  file.Integer("sede");
  file.Text("name");
  file.Table("loop")->Number("gain");
  for (TomlReader& fault : file.Tables("fault")) {
    fault.Text("id");
    fault.Number("strength");
  }

  EXPECT_EQ(MessageOf([&] { file.Finish(); }),
            "c.toml:1: unknown key 'seed': did you mean 'sede'?");
}

TEST(TomlReaderTest, KeyInsideATableThatNobodyAskedForIsRefusedToo) {
  TomlReader file(kToml, "c.toml");
  file.Integer("seed");
  file.Text("name");
  file.Table("loop")->Number("gain");
  for (TomlReader& fault : file.Tables("fault")) {
    fault.Text("id");
  }

  EXPECT_THAT(MessageOf([&] { file.Finish(); }),
              AllOf(HasSubstr("c.toml:9"), HasSubstr("'strength'")));
}

TEST(TomlReaderTest, WrongTypeAndRangeNameFileLineAndKey) {
  TomlReader file(kToml, "c.toml");

  EXPECT_EQ(MessageOf([&] { file.Number("name"); }),
            "c.toml:2: name: expected a number");
  EXPECT_EQ(MessageOf([&] { file.Number("seed", 0.0, 1.0); }),
            "c.toml:1: seed: 7 is not in 0..1");
  EXPECT_EQ(MessageOf([&] { file.Table("loop")->Number("gain", 5.0, 6.0); }),
            "c.toml:4: loop.gain: 2 is not in 5..6");
  EXPECT_THAT(MessageOf([] { TomlReader("a = = 1", "d.toml"); }),
              HasSubstr("d.toml:1:"));
}

TEST(TomlReaderTest, MissingFileIsNotFound) {
  EXPECT_THROW(TomlReader(std::filesystem::path("/nowhere/x.toml")),
               NotFoundError);
}

}  // namespace
}  // namespace fdi::report
