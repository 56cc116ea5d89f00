#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>

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

/// Settings of HttpServer.
struct HttpServerOptions {
  HttpAddress address;
  std::string option{"--http"};  ///< That asked for it, for messages.
  std::size_t threads{2};
  std::size_t max_body{1024};  ///< Of a request [bytes].
};

/// Answers HTTP by threads of its own. What they cannot take at once waits,
/// a bounded number here and the rest in the backlog of the socket, so that no
/// client costs more than that; a client that does not speak is cut off.
class HttpServer {
 public:
  /// From path to what makes the page, called by any of the threads.
  using Pages = std::map<std::string, std::function<HttpPage()>>;

  /// Binds the address; nothing is answered yet. A second server on the same
  /// address is an error.
  /// @throws std::runtime_error naming the address and the reason.
  explicit HttpServer(const HttpServerOptions& options);
  /// Answers what it is at, which may take a second, and no more.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Answers GET by `pages`, which may refer to what outlives this. Before
  /// Start().
  void Add(Pages pages);
  /// For what pages cannot do. Before Start().
  httplib::Server& routes() { return *server_; }

  /// Answers from now on. Once.
  void Start();

  /// Takes no further connections. Does not wait.
  void Stop();

  /// With the port that was found, if any was asked for.
  const HttpAddress& address() const { return address_; }

 private:
  std::unique_ptr<httplib::Server> server_;
  HttpAddress address_;
  std::thread thread_;
};

}  // namespace fdi::monitor
