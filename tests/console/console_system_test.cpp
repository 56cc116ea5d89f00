// The console of the built fdi-monitor, over real HTTP and DDS, through nginx
// with the configuration that we ship.

#include <atomic>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <mutex>
#include <regex>
#include <sstream>
#include <thread>

#include <gmock/gmock.h>
#include <httplib.h>
#include <nlohmann/json.hpp>

#include "tests/console/nginx_front.h"
#include "tests/monitor/raw_client.h"
#include "tests/system/attack.h"
#include "tests/system/honest_valve.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using Clock = std::chrono::steady_clock;

constexpr const char* kPassword = "correct horse";
// As a browser says it: user acknowledge, with the password.
constexpr const char* kAuthorization =
    "Authorization: Basic YWNrbm93bGVkZ2U6Y29ycmVjdCBob3JzZQ==\r\n";

/// One who listens to the stream, by a thread of its own.
class Listener {
 public:
  Listener(int port, const std::string& query = "")
      : client_("127.0.0.1", port), thread_([this, query] { Run(query); }) {}
  ~Listener() {
    leaving_ = true;
    thread_.join();
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  /// When a text that `pattern` matches had come; nothing within 20 s.
  std::optional<Clock::time_point> Await(const std::string& pattern) {
    const std::regex wanted(pattern);
    std::unique_lock lock(mutex_);
    const bool came = changed_.wait_for(lock, std::chrono::seconds(20), [&] {
      return std::any_of(events_.begin(), events_.end(), [&](const auto& e) {
        return std::regex_search(e.second, wanted);
      });
    });
    if (!came) {
      return std::nullopt;
    }
    return std::find_if(events_.begin(), events_.end(),
                        [&](const auto& e) {
                          return std::regex_search(e.second, wanted);
                        })
        ->first;
  }
  /// The server ended the stream.
  bool AwaitEnd() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(20),
                             [this] { return ended_; });
  }

 private:
  void Run(const std::string& query) {
    client_.set_read_timeout(20);
    client_.set_default_headers(
        {{"Host", "localhost"},
         httplib::make_basic_authentication_header("view", kPassword)});
    client_.Get("/api/v1/stream" + query,
                [this](const char* data, std::size_t size) {
                  Take({data, size});
                  return !leaving_;
                });
    const std::lock_guard lock(mutex_);
    ended_ = true;
    changed_.notify_all();
  }
  void Take(std::string_view bytes) {
    const std::lock_guard lock(mutex_);
    partial_ += bytes;
    std::size_t end = 0;
    while ((end = partial_.find("\n\n")) != std::string::npos) {
      events_.emplace_back(Clock::now(), partial_.substr(0, end));
      partial_.erase(0, end + 2);
    }
    changed_.notify_all();
  }

  httplib::Client client_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::string partial_;
  std::vector<std::pair<Clock::time_point, std::string>> events_;
  bool ended_{false};
  std::atomic<bool> leaving_{false};
  std::thread thread_;
};

class ConsoleTest : public MonitorFixture {
 protected:
  void SetUp() override {
    if (!HasNginx()) {
      GTEST_SKIP() << "nginx is not found (Debian: apt install nginx)";
    }
    std::filesystem::create_directory(page());
    std::ofstream(page() / "index.html") << "<title>page</title>";
  }
  std::filesystem::path page() const { return directory_.path() / "page"; }
  std::filesystem::path proxy() const { return directory_.path() / "proxy"; }

  std::unique_ptr<ChildProcess> StartWithConsole() {
    std::filesystem::remove_all(proxy());
    auto monitor = StartMonitor({"--console=127.0.0.1:0", "--console-files",
                                 page().string(), "--http=127.0.0.1:0",
                                 "--console-proxy", WriteProxySecret(proxy())});
    nginx_.emplace(proxy(), PortOf(monitor->errors(), "console_listening"),
                   PortOf(monitor->errors(), "http_listening"));
    port_ = nginx_->http();
    return monitor;
  }

  static int PortOf(const std::string& log, const std::string& event) {
    std::smatch address;
    const std::regex pattern(event + " address=127.0.0.1:([0-9]+)");
    EXPECT_TRUE(std::regex_search(log, address, pattern)) << log;
    return std::stoi(address[1]);
  }

  // From an address of its own, so that the limits of nginx for others do not
  // concern it.
  httplib::Client Honest(const std::string& user = "view") const {
    httplib::Client client("127.0.0.1", port_);
    client.set_interface("127.0.0.2");
    client.set_default_headers(
        {{"Host", "localhost"},
         httplib::make_basic_authentication_header(user, kPassword)});
    client.set_read_timeout(20);
    return client;
  }
  json Get(const std::string& path) const {
    const httplib::Result answer = Honest().Get(path);
    EXPECT_TRUE(answer && answer->status == 200)
        << path << (answer ? answer->body : "");
    return answer ? json::parse(answer->body, nullptr, false) : json();
  }
  std::string Metrics() const {
    const httplib::Result answer = Honest().Get("/metrics");
    return answer ? answer->body : "";
  }
  double Metric(const std::string& name) const {
    const std::string page = "\n" + Metrics();
    const std::size_t at = page.find("\n" + name + " ");
    return at == std::string::npos
               ? -1.0
               : std::stod(page.substr(at + name.size() + 2));
  }
  httplib::Result Acknowledge(const std::string& episode,
                              const std::string& user) const {
    httplib::Client client = Honest(user);
    return client.Post("/api/v1/episodes/" + episode + "/ack",
                       {{"Origin", "http://localhost"}},
                       R"({"comment": "on my way"})", "application/json");
  }

  std::optional<NginxFront> nginx_;
  int port_{0};  // The port of nginx.
};

TEST_F(ConsoleTest, AFaultIsOnTheStreamWithinTwoSecondsOfItsEvent) {
  StoreModels(data_, LinearModels());
  const auto monitor = StartWithConsole();
  Listener listener(port_, "?valve=V1");
  ASSERT_TRUE(listener.Await("event: hello"));
  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  const Clock::time_point on_bus = Clock::now();

  const auto shown = listener.Await(
      R"re(event: alarm\ndata: .*"valve":"V1",.*"fault":"f7","certainty":"sure",.*"layer":"observers","state":"ISOLATED")re");
  ASSERT_TRUE(shown);
  EXPECT_LT(*shown - on_bus, std::chrono::seconds(2));
  EXPECT_TRUE(listener.Await(
      R"re(event: tiles\n.*"id":"V1","state":"ISOLATED".*"unacked":true)re"));
  EXPECT_TRUE(listener.Await(R"re(event: sample\n.*"x":30.0)re"));
  EXPECT_EQ(Get("/api/v1/valves/V1/trend")["t_ms"].size(), 80U);
  Publish(200, 201);
  EXPECT_TRUE(listener.Await(R"re(event: gap\n.*"valve":"V1")re"));
}

TEST_F(ConsoleTest, AnAcknowledgementIsToldToAllAndSurvivesARestart) {
  StoreModels(data_, LinearModels());
  auto monitor = StartWithConsole();
  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated));
  const json before = Get("/api/v1/alarms")["alarms"];
  ASSERT_EQ(before.size(), 1U);
  EXPECT_EQ(before[0]["isa"], "UNACK");
  const std::string episode = before[0]["episode"];
  Listener other(port_);
  ASSERT_TRUE(other.Await("event: hello"));

  EXPECT_EQ(Acknowledge(episode, "view")->status, 403);
  EXPECT_EQ(Acknowledge(episode, "stranger")->status, 403);
  EXPECT_EQ(Acknowledge(episode, "nobody")->status, 401);
  ASSERT_EQ(Acknowledge(episode, "acknowledge")->status, 200);
  EXPECT_TRUE(other.Await(R"(event: alarm\n.*"isa":"ACKED".*"acknowledge")"));
  const std::string instance = Get("/api/v1/status")["instance"];
  monitor->Signal(SIGKILL);
  monitor->AwaitExit();
  monitor = StartWithConsole();

  EXPECT_NE(Get("/api/v1/status")["instance"], instance);
  const json after = Get("/api/v1/alarms")["alarms"];
  ASSERT_EQ(after.size(), 1U);
  EXPECT_EQ(after[0]["isa"], "ACKED");
  EXPECT_EQ(after[0]["acked_by"], "acknowledge");
  EXPECT_EQ(Get("/api/v1/episodes/" + episode)["events"].back()["origin"],
            "console 127.0.0.2");
}

TEST_F(ConsoleTest, SixteenStreamsLeaveTheRestFreeAndEndWithTheService) {
  StoreModels(data_, LinearModels());
  const auto monitor = StartWithConsole();
  std::vector<std::unique_ptr<Listener>> listeners;
  for (int i = 0; i < 16; ++i) {
    listeners.push_back(std::make_unique<Listener>(port_));
    ASSERT_TRUE(listeners.back()->Await("event: hello"));
  }

  httplib::Client client = Honest();
  const httplib::Result refused = client.Get("/api/v1/stream");
  EXPECT_EQ(refused->status, 503);
  EXPECT_EQ(refused->get_header_value("Retry-After"), "5");
  EXPECT_EQ(Get("/api/v1/status")["health"], "OK");
  EXPECT_THAT(Metrics(), HasSubstr("fdi_console_streams 16\n"));
  EXPECT_THAT(Metrics(), HasSubstr("{outcome=\"refused\"} 1\n"));
  Publish(0, 20);
  for (const auto& listener : listeners) {
    EXPECT_TRUE(listener->Await("event: tiles"));
  }
  const Clock::time_point stop = Clock::now();
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  EXPECT_LT(Clock::now() - stop, std::chrono::seconds(2));
  for (const auto& listener : listeners) {
    EXPECT_TRUE(listener->AwaitEnd());
  }
}

// Sends `part` again and again, up to 200 MB, or until the server has enough.
void Flood(int port, const std::string& begin, const std::string& part) {
  RawClient client(port);
  bool taken = client.Send(begin);
  for (std::size_t sent = 0; taken && sent < (200U << 20U);
       sent += part.size()) {
    taken = client.Send(part);
  }
  client.Read();
}

// 40 MB of zeros.
std::string BrotliBomb() {
  std::string bomb;
  httplib::detail::brotli_compressor compressor;
  const std::string zeros(std::size_t{1} << 20U, '\0');
  for (int i = 0; i < 40; ++i) {
    compressor.compress(zeros.data(), zeros.size(), i == 39,
                        [&](const char* data, std::size_t size) {
                          bomb.append(data, size);
                          return true;
                        });
  }
  return bomb;
}

TEST_F(ConsoleTest, HostileRequestsTakeNoMemoryAndHoldNobodyUp) {
  StoreModels(data_, LinearModels());
  std::ofstream(page() / "large.js") << std::string(4U << 20U, 'x');
  const auto monitor = StartWithConsole();
  Get("/api/v1/status");
  const double before = PeakMemory(monitor->pid());
  const double descriptors = Metric("process_open_fds");
  const std::string host =
      std::string(" HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n") +
      kAuthorization;
  const std::string post = "POST /api/v1/shelf" + host;
  const std::string kilobyte(1000, 'x');
  const std::string bomb = BrotliBomb();
  std::string ranges = "GET /large.js" + host + "Range: bytes=0-";
  for (int i = 0; i < 500; ++i) {
    ranges += ",0-";
  }
  const std::vector<std::pair<std::string, std::string>> attacks{
      {post + "Content-Encoding: br\r\nContent-Length: " +
           std::to_string(bomb.size()) + "\r\n\r\n" + bomb,
       ""},
      {post + "Transfer-Encoding: chunked\r\n\r\n",
       "3e8\r\n" + kilobyte + "\r\n"},
      {post, "X-" + kilobyte + ": y\r\n"},
      {post + "X: ", kilobyte},
      {"GET /", kilobyte},
      {post + "Content-Type: multipart/form-data; boundary=b\r\n"
              "Content-Length: 209715200\r\n\r\n",
       "--b\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\n" + kilobyte +
           "\r\n"},
      {post + "\r\n", kilobyte},
      {ranges + "\r\n\r\n", ""},
      {"GET /metrics" + host + "\r\n", ""}};

  HonestValve honest(domain_.id());
  const Clock::time_point end = Clock::now() + AttackTime();
  std::uint64_t rounds = 0;
  do {
    std::vector<std::thread> clients;
    for (int i = 0; i < 3; ++i) {
      for (const auto& [begin, part] : attacks) {
        clients.emplace_back(
            [this, begin = begin, part = part] { Flood(port_, begin, part); });
      }
    }
    Get("/api/v1/status");
    for (std::thread& client : clients) {
      client.join();
    }
    ++rounds;
    TakeFor(std::chrono::milliseconds(20));
  } while (Clock::now() < end);
  const HonestValve::Delays delays = honest.Stop();
  std::cout << "requests: " << rounds * 3 * attacks.size() << "; " << delays
            << "; memory " << before << " and " << PeakMemory(monitor->pid())
            << " MB\n";

  ExpectPunctual(delays);
  EXPECT_LT(PeakMemory(monitor->pid()) - before, 40.0);
  EXPECT_LT(Metric("process_open_fds"), descriptors + 40.0);
  EXPECT_EQ(Get("/api/v1/status")["health"], "OK");
}

TEST_F(ConsoleTest, SlowSilentAndDeafClientsHoldNeitherDiagnosisNorTheEndUp) {
  StoreModels(data_, LinearModels());
  std::ofstream(page() / "large.js") << std::string(4U << 20U, 'x');
  const auto monitor = StartWithConsole();
  const double descriptors = Metric("process_open_fds");
  const std::string host =
      std::string(" HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n") +
      kAuthorization;
  std::vector<std::unique_ptr<RawClient>> clients;
  const auto connect = [&](int count, const std::string& begin) {
    for (int i = 0; i < count; ++i) {
      clients.push_back(std::make_unique<RawClient>(port_));
      if (!begin.empty()) {
        clients.back()->Send(begin);
      }
    }
  };
  connect(150, "");
  connect(150, "GET /api/v1/status HTT");
  connect(30, "GET /large.js" + host + "\r\n");
  connect(30, "POST /api/v1/shelf" + host + "Content-Length: 9\r\n\r\nx");
  Publish(0, 1000);
  ASSERT_TRUE(AwaitVectors(1000));
  EXPECT_EQ(Get("/api/v1/status")["health"], "OK");
  EXPECT_LT(Metric("process_open_fds"), descriptors + 40.0);
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
}

TEST_F(ConsoleTest, OnlyUsersComeThroughAndOnlyByTheRightName) {
  StoreModels(data_, LinearModels());
  std::ofstream(directory_.path() / "secret.txt") << "secret";
  const auto monitor = StartWithConsole();
  httplib::SSLClient https("localhost", nginx_->https());
  https.enable_server_certificate_verification(false);
  for (const char* path : {"/", "/api/v1/status", "/metrics", "/nothing"}) {
    EXPECT_EQ(https.Get(path)->status, 401) << path;
  }
  https.set_basic_auth("engineer", kPassword);
  // A client's word about itself does not count.
  const auto status = https.Get("/api/v1/status", {{"X-FDI-User", "eve"},
                                                   {"X-FDI-Role", "view"},
                                                   {"X-FDI-Secret", "guess"}});
  ASSERT_EQ(status->status, 200);
  EXPECT_EQ(json::parse(status->body)["user"], "engineer");
  EXPECT_EQ(json::parse(status->body)["role"], "engineer");
  EXPECT_EQ(https.Get("/", {{"Host", "evil.example"}})->status, 421);
  for (const char* path :
       {"/../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt",
        "/js/../../secret.txt", "/....//secret.txt"}) {
    const int answered = https.Get(path)->status;
    EXPECT_TRUE(answered == 400 || answered == 404) << path << answered;
  }
  // Without the secret on loopback: read-only, as for any local program.
  httplib::Client direct("127.0.0.1",
                         PortOf(monitor->errors(), "console_listening"));
  EXPECT_EQ(json::parse(direct.Get("/api/v1/status")->body)["write"], false);
  EXPECT_EQ(direct.Get("/", {{"Host", "evil.example"}})->status, 403);
}

TEST_F(ConsoleTest, AGnuplotThatHangsHoldsNeitherTheConsoleNorTheEnd) {
  StoreModels(data_, LinearModels());
  const auto tools = directory_.path() / "tools";
  std::filesystem::create_directory(tools);
  const auto begun = directory_.path() / "begun";
  std::ofstream(tools / "gnuplot")
      << "#!/bin/sh\ntouch " << begun.string() << "\nsleep 1000\n";
  std::filesystem::permissions(tools / "gnuplot", std::filesystem::perms(0700));
  const std::string path = std::getenv("PATH");
  setenv("PATH", (tools.string() + ":" + path).c_str(), 1);
  const auto monitor = StartWithConsole();
  setenv("PATH", path.c_str(), 1);
  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated));
  ASSERT_TRUE(Await([this] {
    return !Get("/api/v1/episodes/last")["trace"]["t_ms"].empty();
  }));
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 21; ++i) {
    clients.push_back(std::make_unique<RawClient>(port_));
    clients.back()->Send(
        std::string("GET /api/v1/episodes/last.svg HTTP/1.1\r\n"
                    "Host: localhost\r\nConnection: close\r\n") +
        kAuthorization + "\r\n");
  }

  EXPECT_TRUE(Await([&] { return std::filesystem::exists(begun); }));
  EXPECT_THAT(clients.back()->Read(), HasSubstr("Retry-After: 5\r\n"));
  EXPECT_EQ(Get("/api/v1/status")["health"], "OK");
  const Clock::time_point stop = Clock::now();
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  EXPECT_LT(Clock::now() - stop, std::chrono::seconds(5));
}

TEST_F(ConsoleTest, WhatTheConsoleCannotUseIsRefusedAtTheStart) {
  const std::string nowhere = (directory_.path() / "nowhere").string();
  ChildProcess no_page(
      Command({"--console=127.0.0.1:0", "--console-files", nowhere}));
  EXPECT_EQ(no_page.AwaitExit(), 2);
  EXPECT_THAT(no_page.errors(), HasSubstr(nowhere + ": no index.html"));

  ChildProcess open(Command({"--console=0.0.0.0:8080"}));
  EXPECT_EQ(open.AwaitExit(), 2);
  EXPECT_THAT(open.errors(), HasSubstr("other hosts come through nginx"));

  ChildProcess no_console(Command({"--console-proxy", nowhere}));
  EXPECT_EQ(no_console.AwaitExit(), 2);
  EXPECT_THAT(no_console.errors(), HasSubstr("need --console"));

  const std::vector<std::string> console{"--console=127.0.0.1:0",
                                         "--console-files", page().string()};
  const std::pair<std::vector<std::string>, std::string> kRefused[] = {
      {{"--console-proxy", nowhere}, nowhere + ": cannot be read"},
      {{"--http=10.1.2.3:9464"}, "other hosts come through nginx"},
      {{"--console-users", nowhere}, "--console-users is gone: nginx asks"},
      {{"--console-tls", nowhere}, "--console-tls is gone: nginx has"},
      {{"--allow-host", "valves"}, "--allow-host is gone: nginx answers"}};
  for (const auto& [options, complaint] : kRefused) {
    std::vector<std::string> words = console;
    words.insert(words.end(), options.begin(), options.end());
    ChildProcess refused(Command(words));
    EXPECT_NE(refused.AwaitExit(), 0) << complaint;
    EXPECT_THAT(refused.errors(), HasSubstr(complaint));
  }
}

}  // namespace
}  // namespace fdi::monitor
