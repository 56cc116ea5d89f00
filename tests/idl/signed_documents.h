#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509v3.h>

namespace fdi::idl {

struct Freer {
  void operator()(BIO* bio) const { BIO_free_all(bio); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(PKCS7* signature) const { PKCS7_free(signature); }
  void operator()(X509_STORE* store) const { X509_STORE_free(store); }
};
template <typename T>
using Owned = std::unique_ptr<T, Freer>;

inline std::string Slurp(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

inline Owned<BIO> Open(const std::filesystem::path& file,
                       const char* mode = "r") {
  return Owned<BIO>(BIO_new_file(file.c_str(), mode));
}
inline Owned<X509> CertificateIn(const std::filesystem::path& file) {
  return Owned<X509>(
      PEM_read_bio_X509(Open(file).get(), nullptr, nullptr, nullptr));
}
inline Owned<EVP_PKEY> KeyIn(const std::filesystem::path& file) {
  return Owned<EVP_PKEY>(
      PEM_read_bio_PrivateKey(Open(file).get(), nullptr, nullptr, nullptr));
}

/// Signs the document in `file`, as `change` makes it, with another key.
inline void SignAgain(
    const std::filesystem::path& file, const std::filesystem::path& certificate,
    const std::filesystem::path& key,
    const std::function<std::string(std::string)>& change = {}) {
  constexpr int kFlags = PKCS7_DETACHED | PKCS7_TEXT;
  const std::string text = Slurp(file);
  const std::size_t begin = text.find("<?xml");
  std::string document = text.substr(begin, text.find("</dds>") + 7 - begin);
  if (change) {
    document = change(std::move(document));
  }
  const Owned<BIO> in(
      BIO_new_mem_buf(document.data(), static_cast<int>(document.size())));
  const Owned<PKCS7> signature(PKCS7_sign(CertificateIn(certificate).get(),
                                          KeyIn(key).get(), nullptr, in.get(),
                                          kFlags));
  ASSERT_NE(signature, nullptr);
  BIO_reset(in.get());
  SMIME_write_PKCS7(Open(file, "w").get(), signature.get(), in.get(), kFlags);
}

}  // namespace fdi::idl
