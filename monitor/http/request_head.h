#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace fdi::monitor {

/// The first bytes of an HTTP request, checked before the library sees them:
/// version 0.11 of it stores lines, headers and bodies of any length, takes
/// bodies apart that are compressed, and repeats a file for each range that is
/// asked for. Therefore it is given only the headers that our pages read.
struct RequestHead {
  std::string text;     ///< Request line and headers as the library gets them.
  std::string path;     ///< Decoded, without query.
  std::string host;     ///< Header Host.
  std::string user;     ///< The header that names a user, see there.
  std::size_t size{0};  ///< Of the head as it came [bytes].
  std::size_t body_size{0};  ///< Content-Length [bytes].
};

/// Why a request is not answered by a page: a status of HTTP, the words that
/// the client reads, and the word that counts it.
struct Refusal {
  int status;
  const char* title;
  const char* reason;
  const char* kind;
};

inline constexpr std::size_t kMaxTarget = 4096;                  ///< [bytes]
inline constexpr std::size_t kMaxHead = std::size_t{16} * 1024;  ///< [bytes]
inline constexpr std::size_t kMaxHeaders = 100;

/// Reads the head at the beginning of `bytes`.
/// @param head is set once it is whole.
/// @param max_body of a body [bytes].
/// @param user_header by which a proxy says who asks; it may be there once.
/// @returns why it is refused; nothing if it is good so far.
std::optional<Refusal> ParseRequestHead(std::string_view bytes,
                                        std::size_t max_body,
                                        std::optional<RequestHead>& head,
                                        std::string_view user_header = {});

/// A loopback address, or the name for it.
bool IsLoopback(std::string_view host);

/// Whether a page may ask us by this Host header. A name that leads to our
/// address may be anybody's (DNS rebinding), so that a server answers to its
/// own names alone, on any port, as tunnels end on others: bound to a loopback
/// address, localhost and loopback addresses; bound to another, also every
/// address, as an address is nobody's name, and the name of the machine.
/// @param names further ones, as --allow-host has them.
bool HostAllowed(std::string_view host_header, std::string_view bound_host,
                 std::span<const std::string> names = {});

}  // namespace fdi::monitor
