#include "base/toml_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/toml_text.h"
#include "tests/storage/message_of.h"

namespace fdi {
namespace {

using testing::HasSubstr;

std::string Repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) {
    all += text;
  }
  return all;
}

std::string Refusal(const std::string& text) {
  return storage::MessageOf<ConfigError>(
      [&] { const TomlReader reader(text, "f.toml"); });
}

// The parser recurses: without a bound such files end the process.
TEST(TomlReaderTest, KeysAndValuesThatAreTooDeepAreRefused) {
  EXPECT_THAT(Refusal("# a\na" + Repeated(".a", 50000) + " = 1\n"),
              HasSubstr("f.toml:2: a key has more than 16 parts"));
  EXPECT_THAT(Refusal("x = 1\n[a" + Repeated(".'a'", 50000) + "]\n"),
              HasSubstr("f.toml:2: a key has more than 16 parts"));
  EXPECT_THAT(Refusal("a = " + Repeated("[", 50000)),
              HasSubstr("nested more than 32 deep"));
  EXPECT_THAT(Refusal("a = " + Repeated("{a = ", 50000)),
              HasSubstr("nested more than 32 deep"));
  EXPECT_THAT(Refusal(Repeated("# a line of a comment\n", 1 << 20)),
              HasSubstr("more than 16 MiB"));
}

TEST(TomlReaderTest, DotsInTextsCommentsAndNumbersAreNoKeys) {
  const std::string dots = Repeated("a.", 100);
  const TomlReader reader("a = \"\\\"" + dots + "\" # " + dots + "\nb = '" +
                              dots + "'\nc = \"\"\"\n[[" + dots +
                              "\n\"\"\"\nd = [" + Repeated("1.5, ", 100) +
                              "]\n",
                          "f.toml");
  EXPECT_EQ(reader.Keys().size(), 4U);
}

TEST(TomlTextTest, AnyTextIsReadBackAsItWas) {
  for (const std::string text :
       {"", "f6", "a \"b\" \\ 'c'", "two\nlines\tand\r\x01\x7f", "°C ü"}) {
    TomlReader reader("a = " + TomlText(text), "f.toml");
    EXPECT_EQ(reader.Text("a"), text);
    EXPECT_EQ(TomlText(text).find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace fdi
