#include "monitor/http/http_server.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <deque>
#include <list>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <httplib.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/error.h"
#include "base/mutex.h"
#include "monitor/http/request_head.h"

namespace fdi::monitor {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

// Descriptors are scarce: the usual limit of a process is 1024.
constexpr std::size_t kMaxClients = 128;
constexpr std::size_t kMaxAccepted = 64;        // Not yet among the clients.
constexpr milliseconds kRequestPatience{2000};  // For a whole request.
constexpr milliseconds kRefusalPatience{500};   // For reading a refusal.
// Limits on how long a client may block a thread, at a time and in total; the
// total grows with the length of the answer.
constexpr milliseconds kPausePatience{2000};
constexpr milliseconds kAnswerPatience{5000};
constexpr std::size_t kSlowestBytesPerMs = 1000;
constexpr milliseconds kStopPatience{500};
// The library's backlog of 5 makes clients of a burst wait for seconds.
constexpr int kBacklog = 256;

constexpr Refusal kForeignHost{
    403, "Forbidden",
    "Host: expected a name or address of this server (--allow-host NAME)",
    "host"};
constexpr Refusal kSlow{408, "Request Timeout",
                        "expected a whole request within 2 s", "slow"};
constexpr Refusal kPlainHttp{400, "Bad Request", "this port speaks https alone",
                             "tls"};
constexpr Refusal kBusy{503, "Service Unavailable",
                        "too many such requests wait already", "busy"};

// Runs the library's jobs in the accepting thread: they only hand over a
// socket.
class Inline : public httplib::TaskQueue {
 public:
  // void in the library's version 0.11 (Debian 12), bool in 0.18 (Debian 13).
  using Taken = decltype(std::declval<httplib::TaskQueue&>().enqueue(nullptr));
  Taken enqueue(std::function<void()> job) override {
    job();
    return Taken(true);
  }
  void shutdown() override {}
};

// A connected non-blocking socket, with or without TLS; closed on destruction.
class Socket {
 public:
  Socket(int handle, const TlsContext* tls) : handle_(handle) {
    fcntl(handle, F_SETFD, FD_CLOEXEC);
    fcntl(handle, F_SETFL, O_NONBLOCK);
    if (tls != nullptr) {
      tls_ = tls->Accept(handle);
    }
  }
  ~Socket() {
    tls_.reset();  // Sends close_notify.
    if (handle_ >= 0) {
      close(handle_);
    }
  }
  Socket(Socket&& other) noexcept
      : handle_(std::exchange(other.handle_, -1)),
        tls_(std::move(other.tls_)) {}
  Socket& operator=(Socket&& other) noexcept {
    std::swap(handle_, other.handle_);
    std::swap(tls_, other.tls_);
    return *this;
  }
  int handle() const { return handle_; }
  short events() const { return tls_ ? tls_->events() : short{POLLIN}; }
  bool pending() const { return tls_ && tls_->pending(); }

  // Like recv() and send(); TlsSession describes the values of errno.
  ssize_t Receive(char* to, std::size_t size) const {
    return tls_ ? tls_->Receive(to, size) : recv(handle_, to, size, 0);
  }
  ssize_t Send(const char* from, std::size_t size) const {
    return tls_ ? tls_->Send(from, size)
                : send(handle_, from, size, MSG_NOSIGNAL);
  }
  void EndTls() { tls_.reset(); }

 private:
  int handle_;
  std::unique_ptr<TlsSession> tls_;
};

// A client whose request is incomplete, or that was refused and still sends.
struct Client {
  Socket socket;
  Clock::time_point deadline;
  std::string bytes{};
  std::optional<RequestHead> head{};
  bool refused{false};
};

// The stream that the library reads from and writes to. It waits for a slow
// reader, but in total no longer than an answer of that length may take.
class AnswerStream : public httplib::Stream {
 public:
  AnswerStream(const Client& client, const std::atomic<bool>& ended)
      : socket_(client.socket),
        request_(client.head->text + client.bytes.substr(client.head->size)),
        ended_(ended) {}

  bool is_readable() const override { return place_ < request_.size(); }
  bool is_writable() const override { return writable_; }
  ssize_t read(char* to, std::size_t size) override {
    const std::size_t count = request_.copy(to, size, place_);
    place_ += count;
    return static_cast<ssize_t>(count);
  }
  ssize_t write(const char* from, std::size_t size) override {
    while (writable_) {
      const ssize_t count = socket_.Send(from, size);
      if (count >= 0) {
        written_ += static_cast<std::size_t>(count);
        paused_ = {};
        return count;
      }
      writable_ = errno == EINTR || (errno == EAGAIN && AwaitClient());
    }
    return -1;
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    sockaddr_storage address{};
    socklen_t size = sizeof address;
    std::array<char, NI_MAXHOST> host{};
    auto* const plain = reinterpret_cast<sockaddr*>(&address);
    if (getpeername(socket_.handle(), plain, &size) == 0 &&
        getnameinfo(plain, size, host.data(), host.size(), nullptr, 0,
                    NI_NUMERICHOST) == 0) {
      ip = host.data();
    }
    port = 0;
  }
  void get_local_ip_and_port(std::string& /*ip*/,
                             int& /*port*/) const override {}
  socket_t socket() const override { return -1; }

 private:
  bool AwaitClient() {
    const Clock::time_point begin = Clock::now();
    pollfd entry{socket_.handle(), POLLOUT, 0};
    // In steps of 100 ms, so that the end of the server is noticed.
    const int ready = poll(&entry, 1, 100);
    const Clock::duration waited = Clock::now() - begin;
    waited_ += waited;
    paused_ += waited;
    // Waiting for w bytes takes at most 5 s + w / (1 MB/s): a client may read a
    // long answer at a mean rate of w / (5 s + w / (1 MB/s)), and none has to
    // read faster than 1 MB/s.
    const milliseconds patience =
        ended_ ? kStopPatience
               : kAnswerPatience + milliseconds(written_ / kSlowestBytesPerMs);
    return ready > 0 || (paused_ < kPausePatience && waited_ < patience);
  }

  const Socket& socket_;
  const std::string request_;
  const std::atomic<bool>& ended_;
  std::size_t place_{0};
  std::size_t written_{0};
  Clock::duration waited_{0};
  Clock::duration paused_{0};  // Since the last byte was accepted.
  bool writable_{true};
};

// The library's own options let two servers share a port silently.
void SetListenerOptions(int socket) {
  const int yes = 1;
  setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
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

// The library's routes behind one thread that reads all requests. A client has
// one owner at a time, and needs no lock of its own:
//
//     accepting thread -> accepted_ -> listening thread -> waiting -> worker
//                         (mutex_)     clients_            (mutex_)
class HttpServer::Gate : public httplib::Server {
 public:
  explicit Gate(const HttpServerOptions& options) : options_(options) {
    RenewTls();
    if (pipe2(wake_.data(), O_CLOEXEC | O_NONBLOCK) != 0) {
      throw std::system_error(errno, std::generic_category(), "pipe2");
    }
    for (const HttpLane& lane : options.lanes) {
      lanes_.emplace_back(lane);
    }
  }
  ~Gate() override {
    End();
    for (std::thread& thread : threads_) {
      thread.join();
    }
    close(wake_[0]);
    close(wake_[1]);
  }
  Gate(const Gate&) = delete;
  Gate& operator=(const Gate&) = delete;

  void Start() {
    // The library listens already; a second call only changes the backlog.
    ::listen(svr_sock_, kBacklog);
    threads_.emplace_back([this] { Listen(); });
    for (Lane& lane : lanes_) {
      for (std::size_t i = 0; i < lane.options.threads; ++i) {
        threads_.emplace_back([this, &lane] { Answer(lane); });
      }
    }
  }

  void End() {
    // stop() alone does not end the library's loop while it waits for room in
    // process_and_close_socket(); ended_ does. It is set under the lock: a
    // thread between its check and its wait would miss the notification
    // otherwise.
    stop();
    const MutexLock lock(mutex_);
    ended_ = true;
    changed_.notify_all();
    Wake();
  }

  Counts counts() const {
    const MutexLock lock(mutex_);
    return counts_;
  }

  std::optional<int> RenewTls() {
    if (!options_.tls) {
      return std::nullopt;
    }
    // Read before the lock is taken. Sessions of the old context go on, because
    // each holds a reference to it.
    auto tls = std::make_unique<const TlsContext>(*options_.tls);
    const MutexLock lock(mutex_);
    tls_ = std::move(tls);
    return tls_->days_left();
  }

 private:
  struct Lane {
    explicit Lane(HttpLane lane) : options(std::move(lane)) {}
    HttpLane options;
    std::deque<Client> waiting;  // Guarded by mutex_.
  };

  // Called by the accepting thread.
  bool process_and_close_socket(socket_t socket) override {
    MutexLock lock(mutex_);
    Client client{Socket(socket, tls_.get()), Clock::now() + kRequestPatience};
    // While the accepting thread waits, further connections stay in the backlog
    // of the kernel instead of being dropped.
    changed_.wait(lock, [this]() REQUIRES(mutex_) {
      return ended_ || accepted_.size() < kMaxAccepted;
    });
    accepted_.push_back(std::move(client));
    Wake();
    return true;
  }

  void Wake() const {
    [[maybe_unused]] const ssize_t ignored = write(wake_[1], "", 1);
  }

  void Count(std::string_view what) {
    const MutexLock lock(mutex_);
    ++counts_[what];
  }

  void Listen() {
    std::vector<pollfd> entries;
    while (!ended_) {
      TakeAccepted();
      entries.assign(1, {wake_[0], POLLIN, 0});
      Clock::time_point next = Clock::now() + kRequestPatience;
      for (const Client& client : clients_) {
        entries.push_back({client.socket.handle(), client.socket.events(), 0});
        next = std::min(next, client.deadline);
      }
      const auto pause = std::chrono::ceil<milliseconds>(next - Clock::now());
      poll(entries.data(), entries.size(),
           static_cast<int>(std::max<milliseconds::rep>(pause.count(), 0)));
      std::array<char, 64> ignored{};
      while (read(wake_[0], ignored.data(), ignored.size()) > 0) {
      }
      // entries[i] is that of the i-th client still: only this thread changes
      // the list, and it takes accepted ones only at the beginning of a turn.
      std::size_t i = 1;
      clients_.remove_if([&](Client& client) {
        return !Serve(client, entries[i++].revents != 0);
      });
    }
    clients_.clear();
  }

  void TakeAccepted() {
    const MutexLock lock(mutex_);
    if (accepted_.empty()) {
      return;
    }
    for (; !accepted_.empty(); accepted_.pop_front()) {
      if (clients_.size() == kMaxClients) {
        counts_["busy"] += clients_.front().refused ? 0 : 1;
        clients_.pop_front();
      }
      clients_.push_back(std::move(accepted_.front()));
    }
    changed_.notify_all();
  }

  // @returns false if the client is to be dropped from the list.
  bool Serve(Client& client, bool readable) {
    if (readable && !Read(client)) {
      return false;
    }
    if (Clock::now() < client.deadline) {
      return client.socket.handle() >= 0;
    }
    return !client.refused && Refuse(client, kSlow);
  }

  bool Read(Client& client) {
    // 4096 bytes a turn, so that a fast client does not hold up the others.
    // More only if TLS has buffered them, which poll() does not report.
    do {
      std::array<char, 4096> part{};
      const ssize_t size = client.socket.Receive(part.data(), part.size());
      if (size < 0 && (errno == EAGAIN || errno == EINTR)) {
        return true;
      }
      if (size <= 0) {
        return Left(client, size < 0 ? errno : 0);
      }
      if (client.refused) {
        continue;
      }
      client.bytes.append(part.data(), static_cast<std::size_t>(size));
      if (!client.head) {
        if (const auto refusal =
                ParseRequestHead(client.bytes, options_.max_body, client.head,
                                 options_.user_header)) {
          return Refuse(client, *refusal);
        }
      }
      if (client.head &&
          client.bytes.size() >= client.head->size + client.head->body_size) {
        return Dispatch(client);
      }
    } while (client.socket.pending());
    return true;
  }

  // Handles a client that closed or failed. @returns as Serve().
  bool Left(Client& client, int error) {
    if (client.refused) {
      return false;
    }
    if (error == EPROTONOSUPPORT) {
      // Answered without TLS, as the client speaks.
      client.socket.EndTls();
      return Refuse(client, kPlainHttp);
    }
    Count(error == EPROTO ? "tls" : "left");
    return false;
  }

  bool Dispatch(Client& client) {
    const RequestHead& head = *client.head;
    if (!HostAllowed(head.host, options_.address.host, options_.names)) {
      return Refuse(client, kForeignHost);
    }
    client.bytes.resize(head.size + head.body_size);
    for (Lane& lane : lanes_) {
      if (!lane.options.takes || lane.options.takes(head.path)) {
        const MutexLock lock(mutex_);
        if (lane.waiting.size() < lane.options.waiting) {
          lane.waiting.push_back(std::move(client));
          changed_.notify_all();
          return false;
        }
        break;
      }
    }
    return Refuse(client, kBusy);
  }

  // Sends the refusal and keeps reading for a while: closing a socket with
  // unread bytes resets the connection, which discards the answer.
  bool Refuse(Client& client, const Refusal& refusal) {
    Count(refusal.kind);
    const std::string body =
        std::string(R"({"error":")") + refusal.reason + "\"}\n";
    std::string answer = "HTTP/1.1 " + std::to_string(refusal.status) + " ";
    answer.append(refusal.title)
        .append("\r\nContent-Type: application/json\r\nContent-Length: ")
        .append(std::to_string(body.size()))
        .append("\r\nX-Content-Type-Options: nosniff\r\n")
        .append(refusal.status == 503 ? "Retry-After: 5\r\n" : "")
        .append("Connection: close\r\n\r\n")
        .append(body);
    // Without waiting: this client had no answer before, so its buffer has
    // room. In an unfinished handshake nothing can be sent, and the client is
    // dropped. What others still send is discarded, without being decrypted.
    const ssize_t sent = client.socket.Send(answer.data(), answer.size());
    client.socket.EndTls();
    shutdown(client.socket.handle(), SHUT_WR);
    client.refused = true;
    client.bytes = {};
    client.deadline = Clock::now() + kRefusalPatience;
    return sent > 0;
  }

  void Answer(Lane& lane) {
    MutexLock lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] { return ended_ || !lane.waiting.empty(); });
      if (ended_) {
        return;
      }
      const Client client = std::move(lane.waiting.front());
      lane.waiting.pop_front();
      ++counts_["answered"];
      lock.unlock();
      AnswerStream stream(client, ended_);
      try {
        Process(stream);
      } catch (const std::exception&) {  // No memory, say; the client sees it.
        const MutexLock again(mutex_);
        --counts_["answered"];
        ++counts_["failed"];
      }
      lock.lock();
    }
  }

  // Version 0.18 of the library takes as an argument what 0.11 asks of the
  // stream. A template, so that only the matching call has to compile.
  void Process(auto& stream) {
    bool closed = true;
    if constexpr (requires {
                    process_request(stream, true, closed, nullptr);
                  }) {
      process_request(stream, true, closed, nullptr);
    } else {
      std::string client;
      int port = 0;
      stream.get_remote_ip_and_port(client, port);
      process_request(stream, client, port, "", 0, true, closed, nullptr);
    }
  }

  const HttpServerOptions options_;
  std::array<int, 2> wake_{};
  std::list<Client> clients_;  // Listening thread only, oldest first.
  std::list<Lane> lanes_;
  std::vector<std::thread> threads_;
  std::atomic<bool> ended_{false};

  mutable Mutex mutex_;
  std::unique_ptr<const TlsContext> tls_
      GUARDED_BY(mutex_);  // Null: plain HTTP.
  CondVar changed_;
  std::deque<Client> accepted_ GUARDED_BY(mutex_);
  Counts counts_ GUARDED_BY(mutex_){
      {"answered", 0}, {"malformed", 0}, {"too_large", 0}, {"encoded", 0},
      {"host", 0},     {"slow", 0},      {"failed", 0},    {"busy", 0},
      {"left", 0},     {"tls", 0}};
};

HttpServer::HttpServer(const HttpServerOptions& options)
    : gate_(std::make_unique<Gate>(options)),
      address_(options.address),
      has_tls_(options.tls.has_value()) {
  const HttpAddress& address = options.address;
  gate_->set_socket_options(SetListenerOptions);
  gate_->new_task_queue = [] { return new Inline; };
  errno = 0;
  const int port =
      address.port == 0
          ? gate_->bind_to_any_port(address.host)
          : (gate_->bind_to_port(address.host, address.port) ? address.port
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
  gate_->End();
}

httplib::Server& HttpServer::routes() {
  return *gate_;
}

std::optional<int> HttpServer::RenewTls() {
  return gate_->RenewTls();
}

HttpServer::Counts HttpServer::counts() const {
  return gate_->counts();
}

void HttpServer::Add(const Pages& pages) {
  for (const auto& [path, make] : pages) {
    gate_->Get(path, [make = make](const httplib::Request&,
                                   httplib::Response& response) {
      const HttpPage page = make();
      response.status = page.status;
      response.set_content(page.body, page.type.c_str());
    });
  }
}

void HttpServer::Start() {
  gate_->Start();
  auto ended = std::make_shared<std::atomic<bool>>(false);
  thread_ = std::thread([this, ended] {
    gate_->listen_after_bind();
    *ended = true;
  });
  while (!gate_->is_running()) {  // An earlier stop() would be lost.
    if (*ended) {
      throw std::runtime_error(ToString(address_) +
                               ": cannot listen: the socket was closed");
    }
    std::this_thread::yield();
  }
}

}  // namespace fdi::monitor
