#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Keys of DDS Security 1.1 for the topics of fdi, made with OpenSSL.
///
/// A key folder contains the authority (ca.pem, ca.key, governance.p7s) and one
/// folder per program or host with everything that its programs need: ca.pem,
/// governance.p7s, cert.pem, key.pem and permissions.p7s. ca.key signs further
/// keys and must not be on a host that runs a monitor.
///
/// The governance encrypts samples, discovery and liveliness, and refuses
/// participants without a key. Keys are ECDSA on P-256, documents S/MIME with
/// SHA-256.
namespace fdi::idl {

/// Permissions of a key's holder on the bus.
enum class Role {
  kGateway,  ///< Publish samples of valves.
  kMonitor,  ///< Read samples; publish all else (docs/security.md).
  kReader,   ///< Read all, publish nothing.
};

inline constexpr const char* kRoleNames = "gateway, monitor or reader";
const char* RoleName(Role role);
std::optional<Role> ParseRole(std::string_view name);

/// How long before its expiry programs and lists warn about a key.
inline constexpr int kDaysOfWarning = 30;

struct KeyInfo {
  std::string name;  ///< Common name of the certificate and name of the folder.
  Role role{Role::kReader};
  /// Where a gateway may publish samples, as in --partition; empty: anywhere.
  std::string partitions{};
  /// Permits the samples of version 2; keys of earlier versions do not.
  bool has_pv{true};
  std::int64_t from_ns{0};   ///< UTC
  std::int64_t until_ns{0};  ///< UTC; the earlier end of key and authority.
};

/// Creates the authority in `folder`, which is created as well, or completes
/// the one of an interrupted call.
/// @param days 1..36500: period of validity.
/// @throws ConfigError if an authority exists, or `days` is out of range.
/// @throws DataError if a file cannot be written.
void MakeAuthority(const std::filesystem::path& folder, int days);

/// Creates the key `name` in `folder`/`name`; with `replace`, atomically in
/// place of the existing one.
/// @param name 1..64 letters, digits, '.', '_', '-'; not beginning with '.'.
/// @param partitions of a gateway, see KeyInfo.
/// @param days 1..36500; limited by the authority's period.
/// @throws ConfigError if there is no authority, the key exists (with
///   `replace`: does not exist), or the name, `partitions` or `days` is
///   invalid.
/// @throws DataError if a file cannot be read or written.
KeyInfo MakeKey(const std::filesystem::path& folder, const std::string& name,
                Role role, int days, bool replace,
                const std::string& partitions = {});

/// Replaces the key by a new one with the same role and partitions; whether it
/// has expired, or another key is damaged, does not matter.
/// @throws NotFoundError if it does not exist; as MakeKey() and CheckKey().
KeyInfo RenewKey(const std::filesystem::path& folder, const std::string& name,
                 int days);

/// The keys in `folder`, by name. @throws as CheckKey(), regardless of periods.
std::vector<KeyInfo> ListKeys(const std::filesystem::path& folder);

/// Checks the five files of one key at `now_ns` (UTC).
/// @throws ConfigError naming the file, the defect and the remedy: missing,
///   open to others, expired, not signed by the authority, modified, or of
///   another key. @throws PassingError if it is not valid yet.
KeyInfo CheckKey(const std::filesystem::path& folder, std::int64_t now_ns);

}  // namespace fdi::idl
