#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

namespace fdi::monitor {

/// A certificate that signs itself, of 127.0.0.1, and its key (P-256, 0600).
inline void MakeCertificate(const std::filesystem::path& certificate_file,
                            const std::filesystem::path& key_file,
                            int days = 365, int from_days = -400) {
  const std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)> key(EVP_EC_gen("P-256"),
                                                           EVP_PKEY_free);
  const std::unique_ptr<X509, void (*)(X509*)> certificate(X509_new(),
                                                           X509_free);
  X509_set_version(certificate.get(), 2);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), 1);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), from_days * 86400L);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()),
                  days * 86400L + 3600 * (days < 0 ? -1 : 1));
  X509_NAME* const name = X509_get_subject_name(certificate.get());
  X509_NAME_add_entry_by_txt(
      name, "CN", MBSTRING_ASC,
      reinterpret_cast<const unsigned char*>("127.0.0.1"), -1, -1, 0);
  X509_set_issuer_name(certificate.get(), name);
  X509_set_pubkey(certificate.get(), key.get());
  X509_EXTENSION* const alternative = X509V3_EXT_conf_nid(
      nullptr, nullptr, NID_subject_alt_name, "IP:127.0.0.1");
  X509_add_ext(certificate.get(), alternative, -1);
  X509_EXTENSION_free(alternative);
  X509_sign(certificate.get(), key.get(), EVP_sha256());
  std::FILE* const to = std::fopen(certificate_file.c_str(), "w");
  PEM_write_X509(to, certificate.get());
  std::fclose(to);
  std::FILE* const secret =
      std::fopen(key_file.c_str(), key_file == certificate_file ? "a" : "w");
  PEM_write_PrivateKey(secret, key.get(), nullptr, nullptr, 0, nullptr,
                       nullptr);
  std::fclose(secret);
  std::filesystem::permissions(key_file, std::filesystem::perms(0600));
}

}  // namespace fdi::monitor
