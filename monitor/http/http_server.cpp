#include "monitor/http/http_server.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <arpa/inet.h>
#include <httplib.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include "base/error.h"

namespace fdi::monitor {
namespace {

// A silent client may keep a thread this long. The end of the service waits for
// it, and has 5 s in all (docs/operations.md).
constexpr int kSilenceSeconds = 1;
constexpr int kPatienceSeconds = 2;
// The library's backlog of 5 makes clients of a burst wait for seconds.
constexpr int kBacklog = 256;

// The library's own options let two servers share a port silently.
void SetListenerOptions(int socket) {
  const int yes = 1;
  setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
}

// The library compresses by Brotli, which takes seconds of a processor for a
// large answer, and repeats a file for each range that a request lists. The
// request is the library's own object, which it does not declare const.
void DropWhatCosts(const httplib::Request& request) {
  auto& own = const_cast<httplib::Request&>(request);
  own.headers.erase("Accept-Encoding");
  own.ranges.clear();
}

[[noreturn]] void RefuseAddress(const std::string& text,
                                const std::string& option) {
  throw ConfigError(option + " " + text +
                    ": expected PORT, ADDRESS:PORT or [IPv6]:PORT with a port "
                    "of 0..65535, e.g. 127.0.0.1:9464");
}

bool IsAddress(const std::string& host) {
  std::array<unsigned char, sizeof(in6_addr)> ignored{};
  return inet_pton(AF_INET, host.c_str(), ignored.data()) == 1;
}

// Strips port and brackets from "host", "host:port", "[v6]", "[v6]:port".
std::string_view WithoutPort(std::string_view host) {
  if (host.starts_with("[")) {
    const std::size_t end = host.find(']');
    return end == std::string_view::npos ? host : host.substr(1, end - 1);
  }
  return host.substr(0, host.rfind(':'));
}

// A name may begin with "127.", too, such as 127.0.0.1.example.com.
bool IsLoopbackHost(std::string_view host) {
  return host == "localhost" || host == "::1" ||
         (host.starts_with("127.") && IsAddress(std::string(host)));
}

}  // namespace

HttpAddress ParseHttpAddress(const std::string& text,
                             const std::string& option) {
  HttpAddress address{"127.0.0.1", 0};
  const std::size_t colon = text.rfind(':');
  std::string port = text;
  if (colon != std::string::npos) {
    address.host = text.substr(0, colon);
    port = text.substr(colon + 1);
    const bool bracketed = address.host.size() > 2 &&
                           address.host.front() == '[' &&
                           address.host.back() == ']';
    if (bracketed) {
      address.host = address.host.substr(1, address.host.size() - 2);
    } else if (address.host.empty() ||
               address.host.find_first_of(":[]") != std::string::npos) {
      RefuseAddress(text, option);
    }
  }
  const char* const end = port.data() + port.size();
  const auto [stop, error] = std::from_chars(port.data(), end, address.port);
  if (error != std::errc{} || stop != end || port.empty() || address.port < 0 ||
      address.port > 65535) {
    RefuseAddress(text, option);
  }
  if (!IsLoopbackHost(address.host)) {
    throw ConfigError(option + " " + text +
                      ": expected 127.0.0.1, ::1 or localhost; other hosts "
                      "come through nginx (docs/console.md, The page beyond "
                      "this host)");
  }
  return address;
}

std::string ToString(const HttpAddress& address) {
  const bool ipv6 = address.host.find(':') != std::string::npos;
  std::string text;
  text.append(ipv6 ? "[" : "").append(address.host).append(ipv6 ? "]:" : ":");
  return text.append(std::to_string(address.port));
}

bool IsLoopback(std::string_view host_header) {
  return IsLoopbackHost(WithoutPort(host_header));
}

class HttpServer::Library : public httplib::Server {
 public:
  // The library listens already; a second call only changes the backlog.
  void LengthenBacklog() { ::listen(svr_sock_, kBacklog); }
};

HttpServer::HttpServer(const HttpServerOptions& options)
    : library_(std::make_unique<Library>()), address_(options.address) {
  library_->set_socket_options(SetListenerOptions);
  library_->set_keep_alive_max_count(1);  // Threads are few, connections cheap.
  library_->set_keep_alive_timeout(kSilenceSeconds);
  library_->set_read_timeout(kPatienceSeconds);
  library_->set_write_timeout(kPatienceSeconds);
  library_->set_payload_max_length(options.max_body);
  library_->new_task_queue = [threads = options.threads] {
    return new httplib::ThreadPool(threads);
  };
  library_->set_pre_routing_handler(
      [admit = options.admit](const httplib::Request& request,
                              httplib::Response& response) {
        DropWhatCosts(request);
        bool admitted = false;
        if (admit) {
          admitted = admit(request, response);
        } else {
          admitted = IsLoopback(request.get_header_value("Host"));
          response.status = admitted ? response.status : 403;
        }
        return admitted ? httplib::Server::HandlerResponse::Unhandled
                        : httplib::Server::HandlerResponse::Handled;
      });
  const HttpAddress& address = options.address;
  errno = 0;
  const int port =
      address.port == 0
          ? library_->bind_to_any_port(address.host)
          : (library_->bind_to_port(address.host, address.port) ? address.port
                                                                : -1);
  if (port < 0) {
    const std::string reason =
        errno == 0 ? "unknown address" : std::generic_category().message(errno);
    throw std::runtime_error(options.option + " " + ToString(address) +
                             ": cannot listen: " + reason);
  }
  address_.port = port;
}

HttpServer::~HttpServer() {
  Stop();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void HttpServer::Stop() {
  library_->stop();
}

httplib::Server& HttpServer::routes() {
  return *library_;
}

void HttpServer::Add(const Pages& pages) {
  for (const auto& [path, make] : pages) {
    library_->Get(path, [make = make](const httplib::Request&,
                                      httplib::Response& response) {
      const HttpPage page = make();
      response.status = page.status;
      response.set_content(page.body, page.type.c_str());
    });
  }
}

void HttpServer::Start() {
  library_->LengthenBacklog();
  auto ended = std::make_shared<std::atomic<bool>>(false);
  thread_ = std::thread([this, ended] {
    library_->listen_after_bind();
    *ended = true;
  });
  while (!library_->is_running()) {  // An earlier stop() would be lost.
    if (*ended) {
      throw std::runtime_error(ToString(address_) +
                               ": cannot listen: the socket was closed");
    }
    std::this_thread::yield();
  }
}

}  // namespace fdi::monitor
