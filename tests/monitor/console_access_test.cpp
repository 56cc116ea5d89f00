#include <fstream>

#include <gmock/gmock.h>

#include "diagnosis/error.h"
#include "monitor/console/access.h"
#include "tests/storage/message_of.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::console {
namespace {

using testing::HasSubstr;

class ConsoleTokenTest : public testing::Test {
 protected:
  void Write(const std::string& text) const { std::ofstream(file_) << text; }

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

TEST_F(ConsoleTokenTest, AFolderThatIsNotThereIsNamed) {
  EXPECT_THAT(storage::MessageOf<DataError>(
                  [this] { LoadToken(directory_.path() / "no" / "token"); }),
              HasSubstr("no/token: cannot be made: No such file"));
}

TEST(ConsoleAccessTest, OnlyTheWholeTokenGrants) {
  const std::string token = "0123456789abcdef";

  EXPECT_EQ(MayWrite("Bearer " + token, token), Permission::kGranted);
  for (const char* wrong :
       {"", "Bearer", "Bearer ", "0123456789abcdef", "Bearer 0123456789abcde",
        "Bearer 0123456789abcdef0", "Bearer 1123456789abcdef",
        "Bearer 0123456789abcdeg", "Basic 0123456789abcdef"}) {
    EXPECT_EQ(MayWrite(wrong, token), Permission::kWrongToken) << wrong;
  }
  EXPECT_EQ(MayWrite("Bearer ", ""), Permission::kReadOnly);
}

TEST(ConsoleAccessTest, ANameThatIsNotOursMayNotAskALoopbackAddress) {
  for (const char* own : {"localhost", "localhost:8080", "LOCALHOST:9000",
                          "127.0.0.1:8080", "[::1]:8080", "[::1]"}) {
    EXPECT_TRUE(HostAllowed(own, "127.0.0.1")) << own;
  }
  EXPECT_TRUE(HostAllowed("127.0.0.7:80", "127.0.0.7"));
  for (const char* other :
       {"", "evil.example", "evil.example:8080", "127.0.0.1.evil.example",
        "localhost.evil.example:8080", "[fe80::1]:8080", "127.0.0.7"}) {
    EXPECT_FALSE(HostAllowed(other, "127.0.0.1")) << other;
  }
  EXPECT_TRUE(HostAllowed("monitor.plant:8080", "0.0.0.0"));
  EXPECT_TRUE(HostAllowed("monitor.plant:8080", "192.168.1.5"));
}

}  // namespace
}  // namespace fdi::console
