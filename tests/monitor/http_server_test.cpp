#include "monitor/http/http_server.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <vector>

#include <gmock/gmock.h>
#include <sys/socket.h>

#include "base/error.h"
#include "tests/monitor/raw_client.h"
#include "tests/storage/message_of.h"

namespace fdi::monitor {
namespace {

using storage::MessageOf;
using testing::HasSubstr;

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

TEST(HttpAddressTest, OnlyLoopbackIsServed) {
  for (const char* text :
       {"9464", "127.0.0.1:1", "127.0.0.2:1", "localhost:1", "[::1]:1"}) {
    ParseHttpAddress(text, "--http");
  }
  for (const char* text : {"0.0.0.0:9464", "10.1.2.3:9464", "[::]:9464",
                           "plant.example:80", "127.0.0.1.example.com:80"}) {
    EXPECT_THAT(
        MessageOf<ConfigError>([&] { ParseHttpAddress(text, "--http"); }),
        HasSubstr(std::string("--http ") + text +
                  ": expected 127.0.0.1, ::1 or localhost; other hosts "
                  "come through nginx (docs/console.md"));
  }
}

TEST(HttpAddressTest, ForeignNamesAreNotLoopback) {
  for (const char* host :
       {"localhost", "localhost:9000", "127.0.0.1:1", "[::1]:80", "[::1]"}) {
    EXPECT_TRUE(IsLoopback(host)) << host;
  }
  for (const char* host : {"", "evil.example", "localhost.evil.example:80",
                           "127.0.0.1.evil.example", "10.1.2.3", "[::2]:80"}) {
    EXPECT_FALSE(IsLoopback(host)) << host;
  }
}

class HttpServerTest : public testing::Test {
 protected:
  void SetUp() override {
    HttpServerOptions options;
    options.address.host = "127.0.0.1";
    options.threads = 2;
    server_.emplace(options);
    server_->Add({{"/small", [] { return HttpPage{.body = "small"}; }},
                  {"/large", [] {
                     return HttpPage{.body = std::string(50 << 20, 'x')};
                   }}});
    server_->Start();
  }
  int port() const { return server_->address().port; }
  std::string Ask(const std::string& request) const {
    RawClient client(port());
    client.Send(request);
    return client.Read();
  }

  std::optional<HttpServer> server_;
};

TEST_F(HttpServerTest, AnswersItsOwnNamesAlone) {
  EXPECT_THAT(Ask("GET /small HTTP/1.1\r\nHost: localhost\r\n\r\n"),
              HasSubstr("small"));
  EXPECT_THAT(Ask("GET /small HTTP/1.1\r\nHost: evil.example\r\n\r\n"),
              HasSubstr("403 Forbidden"));
  EXPECT_THAT(Ask("GET /small HTTP/1.1\r\n\r\n"), HasSubstr("403 "));
}

TEST_F(HttpServerTest, NothingIsCompressedOrRepeated) {
  const std::string answer =
      Ask("GET /small HTTP/1.1\r\nHost: localhost\r\n"
          "Accept-Encoding: br, gzip\r\nRange: bytes=0-,0-,0-\r\n\r\n");
  EXPECT_THAT(answer, HasSubstr("200 OK"));
  EXPECT_TRUE(answer.ends_with("\r\n\r\nsmall")) << answer;
}

// Two silent ones and a deaf one for two threads: each is given up.
TEST_F(HttpServerTest, ClientsThatDoNothingAreGivenUp) {
  RawClient silent(port());
  RawClient another(port());
  RawClient deaf(port());
  deaf.Send("GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_THAT(Ask("GET /small HTTP/1.1\r\nHost: localhost\r\n\r\n"),
              HasSubstr("small"));
  RawClient again(port());
  again.Send("GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n");
  const auto stop = std::chrono::steady_clock::now();
  server_.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - stop, std::chrono::seconds(10));
}

}  // namespace
}  // namespace fdi::monitor
