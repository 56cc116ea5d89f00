#include "monitor/http/request_head.h"

#include <array>

#include <gmock/gmock.h>
#include <unistd.h>

namespace fdi::monitor {
namespace {

using testing::HasSubstr;

constexpr std::size_t kBody = 100;

// 200: good; 0: not whole yet.
int StatusOf(const std::string& bytes) {
  std::optional<RequestHead> head;
  const auto refusal = ParseRequestHead(bytes, kBody, head);
  return refusal ? refusal->status : head ? 200 : 0;
}

int StatusWith(const std::string& headers) {
  return StatusOf("POST / HTTP/1.1\r\n" + headers + "\r\n\r\n");
}

TEST(RequestHeadTest, PassesOnOnlyWhatPagesRead) {
  std::optional<RequestHead> head;
  const std::string bytes =
      "GET /api/v1/stream?valve=V1 HTTP/1.1\r\nhOST:  localhost:8080 \r\n"
      "Range: bytes=0-,0-,0-\r\nExpect: 100-continue\r\n"
      "REMOTE_ADDR: 10.0.0.1\r\nX-User: anna\r\n"
      "Cookie: a=b\r\nOrigin: null\r\n"
      "Content-Type: multipart/form-data; boundary=x\r\n"
      "Accept-Encoding: gzip, deflate, br\r\nContent-Length: 4\r\n"
      "Authorization: Bearer abc\r\n"
      "X-Forwarded-Proto: https\r\n\r\n";
  ASSERT_FALSE(ParseRequestHead(bytes + "body", kBody, head));

  ASSERT_TRUE(head);
  EXPECT_EQ(head->path, "/api/v1/stream");
  EXPECT_EQ(head->host, "localhost:8080");
  EXPECT_EQ(head->size, bytes.size());
  EXPECT_EQ(head->body_size, 4U);
  EXPECT_EQ(head->text,
            "GET /api/v1/stream?valve=V1 HTTP/1.1\r\nHost: localhost:8080\r\n"
            "Cookie: a=b\r\nOrigin: null\r\n"
            "Accept-Encoding: gzip\r\nContent-Length: 4\r\n"
            "X-Forwarded-Proto: https\r\n\r\n");
}

TEST(RequestHeadTest, TheHeaderOfAProxyIsPassedOnIfItIsThereOnce) {
  std::optional<RequestHead> head;
  const std::string bytes = "GET / HTTP/1.1\r\nx-USER: anna\r\n";
  ASSERT_FALSE(ParseRequestHead(bytes + "\r\n", kBody, head, "X-User"));
  EXPECT_THAT(head->text, HasSubstr("\r\nX-User: anna\r\n"));
  head.reset();

  const auto twice =
      ParseRequestHead(bytes + "X-User: root\r\n\r\n", kBody, head, "X-User");

  ASSERT_TRUE(twice);
  EXPECT_EQ(twice->status, 400);
  EXPECT_TRUE(
      ParseRequestHead("GET / HTTP/1.1\r\nx-user:\r\nX-User: root\r\n\r\n",
                       kBody, head, "X-User"));
}

TEST(RequestHeadTest, APathHasOneForm) {
  std::optional<RequestHead> head;
  ASSERT_FALSE(ParseRequestHead(
      "GET /api/v1/strea%6d/%c3%a9%20?x=%61#y HTTP/1.1\r\n\r\n", kBody, head));
  EXPECT_EQ(head->path, "/api/v1/stream/\u00e9 ");
  EXPECT_EQ(head->text, "GET /api/v1/stream/%C3%A9%20?x=%61 HTTP/1.1\r\n\r\n");
  for (const char* path : {"/%u0061", "/%", "/%4", "/%0a", "/%00", "/%-1"}) {
    EXPECT_EQ(StatusOf(std::string("GET ") + path + " HTTP/1.1\r\n\r\n"), 400)
        << path;
  }
}

TEST(RequestHeadTest, NoLineHeaderOrBodyIsLongerThanTheLimits) {
  EXPECT_EQ(StatusOf(std::string(4097, 'G')), 414);
  EXPECT_EQ(StatusOf("GET /" + std::string(5000, 'a') + " HTTP/1.1\r\n"), 414);
  EXPECT_EQ(StatusWith("X: " + std::string(16384, 'a')), 431);
  EXPECT_EQ(StatusOf("GET / HTTP/1.1\r\nX: " + std::string(16384, 'a')), 431);
  std::string many;
  for (int i = 0; i < 101; ++i) {
    many += "X: y\r\n";
  }
  EXPECT_EQ(StatusWith(many), 431);
  EXPECT_EQ(StatusWith("Content-Length: 100"), 200);
  EXPECT_EQ(StatusWith("Content-Length: 101"), 413);
  EXPECT_EQ(StatusWith("Content-Length: 99999999999999999999999"), 413);
}

TEST(RequestHeadTest, ABodyComesPlainAndWithItsLength) {
  EXPECT_EQ(StatusWith("Content-Encoding: br"), 415);
  EXPECT_EQ(StatusWith("Content-Encoding: identity"), 200);
  EXPECT_EQ(StatusWith("Transfer-Encoding: chunked"), 411);
  EXPECT_EQ(StatusWith("Content-Length: 1\r\nContent-Length: 1"), 400);
  for (const char* length : {"-1", "1a", "", "0x10", "1, 1"}) {
    EXPECT_EQ(StatusWith(std::string("Content-Length: ") + length), 400)
        << length;
  }
}

TEST(RequestHeadTest, WhatIsNotHttpIsRefused) {
  for (const char* line :
       {"", "GET", "GET /", "GET / HTTP/2.0", "GET  / HTTP/1.1",
        "GET x HTTP/1.1", "GET http://a/ HTTP/1.1", "GET /\x1b HTTP/1.1"}) {
    EXPECT_EQ(StatusOf(std::string(line) + "\r\nHost: a\r\n\r\n"), 400) << line;
  }
  EXPECT_EQ(StatusOf("DELETE / HTTP/1.1\r\n\r\n"), 405);
  for (const char* header :
       {"no colon", ": a", "a b: c", " a: folded", "a: \x01",
        "Host: a\r\nHost: b", "Host:\r\nHost: b"}) {
    EXPECT_EQ(StatusWith(header), 400) << header;
  }
  EXPECT_EQ(StatusOf("GET / HTTP/1.1\r\nHost: a\r\n"), 0);
}

TEST(HostRuleTest, ANameThatIsNotOursMayNotAskALoopbackAddress) {
  for (const char* own : {"localhost", "localhost:8080", "LOCALHOST:9000",
                          "127.0.0.1:8080", "[::1]:8080", "[::1]"}) {
    EXPECT_TRUE(HostAllowed(own, "127.0.0.1")) << own;
  }
  EXPECT_TRUE(HostAllowed("127.0.0.7:80", "127.0.0.7"));
  for (const char* other :
       {"", "evil.example", "evil.example:8080", "127.0.0.1.evil.example",
        "localhost.evil.example:8080", "[fe80::1]:8080", "127.0.0.7"}) {
    EXPECT_FALSE(HostAllowed(other, "127.0.0.1")) << other;
  }
  EXPECT_FALSE(IsLoopback("127.evil.example"));
}

TEST(HostRuleTest, OffLoopbackAddressesAndOwnNamesMayAsk) {
  std::array<char, 256> machine{};
  gethostname(machine.data(), machine.size() - 1);
  const std::vector<std::string> names{"Monitor.plant"};
  for (const std::string bound : {"0.0.0.0", "192.168.1.5", "::"}) {
    for (const std::string& own :
         {std::string("192.168.1.5:8080"), std::string("[fe80::1]:8080"),
          std::string("localhost"), std::string(machine.data()) + ":8080",
          std::string("monitor.plant:8080")}) {
      EXPECT_TRUE(HostAllowed(own, bound, names)) << own;
    }
    for (const char* other : {"", "evil.example:8080", "1.2.3.4.evil.example",
                              "monitor.plant.evil.example"}) {
      EXPECT_FALSE(HostAllowed(other, bound, names)) << other;
    }
    EXPECT_FALSE(HostAllowed("monitor.plant:8080", bound));
  }
}

}  // namespace
}  // namespace fdi::monitor
