#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace fdi::monitor {

/// The head of an HTTP request, checked before the library sees it: version
/// 0.11 stores lines, headers and bodies of any length, decompresses bodies,
/// and repeats a file for each requested range. It is therefore given only the
/// headers that our pages read.
struct RequestHead {
  std::string text;  ///< Request line and headers for the library.
  std::string path;  ///< Decoded, without query.
  std::string host;  ///< Header Host.
  std::string user;  ///< Value of `user_header`, see ParseRequestHead().
  bool has_host{false};
  bool has_user{false};
  std::size_t size{0};       ///< Size of the head as received [bytes].
  std::size_t body_size{0};  ///< Content-Length [bytes].
};

/// Why a request is refused: HTTP status and its title, the reason for the
/// client, and the counter's name.
struct Refusal {
  int status;
  const char* title;
  const char* reason;
  const char* kind;
};

inline constexpr std::size_t kMaxTarget = 4096;                  ///< [bytes]
inline constexpr std::size_t kMaxHead = std::size_t{16} * 1024;  ///< [bytes]
inline constexpr std::size_t kMaxHeaders = 100;

/// Parses the head at the beginning of `bytes`.
/// @param head set once the head is complete.
/// @param max_body limit of Content-Length [bytes].
/// @param user_header by which a proxy names the user; allowed only once.
/// @returns why the request is refused; nothing if it is valid so far.
std::optional<Refusal> ParseRequestHead(std::string_view bytes,
                                        std::size_t max_body,
                                        std::optional<RequestHead>& head,
                                        std::string_view user_header = {});

/// Whether `host` is a loopback address or "localhost".
bool IsLoopback(std::string_view host);

/// Whether to answer a request with this Host header. Any name can be made to
/// resolve to our address (DNS rebinding), so a server answers only to its own
/// names, on any port because tunnels may change it. Bound to a loopback
/// address: localhost and loopback addresses. Bound to another address: also
/// every IP address, since these cannot be rebound, and the machine's name.
/// @param names additional ones, from --allow-host.
bool HostAllowed(std::string_view host_header, std::string_view bound_host,
                 std::span<const std::string> names = {});

}  // namespace fdi::monitor
