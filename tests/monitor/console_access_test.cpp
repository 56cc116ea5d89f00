#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/error.h"
#include "monitor/console/access.h"
#include "tests/storage/message_of.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::console {
namespace {

using testing::HasSubstr;

class ConsoleTokenTest : public testing::Test {
 protected:
  void Write(const std::string& text) const {
    std::ofstream(file_) << text;
    SetMode(0600);
  }
  void SetMode(unsigned mode) const {
    std::filesystem::permissions(file_, std::filesystem::perms(mode));
  }

  storage::TemporaryDirectory directory_;
  std::filesystem::path file_{directory_.path() / "token"};
};

TEST_F(ConsoleTokenTest, IsMadeOnceForTheOwnerAlone) {
  const std::string token = LoadToken(file_);

  EXPECT_EQ(token.size(), 48U);
  EXPECT_EQ(LoadToken(file_), token);
  EXPECT_EQ(
      std::filesystem::status(file_).permissions(),
      std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  EXPECT_NE(LoadToken(directory_.path() / "other"), token);
}

TEST_F(ConsoleTokenTest, OfFewerThanSixteenCharactersIsRefused) {
  Write("0123456789abcde\nand more\n");
  EXPECT_THAT(storage::MessageOf<ConfigError>([this] { LoadToken(file_); }),
              HasSubstr("has 15 characters; expected 16 or more"));
  Write("0123456789 abcdef\n");
  EXPECT_THROW(LoadToken(file_), ConfigError);
  Write("");
  EXPECT_THROW(LoadToken(file_), ConfigError);
  Write("0123456789abcdef\r\n");
  EXPECT_EQ(LoadToken(file_), "0123456789abcdef");
}

TEST_F(ConsoleTokenTest, ThatOthersCanReadOrChangeIsRefused) {
  Write("0123456789abcdef\n");
  for (const unsigned mode : {0666U, 0644U, 0660U, 0604U, 0602U}) {
    SetMode(mode);
    EXPECT_THAT(storage::MessageOf<ConfigError>([this] { LoadToken(file_); }),
                HasSubstr("expected a file of the service's user or root with "
                          "mode 0600 or 0640"))
        << mode;
  }
  SetMode(0640);
  EXPECT_EQ(LoadToken(file_), "0123456789abcdef");
}

TEST_F(ConsoleTokenTest, AFolderThatIsNotThereIsNamed) {
  EXPECT_THAT(storage::MessageOf<DataError>(
                  [this] { LoadToken(directory_.path() / "no" / "token"); }),
              HasSubstr("no/token: cannot be made: No such file"));
}

class TokenGuardTest : public testing::Test {
 protected:
  Permission Check(const std::string& token,
                   const std::string& origin = "10.0.0.1") {
    return guard_.Check(token, origin, now_);
  }

  const std::string right_{"0123456789abcdef"};
  std::vector<std::string> lines_;
  TokenGuard guard_{
      "0123456789abcdef",
      [this](LogLevel, std::string_view line) { lines_.emplace_back(line); }};
  TokenGuard::Clock::time_point now_{std::chrono::hours(1)};
};

TEST_F(TokenGuardTest, OnlyTheWholeTokenGrants) {
  EXPECT_EQ(Check(right_), Permission::kGranted);
  for (const char* wrong :
       {"", " 0123456789abcdef", "0123456789abcde", "0123456789abcdef0",
        "1123456789abcdef", "0123456789abcdeg"}) {
    EXPECT_EQ(Check(wrong), Permission::kWrongToken) << wrong;
    now_ += std::chrono::seconds(1);
  }
  EXPECT_TRUE(lines_.front().starts_with(
      "console_token_refused origin=10.0.0.1 failures=1 "));
  TokenGuard none("", {});
  EXPECT_EQ(none.Check("", ""), Permission::kReadOnly);
}

// Who has the token may share an address with those who guess: behind a proxy.
TEST_F(TokenGuardTest, GuessesAreSlowedToOneASecondAndTheTokenIsNot) {
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(Check("no"), Permission::kWrongToken);
  }
  for (int i = 0; i < 4650; ++i) {
    now_ += std::chrono::microseconds(215);
    EXPECT_EQ(Check("no"), Permission::kTooMany);
    EXPECT_EQ(Check(right_), Permission::kGranted);
  }
  EXPECT_EQ(Check("no", "10.0.0.2"), Permission::kWrongToken);
  EXPECT_EQ(guard_.counts().wrong, 6U);
  EXPECT_EQ(guard_.counts().unread, 4650U);
  EXPECT_EQ(lines_.size(), 6U);
  now_ += std::chrono::seconds(1);
  EXPECT_EQ(Check("no"), Permission::kWrongToken);
}

TEST_F(TokenGuardTest, AnyNumberOfAddressesIsSlowedInBoundedMemory) {
  int looked_at = 0;
  for (int i = 0; i < 10'000; ++i) {
    looked_at +=
        Check("no", "2001:db8::" + std::to_string(i)) == Permission::kWrongToken
            ? 1
            : 0;
  }
  EXPECT_LT(looked_at, 256 + 5 + 1);
}

}  // namespace
}  // namespace fdi::console
