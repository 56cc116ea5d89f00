#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "monitor/http/tls.h"

namespace httplib {
class Server;
}

namespace fdi::monitor {

/// Address on which a server listens.
struct HttpAddress {
  std::string host;
  int port{0};  ///< 0: any free port.
};

/// Parses "PORT" (on 127.0.0.1), "HOST:PORT" or "[IPv6]:PORT".
/// @param option to name in the error message.
/// @throws ConfigError naming option, text and what is accepted.
HttpAddress ParseHttpAddress(const std::string& text,
                             const std::string& option);

/// "127.0.0.1:9464", "[::1]:9464"
std::string ToString(const HttpAddress& address);

struct HttpPage {
  int status{200};
  std::string type{"text/plain; charset=utf-8"};
  std::string body;
};

/// A pool of threads for the requests that `takes` accepts, with a bounded
/// queue; a request that finds it full is answered 503 with Retry-After.
struct HttpLane {
  std::size_t threads{2};
  std::size_t waiting{32};
  std::function<bool(std::string_view path)> takes{};  ///< Null: all.
};

/// Settings of HttpServer.
struct HttpServerOptions {
  HttpAddress address;
  std::string option{"--http"};      ///< Named in error messages.
  std::vector<HttpLane> lanes{{}};   ///< The first lane that takes a request.
  std::size_t max_body{0};           ///< Of a request [bytes].
  std::vector<std::string> names{};  ///< See HostAllowed().
  std::optional<TlsFiles> tls{};     ///< Nothing: plain HTTP.
  std::string user_header{};         ///< See ParseRequestHead().
};

/// An HTTP server with threads of its own. A request is read completely, in
/// bounded memory and time, before a worker thread sees it, so no client can
/// occupy a worker by sending slowly; a client that reads slowly is cut off. At
/// most 128 clients are open at once; a further one replaces the oldest.
class HttpServer {
 public:
  /// Maps paths to functions that make the page, called by any worker thread.
  using Pages = std::map<std::string, std::function<HttpPage()>>;
  /// Clients since the start, by outcome: "answered", "failed", "malformed",
  /// "too_large", "encoded", "host", "slow", "busy", "left", or "tls" for a
  /// failed handshake.
  using Counts = std::map<std::string_view, std::uint64_t>;

  /// Binds the address; nothing is served yet. A second server on the same
  /// address is an error.
  /// @throws std::runtime_error naming the address and the reason; ConfigError
  ///   as TlsContext.
  explicit HttpServer(const HttpServerOptions& options);
  /// Finishes the answers in progress, which may take a second.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Serves GET from `pages`, which may refer only to objects that outlive
  /// this. Call before Start().
  void Add(const Pages& pages);
  /// The library's server, for what pages cannot do. Use before Start().
  httplib::Server& routes();

  /// Starts serving. Call once. @throws std::runtime_error if the socket was
  /// closed meanwhile.
  void Start();

  /// Stops accepting connections. Does not block.
  void Stop();

  /// Reloads the certificate files for future clients. @returns days until the
  /// certificate expires; nothing without TLS.
  /// @throws ConfigError as TlsContext; the old one stays.
  std::optional<int> RenewTls();

  /// With the actual port if 0 was requested.
  const HttpAddress& address() const { return address_; }
  bool has_tls() const { return has_tls_; }

  Counts counts() const;

 private:
  class Gate;
  std::unique_ptr<Gate> gate_;
  HttpAddress address_;
  bool has_tls_{false};
  std::thread thread_;
};

}  // namespace fdi::monitor
