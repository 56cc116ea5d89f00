#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <thread>

namespace httplib {
class Server;
struct Request;
struct Response;
}  // namespace httplib

namespace fdi::monitor {

/// Address on which a server listens.
struct HttpAddress {
  std::string host;
  int port{0};  ///< 0: any free port.
};

/// Parses "PORT" (on 127.0.0.1), "HOST:PORT" or "[IPv6]:PORT".
/// @param option to name in the error message.
/// @throws ConfigError naming option, text and what is accepted: only addresses
///   of loopback.
HttpAddress ParseHttpAddress(const std::string& text,
                             const std::string& option);

/// "127.0.0.1:9464", "[::1]:9464"
std::string ToString(const HttpAddress& address);

/// True if the Host header of a request, with or without a port, names this
/// machine as seen from itself. Any other name can be made to resolve to
/// loopback by a web page that its user has open (DNS rebinding).
bool IsLoopback(std::string_view host_header);

struct HttpPage {
  int status{200};
  std::string type{"text/plain; charset=utf-8"};
  std::string body;
};

/// Settings of HttpServer.
struct HttpServerOptions {
  HttpAddress address;
  std::string option{"--http"};  ///< Named in error messages.
  std::size_t threads{4};
  std::size_t max_body{0};  ///< Largest body of a request [bytes].
  /// Sees each request first. Returns whether it goes on to its page;
  /// otherwise it has made the answer. Null: only an IsLoopback() host goes on.
  std::function<bool(const httplib::Request&, httplib::Response&)> admit{};
};

/// An HTTP server on loopback with threads of its own, for programs of this
/// machine and for the proxy in front (docs/console.md), which keeps slow,
/// greedy and malformed clients away from it.
class HttpServer {
 public:
  /// Maps paths to functions that make the page, called by any thread.
  using Pages = std::map<std::string, std::function<HttpPage()>>;

  /// Binds the address; nothing is served yet. A second server on the same
  /// address is an error.
  /// @throws std::runtime_error naming the address and the reason.
  explicit HttpServer(const HttpServerOptions& options);
  /// Finishes the answers in progress, each within 2 s.
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

  /// With the actual port if 0 was requested.
  const HttpAddress& address() const { return address_; }

 private:
  class Library;
  std::unique_ptr<Library> library_;
  HttpAddress address_;
  std::thread thread_;
};

}  // namespace fdi::monitor
