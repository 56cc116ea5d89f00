#include "idl/security/keys.h"

#include <fstream>
#include <functional>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509v3.h>

#include "base/error.h"
#include "base/passing_error.h"
#include "tests/idl/signed_documents.h"
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
  const std::string before = Slurp(key_ / "key.pem");
  MakeKey(folder_, "monitor-1", Role::kMonitor, 20, true);
  EXPECT_NE(Slurp(key_ / "key.pem"), before);
  EXPECT_EQ(Refusal(key_, NowNs() + 15 * kDayNs), "");
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
    EXPECT_NE(entry.path().filename().string().front(), '.');
  }
}

TEST_F(KeysTest, AKeyIsRenewedWhateverIsBesideIt) {
  MakeKey(folder_, "gateway-1", Role::kGateway, 10, false, "hall-1,hall-2");
  fs::remove(key_ / "key.pem");
  fs::create_directory(folder_ / "lost+found");

  const KeyInfo key = RenewKey(folder_, "gateway-1", 20);
  EXPECT_EQ(key.role, Role::kGateway);
  EXPECT_EQ(key.partitions, "hall-1,hall-2");
  EXPECT_THROW(RenewKey(folder_, "gateway-2", 20), NotFoundError);
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

// An interrupted call leaves the files that it has written, and half of the
// next one beside its place.
TEST_F(KeysTest, AnInterruptedAuthorityIsCompleted) {
  const std::vector<std::string> files{"ca.key", "governance.p7s", "ca.pem"};
  for (std::size_t written = 0; written < files.size(); ++written) {
    const fs::path folder = directory_.path() / std::to_string(written);
    fs::create_directory(folder);
    for (std::size_t i = 0; i < written; ++i) {
      fs::copy(folder_ / files[i], folder);
    }
    std::ofstream(folder / (files[written] + ".new")) << "-----BEGIN";

    MakeAuthority(folder, 100);
    MakeKey(folder, "monitor-1", Role::kMonitor, 10, false);
    EXPECT_EQ(Refusal(folder / "monitor-1"), "") << written;
    EXPECT_EQ(Slurp(folder / "ca.key") == Slurp(folder_ / "ca.key"),
              written > 0);
    EXPECT_THROW(MakeAuthority(folder, 100), ConfigError);
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      EXPECT_NE(entry.path().extension(), ".new");
    }
  }
}

// What is put there between the look and the end, here a link to nowhere, which
// exists() does not see.
TEST_F(KeysTest, AKeyReplacesNothingAndLeavesNoPrivateKeyBeside) {
  const fs::path folder = directory_.path() / "other";
  fs::create_directory(folder);
  fs::create_symlink("nowhere", folder / "ca.key");
  EXPECT_THROW(MakeAuthority(folder, 100), DataError);
  EXPECT_TRUE(fs::is_symlink(folder / "ca.key"));
  EXPECT_FALSE(fs::exists(folder / "ca.key.new"));
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
  // The clock of a host that boots may be set a moment later.
  EXPECT_THAT([&] { CheckKey(key_, NowNs() - 3 * kDayNs); },
              testing::ThrowsMessage<PassingError>(
                  HasSubstr("cert.pem: is valid from 20")));
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
  std::string text = Slurp(file);
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

// Replaces the permissions of a key by some that its holder has signed.
void SignOwnPermissions(const fs::path& folder) {
  SignAgain(folder / "permissions.p7s", folder / "cert.pem",
            folder / "key.pem");
}

// As Fast DDS 2.9.1 verifies the permissions of a participant.
bool FastDdsAccepts(const fs::path& folder) {
  const Owned<X509_STORE> store(X509_STORE_new());
  X509_STORE_add_cert(store.get(), CertificateIn(folder / "ca.pem").get());
  BIO* content = nullptr;
  const Owned<PKCS7> signature(
      SMIME_read_PKCS7(Open(folder / "permissions.p7s").get(), &content));
  const Owned<BIO> owned(content);
  return PKCS7_verify(signature.get(), nullptr, store.get(), content, nullptr,
                      PKCS7_TEXT) == 1;
}

TEST_F(KeysTest, AKeyCannotGrantItselfPermissions) {
  EXPECT_TRUE(FastDdsAccepts(key_));
  SignOwnPermissions(key_);
  EXPECT_FALSE(FastDdsAccepts(key_));
}

// Certificates without a purpose, as earlier versions made them, can sign.
TEST_F(KeysTest, PermissionsThatAKeyHasGrantedItselfAreRefused) {
  const Owned<X509> certificate = CertificateIn(key_ / "cert.pem");
  X509_EXTENSION_free(X509_delete_ext(
      certificate.get(),
      X509_get_ext_by_NID(certificate.get(), NID_ext_key_usage, -1)));
  X509_sign(certificate.get(), KeyIn(folder_ / "ca.key").get(), EVP_sha256());
  PEM_write_bio_X509(Open(key_ / "cert.pem", "w").get(), certificate.get());
  EXPECT_EQ(Refusal(key_), "");

  SignOwnPermissions(key_);
  EXPECT_TRUE(FastDdsAccepts(key_));
  EXPECT_THAT(Refusal(key_),
              HasSubstr("permissions.p7s: its signature does not hold"));
}

}  // namespace
}  // namespace fdi::idl
