#include "monitor/http/http_server.h"

#include <cerrno>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include <httplib.h>

#include "diagnosis/error.h"

namespace fdi::monitor {
namespace {

constexpr std::size_t kWaitingConnections = 64;
constexpr std::chrono::milliseconds kClientPatience{500};

// Takes a bounded number of connections, then makes the accepting thread wait.
class BoundedPool : public httplib::TaskQueue {
 public:
  explicit BoundedPool(std::size_t threads) {
    for (std::size_t i = 0; i < threads; ++i) {
      threads_.emplace_back([this] { Work(); });
    }
  }

  void enqueue(std::function<void()> job) override {
    std::unique_lock lock(mutex_);
    changed_.wait(
        lock, [this] { return ended_ || jobs_.size() < kWaitingConnections; });
    jobs_.push_back(std::move(job));
    changed_.notify_all();
  }

  // Connections that wait are dropped: the process ends.
  void shutdown() override {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
      changed_.notify_all();
    }
    for (std::thread& thread : threads_) {
      thread.join();
    }
  }

 private:
  void Work() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return ended_ || !jobs_.empty(); });
      if (ended_) {
        return;
      }
      const std::function<void()> job = std::move(jobs_.front());
      jobs_.pop_front();
      changed_.notify_all();
      lock.unlock();
      job();
      lock.lock();
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  bool ended_{false};
  std::vector<std::thread> threads_;
};

// The library's own options let two servers share a port in silence.
void ForbidSharing(int socket) {
  const int yes = 1;
  setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
}

[[noreturn]] void RefuseAddress(const std::string& text,
                                const std::string& option) {
  throw ConfigError(option + " " + text +
                    ": expected PORT, ADDRESS:PORT or [IPv6]:PORT with a port "
                    "of 0..65535, e.g. 127.0.0.1:9464");
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
  return address;
}

std::string ToString(const HttpAddress& address) {
  const bool ipv6 = address.host.find(':') != std::string::npos;
  std::string text;
  text.append(ipv6 ? "[" : "").append(address.host).append(ipv6 ? "]:" : ":");
  return text.append(std::to_string(address.port));
}

HttpServer::HttpServer(const HttpServerOptions& options)
    : server_(std::make_unique<httplib::Server>()), address_(options.address) {
  const HttpAddress& address = options.address;
  server_->set_socket_options([](socket_t socket) { ForbidSharing(socket); });
  server_->new_task_queue = [threads = options.threads] {
    return new BoundedPool(threads);
  };
  server_->set_keep_alive_max_count(1);
  server_->set_keep_alive_timeout(1);
  server_->set_read_timeout(kClientPatience);
  server_->set_write_timeout(kClientPatience);
  server_->set_payload_max_length(options.max_body);
  errno = 0;
  const int port =
      address.port == 0
          ? server_->bind_to_any_port(address.host)
          : (server_->bind_to_port(address.host, address.port) ? address.port
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
  server_->stop();
}

void HttpServer::Add(Pages pages) {
  for (auto& [path, make] : pages) {
    server_->Get(path, [make = std::move(make)](const httplib::Request&,
                                                httplib::Response& response) {
      HttpPage page = make();
      response.status = page.status;
      response.set_content(std::move(page.body), page.type.c_str());
    });
  }
}

void HttpServer::Start() {
  thread_ = std::thread([this] { server_->listen_after_bind(); });
  while (!server_->is_running()) {  // stop() before that would be forgotten.
    std::this_thread::yield();
  }
}

}  // namespace fdi::monitor
