#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace fdi::console {

/// What a user may do; each includes those before it.
enum class Role : std::uint8_t {
  kView,         ///< Read everything.
  kAcknowledge,  ///< Acknowledge, shelve, take off the shelf.
  kEngineer,     ///< Label.
};

inline constexpr const char* kRoleNames = "view, acknowledge or engineer";
const char* RoleName(Role role);
std::optional<Role> ParseRole(std::string_view name);

struct User {
  Role role{Role::kView};
  /// By crypt(3); "*": no password fits, a proxy has to know the user.
  std::string hash{"*"};
};

/// By name.
using Users = std::map<std::string, User, std::less<>>;

/// Reads lines NAME:ROLE:HASH; empty ones and those with # in front are
/// skipped. A name has 1..64 letters, digits, '.', '_', '-', '@'.
/// @throws ConfigError with the number of the line and what is accepted, or if
///   others can read the file; DataError if it cannot be read.
Users LoadUsers(const std::filesystem::path& path);

/// Adds the line of a user, replaces it, or with nothing removes it. The file
/// is there whole at any time, with mode 0600 if it is made; its other lines,
/// its owner and group stay.
/// @throws ConfigError if the name cannot be one, or as LoadUsers();
///   NotFoundError if there is nobody to remove; DataError.
void StoreUser(const std::filesystem::path& path, const std::string& name,
               const std::optional<User>& user);

/// yescrypt at the cost that libxcrypt prefers, with a random salt.
/// @throws ConfigError if the password has fewer than 8 or more than 256 bytes,
///   or control characters.
std::string HashPassword(const std::string& password);

/// Takes tens of milliseconds whether it fits or not.
bool PasswordFits(const std::string& password, const std::string& hash);

/// Takes the same time wherever the texts differ.
bool SameSecret(std::string_view given, std::string_view secret);

/// 48 hexadecimal digits that nobody can guess.
std::string RandomToken();

}  // namespace fdi::console
