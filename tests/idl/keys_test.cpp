#include "idl/security/keys.h"

#include <fstream>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/error.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::idl {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::int64_t kDayNs = 86'400'000'000'000;

std::int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

class KeysTest : public testing::Test {
 protected:
  KeysTest() {
    MakeAuthority(folder_, 100);
    MakeKey(folder_, "monitor-1", Role::kMonitor, 10, false);
  }

  // The message of the refusal of `key`; empty if there is none.
  static std::string Refusal(const fs::path& key, std::int64_t now = NowNs()) {
    try {
      CheckKey(key, now);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  }

  storage::TemporaryDirectory directory_;
  const fs::path folder_{directory_.path() / "keys"};
  const fs::path key_{folder_ / "monitor-1"};
};

TEST_F(KeysTest, AKeyHasNameRoleAndTimes) {
  const KeyInfo key = CheckKey(key_, NowNs());
  EXPECT_EQ(key.name, "monitor-1");
  EXPECT_EQ(key.role, Role::kMonitor);
  EXPECT_LT(key.from_ns, NowNs());
  EXPECT_NEAR(static_cast<double>(key.until_ns - NowNs()), 10.0 * kDayNs, 60e9);
}

TEST_F(KeysTest, AKeyEndsWithItsAuthority) {
  const KeyInfo key = MakeKey(folder_, "late", Role::kReader, 1000, false);
  EXPECT_NEAR(static_cast<double>(key.until_ns - NowNs()), 100.0 * kDayNs,
              60e9);
}

TEST_F(KeysTest, KeysAreListedByName) {
  MakeKey(folder_, "gateway-1", Role::kGateway, 10, false);
  const std::vector<KeyInfo> keys = ListKeys(folder_);
  ASSERT_EQ(keys.size(), 2U);
  EXPECT_EQ(keys[0].name, "gateway-1");
  EXPECT_EQ(keys[0].role, Role::kGateway);
  EXPECT_EQ(keys[1].name, "monitor-1");
}

TEST_F(KeysTest, OnlyTheOwnerReadsPrivateKeys) {
  for (const fs::path& file : {folder_ / "ca.key", key_ / "key.pem"}) {
    EXPECT_EQ(fs::status(file).permissions(),
              fs::perms::owner_read | fs::perms::owner_write)
        << file;
  }
}

TEST_F(KeysTest, ARenewedKeyIsAnotherOneAndLeavesNothingBehind) {
  const auto bytes = [this] {
    std::ifstream stream(key_ / "key.pem");
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  const std::string before = bytes();
  MakeKey(folder_, "monitor-1", Role::kMonitor, 20, true);
  EXPECT_NE(bytes(), before);
  EXPECT_EQ(Refusal(key_, NowNs() + 15 * kDayNs), "");
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    EXPECT_NE(entry.path().filename().string().front(), '.');
  }
}

TEST_F(KeysTest, WhatIsThereIsNotReplacedUnasked) {
  EXPECT_THROW(MakeAuthority(folder_, 100), ConfigError);
  EXPECT_THROW(MakeKey(folder_, "monitor-1", Role::kReader, 10, false),
               ConfigError);
  EXPECT_THROW(MakeKey(folder_, "nobody", Role::kReader, 10, true),
               ConfigError);
  EXPECT_THROW(MakeKey(directory_.path(), "a", Role::kReader, 10, false),
               ConfigError);
  EXPECT_EQ(Refusal(key_), "");
}

TEST_F(KeysTest, NamesAndDaysAreWithinTheirRange) {
  for (const char* name : {"", ".hidden", "a/b", "a b", "a\n", "ä"}) {
    EXPECT_THROW(MakeKey(folder_, name, Role::kReader, 10, false), ConfigError)
        << name;
  }
  EXPECT_THROW(MakeKey(folder_, std::string(65, 'a'), Role::kReader, 10, false),
               ConfigError);
  for (const int days : {0, -1, 36501}) {
    EXPECT_THROW(MakeKey(folder_, "a", Role::kReader, days, false),
                 ConfigError);
    EXPECT_THROW(MakeAuthority(directory_.path() / "other", days), ConfigError);
  }
}

TEST_F(KeysTest, AnExpiredKeyIsNamedWithItsEnd) {
  EXPECT_EQ(Refusal(key_, NowNs() + 9 * kDayNs), "");
  EXPECT_THAT(Refusal(key_, NowNs() + 11 * kDayNs),
              AllOf(HasSubstr("cert.pem: expired at 20"),
                    HasSubstr("fdi-store keys renew")));
  EXPECT_THAT(Refusal(key_, NowNs() - 3 * kDayNs),
              HasSubstr("cert.pem: is valid from 20"));
}

TEST_F(KeysTest, AKeyThatOthersCanReadIsRefused) {
  fs::permissions(key_ / "key.pem", fs::perms::others_read,
                  fs::perm_options::add);
  EXPECT_THAT(Refusal(key_), HasSubstr("key.pem: others can read"));
}

TEST_F(KeysTest, EachFileThatIsMissingIsNamed) {
  for (const char* file :
       {"ca.pem", "cert.pem", "key.pem", "governance.p7s", "permissions.p7s"}) {
    fs::rename(key_ / file, key_ / "away");
    EXPECT_THAT(Refusal(key_),
                HasSubstr(std::string(file) + ": cannot be read"));
    fs::rename(key_ / "away", key_ / file);
  }
}

// Each file cut short, empty, or with another byte somewhere, is refused with
// its name. A byte of a certificate or key may be one that PEM ignores.
TEST_F(KeysTest, EachFileThatIsDamagedIsNamed) {
  for (const char* file :
       {"ca.pem", "cert.pem", "key.pem", "governance.p7s", "permissions.p7s"}) {
    const fs::path original = directory_.path() / "original";
    fs::copy_file(key_ / file, original, fs::copy_options::overwrite_existing);
    for (const auto size : {fs::file_size(original) / 2, std::uintmax_t{0}}) {
      fs::resize_file(key_ / file, size);
      EXPECT_THAT(Refusal(key_), HasSubstr(file)) << size;
    }
    fs::copy_file(original, key_ / file, fs::copy_options::overwrite_existing);
    EXPECT_EQ(Refusal(key_), "");
  }
}

// The text in clear of a signed document with `from` replaced by `to`.
void Forge(const fs::path& file, const std::string& from,
           const std::string& to) {
  std::ifstream stream(file, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(stream), {});
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, from.size(), to);
  std::ofstream(file, std::ios::binary) << text;
}

TEST_F(KeysTest, RightsThatWereChangedByHandAreRefused) {
  Forge(key_ / "permissions.p7s", "fdi/v1/ValveSample", "fdi/v1/ValveSampl*");
  EXPECT_THAT(Refusal(key_),
              HasSubstr("permissions.p7s: its signature does not hold"));
}

TEST_F(KeysTest, RulesThatWereChangedByHandAreRefused) {
  Forge(key_ / "governance.p7s", "<allow_unauthenticated_participants>false",
        "<allow_unauthenticated_participants>true");
  EXPECT_THAT(Refusal(key_),
              HasSubstr("governance.p7s: its signature does not hold"));
}

TEST_F(KeysTest, FilesOfAnotherKeyOrAuthorityAreRefused) {
  MakeKey(folder_, "gateway-1", Role::kGateway, 10, false);
  const fs::path others = directory_.path() / "others";
  MakeAuthority(others, 100);
  MakeKey(others, "monitor-1", Role::kMonitor, 10, false);
  struct Case {
    fs::path from;
    const char* file;
    const char* told;
  };
  for (const Case& each : {
           Case{
               folder_ / "gateway-1", "permissions.p7s",
               "permissions.p7s: is for 'gateway-1', cert.pem for 'monitor-1'"},
           Case{folder_ / "gateway-1", "key.pem",
                "key.pem: is not the key of cert.pem"},
           Case{others / "monitor-1", "cert.pem",
                "cert.pem: is not of the authority in ca.pem"},
           Case{others / "monitor-1", "permissions.p7s",
                "permissions.p7s: its signature does not hold"},
           Case{others / "monitor-1", "governance.p7s",
                "governance.p7s: its signature does not hold"},
       }) {
    const fs::path mixed = directory_.path() / "mixed";
    fs::remove_all(mixed);
    fs::copy(key_, mixed);
    fs::copy_file(each.from / each.file, mixed / each.file,
                  fs::copy_options::overwrite_existing);
    fs::permissions(mixed / "key.pem",
                    fs::perms::owner_read | fs::perms::owner_write);
    EXPECT_THAT(Refusal(mixed), HasSubstr(each.told));
  }
}

}  // namespace
}  // namespace fdi::idl
