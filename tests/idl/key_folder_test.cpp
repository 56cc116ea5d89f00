#include "idl/security/key_folder.h"

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
#include "tests/idl/make_keys.h"
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

// The keys are made once; each test has a copy to damage.
class KeyFolderTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made_ = std::make_unique<storage::TemporaryDirectory>();
    for (const char* authority : {"keys", "others"}) {
      MakeAuthority(made_->path() / authority, 100);
      MakeKey(made_->path() / authority, "monitor-1", "--role monitor", 10);
    }
    MakeKey(made_->path() / "keys", "gateway-1", "--role gateway", 10);
  }
  static void TearDownTestSuite() { made_.reset(); }

  KeyFolderTest() {
    fs::copy(made_->path(), directory_.path(), fs::copy_options::recursive);
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

  static std::unique_ptr<storage::TemporaryDirectory> made_;
  storage::TemporaryDirectory directory_;
  const fs::path folder_{directory_.path() / "keys"};
  const fs::path key_{folder_ / "monitor-1"};
};
std::unique_ptr<storage::TemporaryDirectory> KeyFolderTest::made_;

TEST_F(KeyFolderTest, AKeyHasItsNameAndTimes) {
  const KeyInfo key = CheckKey(key_, NowNs());
  EXPECT_EQ(key.name, "monitor-1");
  EXPECT_TRUE(key.has_pv);
  EXPECT_LT(key.from_ns, NowNs());
  EXPECT_GT(key.until_ns, NowNs() + 9 * kDayNs);
  EXPECT_LE(key.until_ns, NowNs() + 10 * kDayNs);
}

TEST_F(KeyFolderTest, AnExpiredKeyIsNamedWithItsEnd) {
  EXPECT_EQ(Refusal(key_, NowNs() + 9 * kDayNs), "");
  EXPECT_THAT(
      Refusal(key_, NowNs() + 11 * kDayNs),
      AllOf(HasSubstr("cert.pem: expired at 20"), HasSubstr("fdi-keys renew")));
  // The clock of a host that boots may be set a moment later.
  EXPECT_THAT([&] { CheckKey(key_, NowNs() - 3 * kDayNs); },
              testing::ThrowsMessage<PassingError>(
                  HasSubstr("cert.pem: is valid from 20")));
}

TEST_F(KeyFolderTest, AKeyThatOthersCanReadIsRefused) {
  fs::permissions(key_ / "key.pem", fs::perms::others_read,
                  fs::perm_options::add);
  EXPECT_THAT(Refusal(key_), HasSubstr("key.pem: others can read"));
}

TEST_F(KeyFolderTest, EachFileThatIsMissingIsNamed) {
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
TEST_F(KeyFolderTest, EachFileThatIsDamagedIsNamed) {
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

TEST_F(KeyFolderTest, RightsThatWereChangedByHandAreRefused) {
  Forge(key_ / "permissions.p7s", "fdi/v1/ValveSample", "fdi/v1/ValveSampl*");
  EXPECT_THAT(Refusal(key_),
              HasSubstr("permissions.p7s: its signature does not hold"));
}

TEST_F(KeyFolderTest, RulesThatWereChangedByHandAreRefused) {
  Forge(key_ / "governance.p7s", "<allow_unauthenticated_participants>false",
        "<allow_unauthenticated_participants>true");
  EXPECT_THAT(Refusal(key_),
              HasSubstr("governance.p7s: its signature does not hold"));
}

TEST_F(KeyFolderTest, FilesOfAnotherKeyOrAuthorityAreRefused) {
  const fs::path others = directory_.path() / "others";
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

TEST_F(KeyFolderTest, AKeyCannotGrantItselfPermissions) {
  EXPECT_TRUE(FastDdsAccepts(key_));
  SignOwnPermissions(key_);
  EXPECT_FALSE(FastDdsAccepts(key_));
}

// Certificates without a purpose, as earlier versions made them, can sign.
TEST_F(KeyFolderTest, PermissionsThatAKeyHasGrantedItselfAreRefused) {
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
