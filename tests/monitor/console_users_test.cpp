// The file of users, their passwords, and who is logged in.
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "base/error.h"
#include "monitor/console/failure_limit.h"
#include "monitor/console/logins.h"
#include "monitor/console/users.h"
#include "tests/storage/message_of.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::console {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr const char* kFirstPassword = "correct horse";

class UsersFileTest : public testing::Test {
 protected:
  void Write(const std::string& text, unsigned mode = 0600) const {
    std::ofstream(file_) << text;
    std::filesystem::permissions(file_, std::filesystem::perms(mode));
  }
  std::string Text() const {
    std::ifstream file(file_);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::string Complaint() const {
    return storage::MessageOf<ConfigError>([this] { LoadUsers(file_); });
  }
  unsigned mode() const {
    return static_cast<unsigned>(std::filesystem::status(file_).permissions());
  }

  storage::TemporaryDirectory directory_;
  std::filesystem::path file_{directory_.path() / "users"};
};

TEST_F(UsersFileTest, AUserIsAddedChangedAndRemoved) {
  StoreUser(file_, "anna", User{Role::kEngineer, HashPassword(kFirstPassword)});
  EXPECT_EQ(mode(), 0600U);
  Write("# the night shift\n" + Text() + "bo:view:*");
  StoreUser(file_, "bo", User{Role::kAcknowledge, "*"});
  StoreUser(file_, "c.d@plant", User{});

  const Users users = LoadUsers(file_);
  ASSERT_EQ(users.size(), 3U);
  EXPECT_EQ(users.at("anna").role, Role::kEngineer);
  EXPECT_EQ(users.at("bo").role, Role::kAcknowledge);
  EXPECT_EQ(users.at("c.d@plant").role, Role::kView);
  EXPECT_THAT(users.at("anna").hash, StartsWith("$y$"));
  EXPECT_TRUE(PasswordFits(kFirstPassword, users.at("anna").hash));
  EXPECT_FALSE(PasswordFits("correct horsf", users.at("anna").hash));

  StoreUser(file_, "anna", std::nullopt);
  EXPECT_EQ(Text(), "# the night shift\nbo:acknowledge:*\nc.d@plant:view:*\n");
  EXPECT_THROW(StoreUser(file_, "anna", std::nullopt), NotFoundError);
  EXPECT_THROW(StoreUser(file_, "a:engineer", User{}), ConfigError);
  EXPECT_THROW(StoreUser(file_, "a\nb", User{}), ConfigError);
}

TEST_F(UsersFileTest, ChangesAtOnceAllStay) {
  std::vector<std::jthread> commands;
  for (int i = 0; i < 20; ++i) {
    commands.emplace_back(
        [this, i] { StoreUser(file_, "u" + std::to_string(i), User{}); });
  }
  commands.clear();

  EXPECT_EQ(LoadUsers(file_).size(), 20U);
}

TEST_F(UsersFileTest, LinkToItStaysOne) {
  const auto link = directory_.path() / "link";
  std::filesystem::create_symlink(file_, link);
  Write("bo:view:*\n");

  StoreUser(link, "anna", User{});

  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(LoadUsers(file_).size(), 2U);
}

TEST_F(UsersFileTest, OneThatIsTooLongIsNotReadInPart) {
  Write(std::string(2 << 20, '#'));

  EXPECT_THAT(storage::MessageOf<DataError>([this] { LoadUsers(file_); }),
              HasSubstr("cannot be read: File too large"));
}

TEST_F(UsersFileTest, ItsModeAndItsOtherLinesStay) {
  Write("bo:view:*\n", 0640);
  StoreUser(file_, "anna", User{});
  EXPECT_EQ(mode(), 0640U);
  Write("nonsense\n");
  EXPECT_THROW(StoreUser(file_, "anna", User{}), ConfigError);
  EXPECT_EQ(Text(), "nonsense\n");
}

TEST_F(UsersFileTest, ABadLineIsRefusedWithItsNumberAndWhatIsAccepted) {
  Write("# two\n\nanna:view\n");
  EXPECT_THAT(Complaint(), HasSubstr("users:3: expected NAME:ROLE:HASH"));
  Write("anna:view:*\nbo:admin:*\n");
  EXPECT_THAT(Complaint(),
              HasSubstr("users:2: the role: expected view, acknowledge or"));
  Write("anna:view:secret\n");
  EXPECT_THAT(Complaint(), HasSubstr("users:1: the hash: expected one that"));
  Write("anna:view:\n");
  EXPECT_THAT(Complaint(), HasSubstr("users:1: the hash"));
  Write("an na:view:*\n");
  EXPECT_THAT(Complaint(), HasSubstr("users:1: expected NAME"));
  Write("anna:view:*\nanna:engineer:*\n");
  EXPECT_THAT(Complaint(), HasSubstr("users:2: the name stands in an earlier"));
}

// The login would wait, and so would the end of the monitor.
TEST_F(UsersFileTest, AHashThatTakesMinutesIsRefused) {
  const std::string salt = "$abcdefghijklmnop$";
  for (const std::string& costly :
       {"$2b$31$abcdefghijklmnopqrstuu" + std::string(31, 'a'),
        "$6$rounds=999999999" + salt, "$6$rounds=1000001" + salt,
        "$y$jFT" + salt, "$y$jDT" + salt, "$gy$jFT" + salt}) {
    Write("anna:view:" + costly + "\n");
    EXPECT_THAT(Complaint(), HasSubstr("users:1: the hash: expected one of"))
        << costly;
  }
  for (const std::string& usual :
       {"$y$j9T" + salt, "$y$jCT" + salt, "$y$j75" + salt, "$6" + salt,
        "$6$rounds=656000" + salt, "$gy$j9T" + salt,
        "$2b$12$abcdefghijklmnopqrstuu" + std::string(31, 'a')}) {
    Write("anna:view:" + usual + "\n");
    EXPECT_EQ(LoadUsers(file_).size(), 1U) << usual;
  }
}

TEST_F(UsersFileTest, ThatOthersCanReadOrChangeIsRefused) {
  for (const unsigned mode : {0644U, 0660U, 0604U}) {
    Write("anna:view:*\n", mode);
    EXPECT_THAT(Complaint(), HasSubstr("lets others read or change it"));
  }
  std::filesystem::remove(file_);
  EXPECT_THROW(LoadUsers(file_), DataError);
}

TEST(PasswordTest, TooShortOnesAndControlCharactersAreRefused) {
  EXPECT_THROW(HashPassword("7 bytes"), ConfigError);
  EXPECT_THROW(HashPassword(std::string(257, 'x')), ConfigError);
  EXPECT_THROW(HashPassword("correct\x03horse"), ConfigError);
  const std::string hash = HashPassword(kFirstPassword);
  EXPECT_NE(hash, HashPassword(kFirstPassword));
  EXPECT_FALSE(PasswordFits(kFirstPassword + std::string("\0x", 2), hash));
  EXPECT_FALSE(PasswordFits("*", "*"));
  EXPECT_FALSE(PasswordFits("*0", "*"));
}

class LoginsTest : public testing::Test {
 protected:
  using Outcome = Logins::Outcome;
  Outcome LogIn(const std::string& name, const std::string& password,
                const std::string& origin = "10.0.0.1") {
    return logins_.LogIn(name, password, origin, session_, now_);
  }
  std::optional<Visitor> Visit() { return logins_.OfSession(session_, now_); }

  const User anna_{Role::kEngineer, HashPassword(kFirstPassword)};
  Logins logins_{{{"anna", anna_}, {"bo", anna_}, {"proxied", {}}}};
  std::string session_;
  Logins::Clock::time_point now_{std::chrono::hours(1)};
};

TEST_F(LoginsTest, OnlyTheRightPasswordOpensASession) {
  EXPECT_EQ(LogIn("anna", "correct horsf"), Outcome::kWrong);
  EXPECT_EQ(LogIn("nobody", kFirstPassword), Outcome::kWrong);
  EXPECT_EQ(LogIn("proxied", "*"), Outcome::kWrong);
  EXPECT_EQ(session_, "");
  EXPECT_FALSE(Visit());

  ASSERT_EQ(LogIn("anna", kFirstPassword), Outcome::kAdmitted);
  ASSERT_TRUE(Visit());
  EXPECT_EQ(Visit()->name, "anna");
  EXPECT_EQ(Visit()->role, Role::kEngineer);
  EXPECT_FALSE(logins_.OfSession(session_.substr(1), now_));
  logins_.LogOut(session_);
  EXPECT_FALSE(Visit());
}

TEST_F(LoginsTest, GuessesAreSlowedByNameAndAddress) {
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(LogIn("anna", "no"), Outcome::kWrong);
  }
  EXPECT_EQ(LogIn("bo", kFirstPassword), Outcome::kAdmitted)
      << "behind a proxy, all come from one address";
  EXPECT_EQ(LogIn("anna", kFirstPassword), Outcome::kTooMany);
  EXPECT_EQ(LogIn("anna", kFirstPassword, "10.0.0.2"), Outcome::kAdmitted);
  now_ += std::chrono::seconds(1);
  EXPECT_EQ(LogIn("anna", kFirstPassword), Outcome::kAdmitted);
}

// Each name costs its inventor the time of a hash. No number of them locks out
// who has a name, or frees the guesses at one.
TEST_F(LoginsTest, ManyNamesLockNobodyOut) {
  FailureLimit limit;
  for (int i = 0; i < 1000; ++i) {
    const std::string name = "n" + std::to_string(i);
    EXPECT_TRUE(limit.Allows(name, now_));
    limit.Add(name, now_);
    now_ += std::chrono::milliseconds(1);
  }
  EXPECT_TRUE(limit.Allows("anna", now_));
  for (int i = 0; i < 5; ++i) {
    limit.Add("n999", now_);
  }
  EXPECT_FALSE(limit.Allows("n999", now_));
}

TEST_F(LoginsTest, ASessionEndsHalfAnHourAfterItsLastUse) {
  LogIn("anna", kFirstPassword);
  now_ += std::chrono::minutes(29);
  EXPECT_TRUE(Visit());
  now_ += std::chrono::minutes(29);
  EXPECT_TRUE(Visit());
  now_ += std::chrono::minutes(30);
  EXPECT_FALSE(Visit());
  EXPECT_EQ(logins_.sessions(), 0U);
}

TEST_F(LoginsTest, ASessionEndsWithThePasswordOrTheUser) {
  LogIn("anna", kFirstPassword);
  logins_.Take({{"anna", {Role::kView, anna_.hash}}});
  ASSERT_TRUE(Visit());
  EXPECT_EQ(Visit()->role, Role::kView);
  logins_.Take({{"anna", {Role::kView, HashPassword("another one")}}});
  EXPECT_FALSE(Visit());
  logins_.Take({{"anna", anna_}});
  LogIn("anna", kFirstPassword);
  logins_.Take({});
  EXPECT_FALSE(Visit());
}

TEST_F(LoginsTest, TheSessionBeyondSixtyFourTakesThePlaceOfTheIdlest) {
  LogIn("anna", kFirstPassword);
  const std::string first = session_;
  now_ += std::chrono::seconds(1);
  LogIn("anna", kFirstPassword);
  const std::string second = session_;
  now_ += std::chrono::seconds(1);
  logins_.OfSession(first, now_);
  for (int i = 0; i < 63; ++i) {
    now_ += std::chrono::seconds(1);
    LogIn("anna", kFirstPassword);
  }
  EXPECT_EQ(logins_.sessions(), 64U);
  EXPECT_TRUE(logins_.OfSession(first, now_));
  EXPECT_FALSE(logins_.OfSession(second, now_));
}

}  // namespace
}  // namespace fdi::console
