#include "monitor/http/http_server.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <vector>

#include <gmock/gmock.h>
#include <sys/socket.h>

#include "tests/monitor/raw_client.h"

namespace fdi::monitor {
namespace {

using testing::HasSubstr;
using Clock = std::chrono::steady_clock;

// Descriptors of this process that listen.
std::vector<int> Listeners() {
  std::vector<int> found;
  for (int file = 3; file < 256; ++file) {
    int listens = 0;
    socklen_t size = sizeof listens;
    if (getsockopt(file, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size) == 0 &&
        listens != 0) {
      found.push_back(file);
    }
  }
  return found;
}

class HttpServerTest : public testing::Test {
 protected:
  void Start(HttpServerOptions options = HttpServerOptions()) {
    options.address.host = "127.0.0.1";
    server_.emplace(options);
    server_->Add({{"/small", [] { return HttpPage{.body = "small"}; }},
                  {"/large",
                   [] { return HttpPage{.body = std::string(50 << 20, 'x')}; }},
                  {"/held", [this] {
                     std::unique_lock lock(mutex_);
                     ++held_;
                     changed_.notify_all();
                     changed_.wait(lock, [this] { return free_; });
                     return HttpPage{.body = "held"};
                   }}});
    server_->Start();
  }
  ~HttpServerTest() override { Free(); }
  void Free() {
    const std::lock_guard lock(mutex_);
    free_ = true;
    changed_.notify_all();
  }
  void AwaitHeld(int count) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, std::chrono::seconds(10),
                                  [&] { return held_ == count; }));
  }
  int port() const { return server_->address().port; }
  std::uint64_t Count(const char* outcome) const {
    return server_->counts().at(outcome);
  }
  std::string Ask(const std::string& request) const {
    RawClient client(port());
    client.Send(request);
    return client.Read();
  }
  std::string Get(const std::string& path) const {
    return Ask("GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  int held_{0};
  bool free_{false};
  std::optional<HttpServer> server_;
};

// It was waited for ever: at once, if the thread that accepts had ended before
// anybody looked.
TEST(HttpServerStartTest, EndsWhereTheSocketIsGone) {
  for (int round = 0; round < 20; ++round) {
    const std::vector<int> before = Listeners();
    HttpServerOptions options;
    options.address.host = "127.0.0.1";
    HttpServer server(options);
    for (const int file : Listeners()) {
      if (std::find(before.begin(), before.end(), file) == before.end()) {
        shutdown(file, SHUT_RDWR);
      }
    }
    try {
      server.Start();  // Or it has begun to accept just before it ended.
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr("cannot listen: the socket"));
    }
  }
}

TEST_F(HttpServerTest, ClientsThatDripHoldNobodyAndAreEnded) {
  Start();
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < 100; ++i) {
    slow.push_back(std::make_unique<RawClient>(port()));
    slow.back()->Send("GET /small HTT");
  }
  const Clock::time_point begin = Clock::now();

  EXPECT_THAT(Get("/small"), HasSubstr("small"));
  EXPECT_LT(Clock::now() - begin, std::chrono::seconds(1));
  EXPECT_THAT(slow.front()->Read(), HasSubstr("408 Request Timeout"));
  EXPECT_LT(Clock::now() - begin, std::chrono::seconds(4));
  EXPECT_THAT(slow.back()->Read(), HasSubstr("408 Request Timeout"));
  EXPECT_EQ(Count("slow"), 100U);
}

TEST_F(HttpServerTest, ClientsBeyondItsPlacesTakeThoseOfTheOldest) {
  Start();
  std::vector<std::unique_ptr<RawClient>> silent;
  for (int i = 0; i < 300; ++i) {
    silent.push_back(std::make_unique<RawClient>(port()));
  }

  EXPECT_THAT(Get("/small"), HasSubstr("small"));
  EXPECT_EQ(silent.front()->Read(), "");
  EXPECT_GE(Count("busy"), 172U);
}

TEST_F(HttpServerTest, ALaneThatIsFullRefusesAndTheOthersAnswer) {
  HttpServerOptions options;
  options.lanes = {
      {1, 1, [](std::string_view path) { return path == "/held"; }}, {1}};
  Start(options);
  RawClient first(port());
  first.Send("GET /held HTTP/1.1\r\nHost: localhost\r\n\r\n");
  AwaitHeld(1);
  RawClient second(port());
  second.Send("GET /held HTTP/1.1\r\nHost: localhost\r\n\r\n");
  std::string third;
  for (int i = 0; i < 100 && !third.starts_with("HTTP/1.1 503"); ++i) {
    RawClient client(port());  // The first of them may be the one that waits.
    client.Send("GET /held HTTP/1.1\r\nHost: localhost\r\n\r\n");
    third = client.Read();
  }

  EXPECT_THAT(third, HasSubstr("503 Service Unavailable"));
  EXPECT_THAT(third, HasSubstr("Retry-After: 5\r\n"));
  EXPECT_THAT(Get("/small"), HasSubstr("small"));
  Free();
  EXPECT_THAT(first.Read(), HasSubstr("held"));
  EXPECT_THAT(second.Read(), HasSubstr("held"));
}

TEST_F(HttpServerTest, AClientThatDoesNotReadIsCutOff) {
  HttpServerOptions options;
  options.lanes = {{1}};
  Start(options);
  RawClient deaf(port());
  deaf.Send("GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n");
  const Clock::time_point begin = Clock::now();

  EXPECT_THAT(Get("/small"), HasSubstr("small"));
  EXPECT_LT(Clock::now() - begin, std::chrono::seconds(5));
  deaf.Send("x");
  RawClient again(port());
  again.Send("GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n");
  const Clock::time_point stop = Clock::now();
  server_.reset();
  EXPECT_LT(Clock::now() - stop, std::chrono::seconds(2));
}

TEST_F(HttpServerTest, WhatIsRefusedIsSaidAndCounted) {
  Start();
  EXPECT_THAT(Ask("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"),
              HasSubstr("403 Forbidden"));
  EXPECT_THAT(Ask("nonsense\r\n\r\n"), HasSubstr("400 Bad Request"));
  EXPECT_THAT(Ask("POST /small HTTP/1.1\r\nContent-Encoding: br\r\n\r\n"),
              HasSubstr("415 Unsupported"));
  EXPECT_THAT(Ask("POST /small HTTP/1.1\r\nContent-Length: 1\r\n\r\n"),
              HasSubstr("413 Payload Too Large"));
  EXPECT_THAT(Get("/small"), HasSubstr("small"));
  EXPECT_EQ(Count("host"), 1U);
  EXPECT_EQ(Count("malformed"), 1U);
  EXPECT_EQ(Count("encoded"), 1U);
  EXPECT_EQ(Count("too_large"), 1U);
  EXPECT_EQ(Count("answered"), 1U);
}

TEST_F(HttpServerTest, ARefusalReachesAClientThatGoesOnSending) {
  Start();
  RawClient client(port());
  client.Send("POST /small HTTP/1.1\r\nContent-Length: 9999999\r\n\r\n");
  for (int i = 0; i < 100; ++i) {
    client.Send(std::string(10'000, 'x'));
  }

  EXPECT_THAT(client.Read(), HasSubstr("413 Payload Too Large"));
}

}  // namespace
}  // namespace fdi::monitor
