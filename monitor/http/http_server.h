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

/// Where a server listens.
struct HttpAddress {
  std::string host;
  int port{0};  ///< 0: any that is free.
};

/// "PORT" (of 127.0.0.1), "HOST:PORT" or "[IPv6]:PORT".
/// @param option that it is the value of, for the message.
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

/// Threads that answer the requests which `takes` says yes to, and how many may
/// wait for them; one more is answered 503 with Retry-After.
struct HttpLane {
  std::size_t threads{2};
  std::size_t waiting{32};
  std::function<bool(std::string_view path)> takes{};  ///< Null: all.
};

/// Settings of HttpServer.
struct HttpServerOptions {
  HttpAddress address;
  std::string option{"--http"};      ///< That asked for it, for messages.
  std::vector<HttpLane> lanes{{}};   ///< The first that takes it answers.
  std::size_t max_body{0};           ///< Of a request [bytes].
  std::vector<std::string> names{};  ///< See HostAllowed().
  std::optional<TlsFiles> tls{};     ///< Nothing: plain HTTP.
  std::string user_header{};         ///< See ParseRequestHead().
};

/// Answers HTTP by threads of its own. A request is read whole, in bounded
/// memory and time, before any of them sees it, so that no client holds a
/// thread by sending slowly. A client that reads slowly is cut off. At most 128
/// clients are listened to at once; the next one takes the place of the one
/// that has been silent longest.
class HttpServer {
 public:
  /// From path to what makes the page, called by any of the threads.
  using Pages = std::map<std::string, std::function<HttpPage()>>;
  /// Clients by what became of them since the start: "answered", "failed",
  /// "malformed", "too_large", "encoded", "host", "slow", "busy", "left" or
  /// "tls": no handshake that we understand.
  using Counts = std::map<std::string_view, std::uint64_t>;

  /// Binds the address; nothing is answered yet. A second server on the same
  /// address is an error.
  /// @throws std::runtime_error naming the address and the reason; ConfigError
  ///   as TlsContext.
  explicit HttpServer(const HttpServerOptions& options);
  /// Answers what it is at, which may take a second, and no more.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Answers GET by `pages`, which may refer to what outlives this. Before
  /// Start().
  void Add(const Pages& pages);
  /// For what pages cannot do. Before Start().
  httplib::Server& routes();

  /// Answers from now on. Once.
  void Start();

  /// Takes no further connections. Does not wait.
  void Stop();

  /// Takes the files of the certificate as they are now, for clients that come
  /// from now on. @returns days until it ends; nothing without TLS.
  /// @throws ConfigError as TlsContext; the old one stays.
  std::optional<int> RenewTls();

  /// With the port that was found, if any was asked for.
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
