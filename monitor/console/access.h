#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace fdi::console {

inline constexpr std::size_t kMinTokenLength = 16;

/// A token: its file, made with a random one and mode 0600 if it is not there.
/// @returns the first line. @throws ConfigError if that is shorter than 16
///   characters or has blanks; DataError if the file cannot be used.
std::string LoadToken(const std::filesystem::path& path);

/// Takes the same time wherever the texts differ.
bool SameSecret(std::string_view given, std::string_view secret);

/// A loopback address, or the name for it.
bool IsLoopback(std::string_view host);

/// Whether a page may ask us by this Host header: a name that leads to a
/// loopback address may be anybody's (DNS rebinding), so a console that is
/// bound to one answers to its own names alone, on any port, as tunnels end on
/// others. Bound to another address it answers to all.
bool HostAllowed(std::string_view host_header, std::string_view bound_host);

enum class Permission : std::uint8_t { kGranted, kReadOnly, kWrongToken };

/// @param authorization the header, "Bearer TOKEN".
/// @param token empty: the console is read-only.
Permission MayWrite(std::string_view authorization, std::string_view token);

}  // namespace fdi::console
