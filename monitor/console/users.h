#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace fdi::console {

/// Permissions of a user; each role includes the ones before it.
enum class Role : std::uint8_t {
  kView,         ///< Read everything.
  kAcknowledge,  ///< Acknowledge, shelve, take off the shelf.
  kEngineer,     ///< Label.
};

inline constexpr std::size_t kMaxName = 64;
inline constexpr const char* kRoleNames = "view, acknowledge or engineer";
const char* RoleName(Role role);
std::optional<Role> ParseRole(std::string_view name);

struct User {
  Role role{Role::kView};
  /// From crypt(3); "*": no password matches, so a proxy must authenticate.
  std::string hash{"*"};
};

/// By name.
using Users = std::map<std::string, User, std::less<>>;

/// Reads lines NAME:ROLE:HASH; empty ones and those with # in front are
/// skipped. A name has 1..64 letters, digits, '.', '_', '-', '@'. A hash whose
/// check would take more than about a second is refused.
/// @throws ConfigError with the number of the line and what is accepted, or if
///   others can read the file; DataError if it cannot be read.
Users LoadUsers(const std::filesystem::path& path);

/// Adds or replaces the line of a user, or removes it if `user` is empty. The
/// file is replaced atomically, and created with mode 0600; its other lines,
/// owner and group are kept. Programs that do this at once wait for each other.
/// @throws ConfigError if the name is invalid, or as LoadUsers(); NotFoundError
///   if there is no such user to remove; DataError.
void StoreUser(const std::filesystem::path& file, const std::string& name,
               const std::optional<User>& user);

/// yescrypt at the cost that libxcrypt prefers, with a random salt.
/// @throws ConfigError if the password has fewer than 8 or more than 256 bytes,
///   or control characters.
std::string HashPassword(const std::string& password);

/// Takes tens of milliseconds in either case.
bool PasswordFits(const std::string& password, const std::string& hash);

/// Constant time: independent of where the texts differ.
bool SameSecret(std::string_view given, std::string_view secret);

/// 48 random hexadecimal digits.
std::string RandomToken();

}  // namespace fdi::console
