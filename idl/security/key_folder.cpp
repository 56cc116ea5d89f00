#include "idl/security/key_folder.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <memory>
#include <string_view>
#include <system_error>

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "base/passing_error.h"
#include "base/time_units.h"

namespace fdi::idl {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxName = 64;
constexpr std::size_t kMaxFile = 1U << 20U;

constexpr const char* kCaCertificate = "ca.pem";
constexpr const char* kGovernance = "governance.p7s";
constexpr const char* kCertificate = "cert.pem";
constexpr const char* kKey = "key.pem";
constexpr const char* kPermissions = "permissions.p7s";

template <auto Free>
struct Freer {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
// OpenSSL's is a macro.
void FreeStack(STACK_OF(X509) * stack) {
  sk_X509_free(stack);
}
using Bio = std::unique_ptr<BIO, Freer<BIO_free_all>>;
using PrivateKey = std::unique_ptr<EVP_PKEY, Freer<EVP_PKEY_free>>;
using Certificate = std::unique_ptr<X509, Freer<X509_free>>;
// Without the certificates themselves.
using Certificates = std::unique_ptr<STACK_OF(X509), Freer<FreeStack>>;
using Pkcs7 = std::unique_ptr<PKCS7, Freer<PKCS7_free>>;
using Store = std::unique_ptr<X509_STORE, Freer<X509_STORE_free>>;
using StoreContext =
    std::unique_ptr<X509_STORE_CTX, Freer<X509_STORE_CTX_free>>;

// OpenSSL's reason for the last failed call.
std::string Reason() {
  const char* reason = ERR_reason_error_string(ERR_peek_last_error());
  ERR_clear_error();
  return reason == nullptr ? "unknown reason" : reason;
}

void Require(bool done, const char* what) {
  if (!done) {
    throw DataError(std::string("OpenSSL, ") + what + ": " + Reason());
  }
}

Bio MemoryOf(std::string_view text) {
  Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  Require(bio != nullptr, "memory");
  return bio;
}

std::string TextOf(BIO* bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio, &data);
  return {data, static_cast<std::size_t>(size)};
}

[[noreturn]] void Refuse(const fs::path& file, const std::string& what) {
  throw ConfigError(file.string() + ": " + what);
}

std::string Read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    if (MayPass(errno)) {
      throw PassingError(file.string() + ": cannot be read (" +
                         std::generic_category().message(errno) + ")");
    }
    Refuse(file, std::string("cannot be read (") +
                     std::generic_category().message(errno) +
                     "); expected a file that fdi-keys has made");
  }
  std::string text(kMaxFile, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return text;
}

Certificate ReadCertificate(const fs::path& file) {
  const std::string text = Read(file);
  Certificate certificate(
      PEM_read_bio_X509(MemoryOf(text).get(), nullptr, nullptr, nullptr));
  if (!certificate) {
    Refuse(file, "is no certificate in PEM (" + Reason() + ")");
  }
  return certificate;
}

PrivateKey ReadKey(const fs::path& file) {
  struct stat facts {};
  if (stat(file.c_str(), &facts) == 0 &&
      ((facts.st_mode & 0027U) != 0 ||
       (facts.st_uid != geteuid() && facts.st_uid != 0))) {
    Refuse(file,
           "others can read or change the key; expected a file of the user "
           "that runs the program, or of root, with mode 0600 or 0640");
  }
  const std::string text = Read(file);
  PrivateKey key(
      PEM_read_bio_PrivateKey(MemoryOf(text).get(), nullptr, nullptr, nullptr));
  if (!key) {
    Refuse(file, "is no private key in PEM (" + Reason() + ")");
  }
  return key;
}

std::int64_t SecondsOf(const ASN1_TIME* time) {
  std::tm parts{};
  Require(ASN1_TIME_to_tm(time, &parts) == 1, "time");
  return timegm(&parts);
}

std::string CommonName(const X509* certificate) {
  std::array<char, 2 * kMaxName> name{};
  X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName,
                            name.data(), name.size());
  return name.data();
}

std::string UtcText(std::int64_t seconds) {
  const std::time_t time = seconds;
  std::tm parts{};
  gmtime_r(&time, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  return text.data();
}

Store StoreOf(X509* authority) {
  Store store(X509_STORE_new());
  Require(store != nullptr && X509_STORE_add_cert(store.get(), authority) == 1,
          "store");
  // Validity periods are checked separately, with an error message of their
  // own.
  X509_STORE_set_flags(store.get(), X509_V_FLAG_NO_CHECK_TIME);
  return store;
}

// Verifies that `authority` itself has signed, and not the holder of a key that
// it has signed. @returns the document.
std::string ReadSigned(const fs::path& file, X509* authority) {
  const std::string text = Read(file);
  const Bio in = MemoryOf(text);
  BIO* content = nullptr;
  const Pkcs7 signature(SMIME_read_PKCS7(in.get(), &content));
  const Bio owned(content);
  if (!signature || content == nullptr) {
    Refuse(file,
           "is no document that an authority has signed (" + Reason() + ")");
  }
  const Certificates signers(sk_X509_new_null());
  Require(signers != nullptr && sk_X509_push(signers.get(), authority) == 1,
          "verification");
  const Bio out(BIO_new(BIO_s_mem()));
  if (PKCS7_verify(signature.get(), signers.get(), nullptr, content, out.get(),
                   PKCS7_TEXT | PKCS7_NOINTERN | PKCS7_NOVERIFY) != 1) {
    Refuse(file, "its signature does not hold (" + Reason() +
                     "): it was changed, or another authority has signed it. "
                     "Remove the folder of the key, and make it anew with "
                     "fdi-keys add");
  }
  return TextOf(out.get());
}

// The text between `before` and `after`; empty if there is none. A search is
// enough, because the signature shows that the document is as fdi-keys wrote
// it.
std::string Between(const std::string& text, const std::string& before,
                    const std::string& after) {
  const std::size_t begin = text.find(before);
  const std::size_t end = begin == std::string::npos
                              ? begin
                              : text.find(after, begin + before.size());
  return end == std::string::npos
             ? ""
             : text.substr(begin + before.size(), end - begin - before.size());
}

// CheckKey() without validity periods.
KeyInfo Examine(const fs::path& folder) {
  // From the authority outwards, so that the first message names the cause: the
  // certificate has to be the authority's, the key that of the certificate, the
  // documents signed, and the permissions for this name.
  const Certificate authority = ReadCertificate(folder / kCaCertificate);
  const Certificate certificate = ReadCertificate(folder / kCertificate);
  const PrivateKey key = ReadKey(folder / kKey);
  const Store store = StoreOf(authority.get());
  const StoreContext context(X509_STORE_CTX_new());
  Require(context != nullptr &&
              X509_STORE_CTX_init(context.get(), store.get(), certificate.get(),
                                  nullptr) == 1,
          "verification");
  if (X509_verify_cert(context.get()) != 1) {
    Refuse(folder / kCertificate,
           std::string("is not of the authority in ca.pem (") +
               X509_verify_cert_error_string(
                   X509_STORE_CTX_get_error(context.get())) +
               "); take all five files from one folder");
  }
  if (X509_check_private_key(certificate.get(), key.get()) != 1) {
    ERR_clear_error();
    Refuse(folder / kKey,
           "is not the key of cert.pem; take all five files from one folder");
  }
  ReadSigned(folder / kGovernance, authority.get());
  const std::string permissions =
      ReadSigned(folder / kPermissions, authority.get());
  KeyInfo info;
  info.name = CommonName(certificate.get());
  const std::string subject =
      Between(permissions, "<subject_name>CN=", "</subject_name>");
  if (subject != info.name) {
    Refuse(folder / kPermissions, "is for '" + subject + "', cert.pem for '" +
                                      info.name +
                                      "'; take all five files from one folder");
  }
  info.has_pv = permissions.find("<topic>fdi/v2/") != std::string::npos;
  info.from_ns =
      SecondsOf(X509_get0_notBefore(certificate.get())) * kNsPerSecond;
  info.until_ns = std::min(SecondsOf(X509_get0_notAfter(certificate.get())),
                           SecondsOf(X509_get0_notAfter(authority.get()))) *
                  kNsPerSecond;
  return info;
}

}  // namespace

KeyInfo CheckKey(const fs::path& folder, std::int64_t now_ns) {
  KeyInfo info = Examine(folder);
  const std::string renew =
      "; fdi-keys renew FOLDER " + info.name + " makes a new one";
  if (now_ns > info.until_ns) {
    Refuse(folder / kCertificate,
           "expired at " + UtcText(info.until_ns / kNsPerSecond) + "Z" + renew);
  }
  if (now_ns < info.from_ns) {
    throw PassingError((folder / kCertificate).string() + ": is valid from " +
                       UtcText(info.from_ns / kNsPerSecond) +
                       "Z on; is the clock of this machine right?");
  }
  return info;
}

}  // namespace fdi::idl
