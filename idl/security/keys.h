#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// The keys of DDS Security 1.1 for the topics of fdi, made with OpenSSL.
///
/// A folder of keys holds the authority (ca.pem, ca.key, governance.p7s) and
/// one folder for each program or host, which is all that its programs need:
/// ca.pem, governance.p7s, cert.pem, key.pem and permissions.p7s. ca.key makes
/// further keys and belongs on no host that runs a monitor.
///
/// The governance encrypts samples, discovery and liveliness, and lets nobody
/// in without a key. Keys are ECDSA on P-256, documents S/MIME with SHA-256.
namespace fdi::idl {

/// What the holder of a key may do on the bus.
enum class Role {
  kGateway,  ///< Publish samples of valves.
  kMonitor,  ///< Read samples; publish vectors, events, sets and status.
  kReader,   ///< Read all, publish nothing.
};

inline constexpr const char* kRoleNames = "gateway, monitor or reader";
const char* RoleName(Role role);
std::optional<Role> ParseRole(std::string_view name);

/// Programs and lists warn so long before a key expires.
inline constexpr int kDaysOfWarning = 30;

struct KeyInfo {
  std::string name;  ///< Common name of the certificate, name of the folder.
  Role role{Role::kReader};
  /// Where a gateway may publish samples, as in --partition; empty: anywhere.
  std::string partitions{};
  std::int64_t from_ns{0};   ///< UTC
  std::int64_t until_ns{0};  ///< UTC; the authority's, if that is earlier.
};

/// Makes the authority in `folder`, which is made, too.
/// @param days 1..36500: how long it is valid.
/// @throws ConfigError if there is one, or `days` is out of range.
/// @throws DataError if a file cannot be written.
void MakeAuthority(const std::filesystem::path& folder, int days);

/// Makes the key `name` in `folder`/`name`; with `replace` in place of the one
/// that is there, whole or not at all.
/// @param name 1..64 letters, digits, '.', '_', '-'; no '.' in front.
/// @param partitions of a gateway, see KeyInfo.
/// @param days 1..36500; it ends with the authority at the latest.
/// @throws ConfigError if there is no authority, the key is there (without
///   `replace`: is not there), or the name, `partitions` or `days` is not
///   accepted.
/// @throws DataError if a file cannot be read or written.
KeyInfo MakeKey(const std::filesystem::path& folder, const std::string& name,
                Role role, int days, bool replace,
                const std::string& partitions = {});

/// The keys in `folder`, by name. @throws as CheckKey(), without its times.
std::vector<KeyInfo> ListKeys(const std::filesystem::path& folder);

/// Examines the five files of one key at `now_ns` (UTC).
/// @throws ConfigError naming the file, what is wrong and what to do: missing,
///   open to others, expired, not signed by the authority, changed by hand, of
///   another key.
KeyInfo CheckKey(const std::filesystem::path& folder, std::int64_t now_ns);

}  // namespace fdi::idl
