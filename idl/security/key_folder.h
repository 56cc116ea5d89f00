#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

/// Checks the key of a program before the library reads it: for a file that is
/// missing or wrong, Fast DDS names neither the file nor the reason.
///
/// The folder of a key has five files, which the script fdi-keys makes: ca.pem,
/// governance.p7s, cert.pem, key.pem and permissions.p7s (DDS Security 1.1).
namespace fdi::idl {

/// A program warns about its key this long before the key expires.
inline constexpr int kDaysOfWarning = 30;

struct KeyInfo {
  std::string name;  ///< Common name of the certificate.
  /// Permits the samples of version 2; keys of earlier versions do not.
  bool has_pv{true};
  std::int64_t from_ns{0};   ///< UTC
  std::int64_t until_ns{0};  ///< UTC; the earlier end of key and authority.
};

/// Checks the five files of one key at `now_ns` (UTC).
/// @throws ConfigError naming the file, the defect and the remedy: missing,
///   open to others, expired, not signed by the authority, modified, or of
///   another key. @throws PassingError if it is not valid yet.
KeyInfo CheckKey(const std::filesystem::path& folder, std::int64_t now_ns);

}  // namespace fdi::idl
