// The documents follow DDS Security 1.1, 9.4.1 (tables and XML schemas).
#include "idl/security/keys.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <memory>
#include <system_error>

#include <fcntl.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "base/passing_error.h"
#include "base/time_units.h"
#include "diagnosis/records/partitions.h"

namespace fdi::idl {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDays = 36500;
constexpr std::int64_t kDay = 86400;
constexpr std::size_t kMaxName = 64;
constexpr std::size_t kMaxFile = 1U << 20U;
// For hosts whose clocks are slow.
constexpr std::int64_t kClockMargin = kDay;

constexpr const char* kCaCertificate = "ca.pem";
constexpr const char* kCaKey = "ca.key";
constexpr const char* kGovernance = "governance.p7s";
constexpr const char* kCertificate = "cert.pem";
constexpr const char* kKey = "key.pem";
constexpr std::string_view kPartition = "<partition>";
constexpr std::string_view kPartitionEnd = "</partition>";
constexpr const char* kPermissions = "permissions.p7s";

struct RoleRow {
  Role role;
  const char* name;
  std::vector<std::string_view> publishes;
  std::vector<std::string_view> subscribes;
};

const std::vector<RoleRow>& Roles() {
  static const std::vector<RoleRow> kRoles{
      {Role::kGateway,
       "gateway",
       {"fdi/v1/ValveSample", "fdi/v2/ValveSample"},
       {}},
      {Role::kMonitor,
       "monitor",
       {"fdi/v1/DecisionVector", "fdi/v1/DecisionBatch", "fdi/v1/FaultEvent",
        "fdi/v1/ModelSetInfo", "fdi/v1/MonitorStatus", "fdi/v1/MonitorShare"},
       // The shares are those of other monitors.
       {"fdi/v1/ValveSample", "fdi/v2/ValveSample", "fdi/v1/MonitorShare"}},
      {Role::kReader, "reader", {}, {"fdi/v1/*", "fdi/v2/*"}}};
  return kRoles;
}

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
using Extension = std::unique_ptr<X509_EXTENSION, Freer<X509_EXTENSION_free>>;

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
                     "); expected a file that fdi-store keys has made");
  }
  std::string text(kMaxFile, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return text;
}

// Creates the file with its final mode, so it is never open to others. It gets
// its name once it is complete, and replaces none, also none that somebody else
// makes meanwhile. What cannot get its name is removed: it may be a private
// key.
void Write(const fs::path& file, std::string_view text, mode_t mode) {
  const fs::path fresh = file.string() + ".new";
  fs::remove(fresh);  // An interrupted call may have left it.
  const int handle =
      open(fresh.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  const bool written = handle >= 0 &&
                       write(handle, text.data(), text.size()) ==
                           static_cast<ssize_t>(text.size()) &&
                       fsync(handle) == 0 &&
                       renameat2(AT_FDCWD, fresh.c_str(), AT_FDCWD,
                                 file.c_str(), RENAME_NOREPLACE) == 0;
  const int reason = errno;
  if (handle >= 0) {
    close(handle);
    if (!written) {
      unlink(fresh.c_str());
    }
  }
  if (!written) {
    throw DataError(file.string() +
                    (reason == EEXIST
                         ? ": exists"
                         : ": cannot be written: " +
                               std::generic_category().message(reason)));
  }
}

void RequireDays(int days) {
  if (days < 1 || days > kMaxDays) {
    throw ConfigError("--days is " + std::to_string(days) +
                      ", accepted are 1 to " + std::to_string(kMaxDays));
  }
}

// These letters need no escape in PermissionsXml() or in a path. A leading '.'
// marks a folder that MakeKey() has not finished.
void RequireName(const std::string& name) {
  const auto accepted = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' ||
           c == '_' || c == '-';
  };
  if (name.empty() || name.size() > kMaxName || name.front() == '.' ||
      !std::ranges::all_of(name, accepted)) {
    throw ConfigError("key name '" + name +
                      "': expected 1 to 64 letters, digits, '.', '_' or '-', "
                      "the first of them no '.'");
  }
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

std::int64_t EndOf(const X509* certificate) {
  return SecondsOf(X509_get0_notAfter(certificate));
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

// Time of creation; unrelated to sample stamps.
std::int64_t NowSeconds() {
  return std::time(nullptr);
}

void AddExtension(X509* certificate, X509* issuer, int kind,
                  const char* value) {
  X509V3_CTX context{};
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  const Extension extension(
      X509V3_EXT_conf_nid(nullptr, &context, kind, value));
  Require(extension != nullptr &&
              X509_add_ext(certificate, extension.get(), -1) == 1,
          "extension");
}

// Signed by `issuer`; self-signed if that is null.
Certificate MakeCertificate(EVP_PKEY* key, const std::string& name,
                            std::int64_t until, X509* issuer,
                            EVP_PKEY* issuer_key) {
  Certificate made(X509_new());
  X509* const certificate = made.get();
  Require(certificate != nullptr && X509_set_version(certificate, 2) == 1,
          "certificate");
  // Random, so that the authority needs no list of the numbers it has given.
  std::array<unsigned char, 16> serial{};
  Require(getentropy(serial.data(), serial.size()) == 0, "random numbers");
  serial[0] &= 0x7FU;
  const std::unique_ptr<BIGNUM, Freer<BN_free>> number(
      BN_bin2bn(serial.data(), serial.size(), nullptr));
  Require(BN_to_ASN1_INTEGER(number.get(),
                             X509_get_serialNumber(certificate)) != nullptr,
          "serial number");
  const std::int64_t from = NowSeconds() - kClockMargin;
  Require(ASN1_TIME_set(X509_getm_notBefore(certificate), from) != nullptr &&
              ASN1_TIME_set(X509_getm_notAfter(certificate), until) != nullptr,
          "time");
  X509_NAME* const subject = X509_get_subject_name(certificate);
  Require(X509_NAME_add_entry_by_txt(
              subject, "CN", MBSTRING_UTF8,
              reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1,
              0) == 1 &&
              X509_set_issuer_name(certificate,
                                   issuer == nullptr
                                       ? subject
                                       : X509_get_subject_name(issuer)) == 1 &&
              X509_set_pubkey(certificate, key) == 1,
          "certificate");
  // The order matters: "hash" needs the public key, "keyid" copies the subject
  // key identifier of `parent`, which may be this certificate, and the
  // signature covers all of it. The authority needs digitalSignature as well,
  // because it signs the governance and the permissions.
  X509* const parent = issuer == nullptr ? certificate : issuer;
  AddExtension(
      certificate, parent, NID_basic_constraints,
      issuer == nullptr ? "critical,CA:TRUE,pathlen:0" : "critical,CA:FALSE");
  AddExtension(certificate, parent, NID_key_usage,
               issuer == nullptr ? "critical,keyCertSign,digitalSignature"
                                 : "critical,digitalSignature,keyAgreement");
  if (issuer != nullptr) {
    // Fast DDS 2.9.1 accepts permissions that any certificate of the authority
    // has signed, even the holder's own, unless it is for other purposes than
    // documents (CVE-2023-24010).
    AddExtension(certificate, parent, NID_ext_key_usage,
                 "clientAuth,serverAuth");
  }
  AddExtension(certificate, parent, NID_subject_key_identifier, "hash");
  AddExtension(certificate, parent, NID_authority_key_identifier, "keyid");
  Require(X509_sign(certificate, issuer_key, EVP_sha256()) > 0, "signature");
  return made;
}

std::string Pem(X509* certificate) {
  const Bio bio(BIO_new(BIO_s_mem()));
  Require(PEM_write_bio_X509(bio.get(), certificate) == 1, "certificate");
  return TextOf(bio.get());
}

std::string Pem(EVP_PKEY* key) {
  const Bio bio(BIO_new(BIO_s_mem()));
  Require(PEM_write_bio_PKCS8PrivateKey(bio.get(), key, nullptr, nullptr, 0,
                                        nullptr, nullptr) == 1,
          "private key");
  return TextOf(bio.get());
}

PrivateKey NewKey() {
  PrivateKey key(EVP_EC_gen("P-256"));
  Require(key != nullptr, "private key");
  return key;
}

// S/MIME with clear text, the form that the library reads.
std::string Sign(const std::string& document, X509* signer, EVP_PKEY* key) {
  constexpr int kFlags = PKCS7_DETACHED | PKCS7_TEXT;
  const Bio in = MemoryOf(document);
  const Pkcs7 signature(PKCS7_sign(signer, key, nullptr, in.get(), kFlags));
  Require(signature != nullptr, "signature");
  // PKCS7_sign() has read the document to its end, and SMIME_write_PKCS7()
  // writes it in front of the signature: it is read from the beginning again.
  BIO_reset(in.get());
  const Bio out(BIO_new(BIO_s_mem()));
  Require(SMIME_write_PKCS7(out.get(), signature.get(), in.get(), kFlags) == 1,
          "signature");
  return TextOf(out.get());
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
                     "fdi-store keys add");
  }
  return TextOf(out.get());
}

std::string TopicList(const char* element,
                      const std::vector<std::string_view>& topics,
                      const std::vector<std::string>& partitions = {}) {
  if (topics.empty()) {
    return "";
  }
  std::string xml = std::string("        <") + element + "><topics>";
  for (const std::string_view topic : topics) {
    xml += "<topic>" + std::string(topic) + "</topic>";
  }
  xml += "</topics><partitions>";
  for (const std::string& partition :
       partitions.empty() ? std::vector<std::string>{"*"} : partitions) {
    xml.append(kPartition).append(partition).append(kPartitionEnd);
  }
  return xml + "</partitions></" + element + ">\n";
}

constexpr std::string_view kHead =
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
    "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
    "xsi:noNamespaceSchemaLocation=\"http://www.omg.org/spec/DDS-Security/"
    "20170801/";

// The grant is named after the role. Its validity has a margin: the certificate
// is what counts.
std::string PermissionsXml(const std::string& name, Role role,
                           const std::string& partitions, std::int64_t until) {
  const auto row = std::ranges::find(Roles(), role, &RoleRow::role);
  return std::string(kHead) +
         "omg_shared_ca_permissions.xsd\">\n"
         "  <permissions>\n"
         "    <grant name=\"" +
         row->name +
         "\">\n"
         "      <subject_name>CN=" +
         name +
         "</subject_name>\n"
         "      <validity><not_before>" +
         UtcText(NowSeconds() - 2 * kClockMargin) + "</not_before><not_after>" +
         UtcText(until + kClockMargin) +
         "</not_after></validity>\n"
         "      <allow_rule>\n"
         "        <domains><id_range><min>0</min><max>232</max></id_range>"
         "</domains>\n" +
         TopicList("publish", row->publishes,
                   ParsePartitions(partitions, false)) +
         TopicList("subscribe", row->subscribes) +
         "      </allow_rule>\n"
         "      <default>DENY</default>\n"
         "    </grant>\n"
         "  </permissions>\n"
         "</dds>\n";
}

// Protects submessages rather than whole datagrams: each writer has a key that
// is given only to readers with the right to its topic.
std::string GovernanceXml() {
  return std::string(kHead) + R"(omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains><id_range><min>0</min><max>232</max></id_range></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>NONE</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>NONE</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
)";
}

// The text between `before` and `after`; empty if there is none. A search is
// enough for documents of ours: the signature shows that they are as
// PermissionsXml() wrote them.
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

void RequireAuthority(const fs::path& folder) {
  if (!fs::exists(folder / kCaCertificate)) {
    throw ConfigError(folder.string() +
                      " has no authority; fdi-store keys init makes one");
  }
}

// The partitions of <publish>. Without it (the role reader) all are searched,
// and those of <subscribe> are "*".
std::string GatewayPartitions(const std::string& permissions) {
  std::string names;
  const std::string_view text =
      std::string_view(permissions).substr(0, permissions.find("</publish>"));
  for (std::size_t at = text.find(kPartition); at != std::string_view::npos;
       at = text.find(kPartition, at)) {
    at += kPartition.size();
    const std::string_view name =
        text.substr(at, text.find(kPartitionEnd, at) - at);
    if (name != "*") {
      names.append(names.empty() ? "" : ",").append(name);
    }
  }
  return names;
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
  const std::string role = Between(permissions, "<grant name=\"", "\"");
  const std::optional<Role> parsed = ParseRole(role);
  if (!parsed) {
    Refuse(folder / kPermissions,
           "grants the role '" + role + "', expected " + kRoleNames);
  }
  info.role = *parsed;
  info.partitions = GatewayPartitions(permissions);
  info.has_pv = permissions.find("<topic>fdi/v2/") != std::string::npos;
  info.from_ns =
      SecondsOf(X509_get0_notBefore(certificate.get())) * kNsPerSecond;
  info.until_ns =
      std::min(EndOf(certificate.get()), EndOf(authority.get())) * kNsPerSecond;
  return info;
}

}  // namespace

const char* RoleName(Role role) {
  return std::ranges::find(Roles(), role, &RoleRow::role)->name;
}

std::optional<Role> ParseRole(std::string_view name) {
  const auto found = std::ranges::find(Roles(), name, &RoleRow::name);
  return found == Roles().end() ? std::nullopt : std::optional(found->role);
}

void MakeAuthority(const fs::path& folder, int days) {
  RequireDays(days);
  if (fs::exists(folder / kCaCertificate)) {
    throw ConfigError(folder.string() +
                      " has an authority already; keys of another one would "
                      "not know those it has made. Choose another folder");
  }
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw DataError(folder.string() + ": cannot be made: " + error.message());
  }
  // The certificate is written last: without it there is no authority. A key
  // without a certificate is that of an interrupted call, which is completed.
  // It is not replaced, because a certificate may exist elsewhere.
  if (!fs::exists(folder / kCaKey)) {
    Write(folder / kCaKey, Pem(NewKey().get()), 0600);
  }
  const PrivateKey key = ReadKey(folder / kCaKey);
  const Certificate certificate =
      MakeCertificate(key.get(), "fdi authority", NowSeconds() + days * kDay,
                      nullptr, key.get());
  fs::remove(folder / kGovernance);
  Write(folder / kGovernance,
        Sign(GovernanceXml(), certificate.get(), key.get()), 0644);
  Write(folder / kCaCertificate, Pem(certificate.get()), 0644);
}

KeyInfo MakeKey(const fs::path& folder, const std::string& name, Role role,
                int days, bool replace, const std::string& partitions) {
  RequireName(name);
  if (!partitions.empty() && role != Role::kGateway) {
    throw ConfigError("--partition is for keys of gateways");
  }
  RequireDays(days);
  RequireAuthority(folder);
  const fs::path target = folder / name;
  if (fs::exists(target) != replace) {
    throw ConfigError(target.string() +
                      (replace ? " is not there; fdi-store keys add makes it"
                               : " is there; fdi-store keys renew makes it "
                                 "anew"));
  }
  const Certificate authority = ReadCertificate(folder / kCaCertificate);
  const PrivateKey authority_key = ReadKey(folder / kCaKey);
  const std::int64_t until =
      std::min(NowSeconds() + days * kDay, EndOf(authority.get()));
  const PrivateKey key = NewKey();
  const Certificate certificate = MakeCertificate(
      key.get(), name, until, authority.get(), authority_key.get());

  // A key is complete or not there, whenever this is interrupted: its files are
  // written beside it and checked as a program will check them, then one call
  // exchanges the folders, and the old key goes under the name of the new one.
  // A folder that an interrupted call left is removed first.
  const fs::path fresh = folder / ("." + name + ".new");
  fs::remove_all(fresh);
  fs::create_directory(fresh);
  Write(fresh / kKey, Pem(key.get()), 0600);
  Write(fresh / kCertificate, Pem(certificate.get()), 0644);
  Write(fresh / kPermissions,
        Sign(PermissionsXml(name, role, partitions, until), authority.get(),
             authority_key.get()),
        0644);
  Write(fresh / kCaCertificate, Read(folder / kCaCertificate), 0644);
  Write(fresh / kGovernance, Read(folder / kGovernance), 0644);
  KeyInfo info = Examine(fresh);
  if (renameat2(AT_FDCWD, fresh.c_str(), AT_FDCWD, target.c_str(),
                replace ? RENAME_EXCHANGE : RENAME_NOREPLACE) != 0) {
    throw DataError(target.string() + ": cannot be replaced: " +
                    std::generic_category().message(errno));
  }
  fs::remove_all(fresh);
  return info;
}

KeyInfo RenewKey(const fs::path& folder, const std::string& name, int days) {
  RequireName(name);
  RequireAuthority(folder);
  if (!fs::exists(folder / name)) {
    throw NotFoundError("no key '" + name + "' in " + folder.string());
  }
  const KeyInfo key = Examine(folder / name);
  return MakeKey(folder, name, key.role, days, true, key.partitions);
}

std::vector<KeyInfo> ListKeys(const fs::path& folder) {
  RequireAuthority(folder);
  std::vector<KeyInfo> keys;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory() &&
        entry.path().filename().string().front() != '.') {
      keys.push_back(Examine(entry.path()));
    }
  }
  std::ranges::sort(keys, {}, &KeyInfo::name);
  return keys;
}

KeyInfo CheckKey(const fs::path& folder, std::int64_t now_ns) {
  KeyInfo info = Examine(folder);
  const std::string renew =
      "; fdi-store keys renew FOLDER " + info.name + " makes a new one";
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
