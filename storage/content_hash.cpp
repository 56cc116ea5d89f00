#include <array>
#include <charconv>
#include <cstdio>
#include <stdexcept>

#include <openssl/evp.h>

#include "storage/model_codec.h"

namespace fdi::storage {

std::uint64_t ContentHash(const ModelSet& models) {
  ModelSet content = models;
  content.created_ns = 0;
  content.software.clear();
  content.training_runs.clear();
  return Sha256Start(EncodeModelSet(content));
}

std::uint64_t Sha256Start(std::span<const std::byte> bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), nullptr,
                 EVP_sha256(), nullptr) != 1) {
    throw std::runtime_error("OpenSSL cannot compute SHA-256");
  }
  std::uint64_t hash = 0;
  for (int i = 0; i < 8; ++i) {
    hash = hash << 8U | digest[static_cast<std::size_t>(i)];
  }
  return hash;
}

std::string HashHex(std::uint64_t hash) {
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx",
                static_cast<unsigned long long>(hash));
  return text.data();
}

std::uint64_t HashOfHex(std::string_view text) {
  std::uint64_t hash = 0;
  std::from_chars(text.data(), text.data() + text.size(), hash, 16);
  return hash;
}

}  // namespace fdi::storage
