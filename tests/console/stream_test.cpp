#include <thread>

#include <gtest/gtest.h>

#include "console/live_stream.h"

namespace fdi::console {
namespace {

using std::chrono::milliseconds;
using Outcome = LiveStream::Outcome;

Message Text(const std::string& text) {
  return std::make_shared<const std::string>(text);
}

TEST(ConsoleStreamTest, AnEventIsOneBlockOfText) {
  EXPECT_EQ(*StreamEvent("tiles", R"({"a":1})"),
            "event: tiles\ndata: {\"a\":1}\n\n");
}

TEST(ConsoleStreamTest, AClientGetsHelloAndThenAllInOrder) {
  LiveStream stream;
  const auto client = stream.Admit("V1", 0, Text("hello"));
  stream.Broadcast(Text("one"));
  stream.Broadcast(Text("two"));

  Message message;
  for (const char* expected : {"hello", "one", "two"}) {
    ASSERT_EQ(stream.Next(*client, milliseconds(0), message),
              Outcome::kMessage);
    EXPECT_EQ(*message, expected);
  }
  EXPECT_EQ(stream.Next(*client, milliseconds(0), message), Outcome::kTimeout);
}

TEST(ConsoleStreamTest, AClientThatDoesNotReadIsDroppedAndCounted) {
  LiveStream stream({2, 1000});
  const auto slow = stream.Admit("", 0, Text("hello"));
  const auto quick = stream.Admit("", 0, Text("hello"));
  Message message;
  for (int i = 0; i < 100; ++i) {
    stream.Broadcast(Text(std::string(100, 'x')));
    while (stream.Next(*quick, milliseconds(0), message) == Outcome::kMessage) {
    }
  }

  EXPECT_EQ(stream.Next(*slow, milliseconds(0), message), Outcome::kEnded);
  EXPECT_EQ(stream.Next(*quick, milliseconds(0), message), Outcome::kTimeout);
  EXPECT_EQ(stream.counts().dropped, 1U);
  stream.Release(slow);
  EXPECT_EQ(stream.counts().clients, 1U);
}

TEST(ConsoleStreamTest, OneMessageMayBeLargerThanTheQueue) {
  LiveStream stream({1, 10});
  const auto client = stream.Admit("", 0, Text(std::string(1000, 'x')));
  Message message;

  EXPECT_EQ(stream.Next(*client, milliseconds(0), message), Outcome::kMessage);
  EXPECT_EQ(stream.counts().dropped, 0U);
}

TEST(ConsoleStreamTest, PlacesAreBoundedAndComeFree) {
  LiveStream stream;
  std::vector<std::shared_ptr<LiveStream::Client>> clients;
  for (int i = 0; i < 16; ++i) {
    clients.push_back(stream.Admit("", 0, Text("hello")));
    ASSERT_NE(clients.back(), nullptr);
  }

  EXPECT_EQ(stream.Admit("", 0, Text("hello")), nullptr);
  stream.Release(clients.front());
  EXPECT_NE(stream.Admit("", 0, Text("hello")), nullptr);
  EXPECT_EQ(stream.counts().admitted, 17U);
  EXPECT_EQ(stream.counts().refused, 1U);
}

TEST(ConsoleStreamTest, ClosingEndsThoseWhoWaitAndAdmitsNone) {
  LiveStream stream;
  const auto client = stream.Admit("", 0, Text("hello"));
  Message message;
  stream.Next(*client, milliseconds(0), message);
  Outcome outcome = Outcome::kMessage;
  std::thread waiting(
      [&] { outcome = stream.Next(*client, milliseconds(20'000), message); });
  stream.Close();
  waiting.join();

  EXPECT_EQ(outcome, Outcome::kEnded);
  EXPECT_EQ(stream.Admit("", 0, Text("hello")), nullptr);
}

}  // namespace
}  // namespace fdi::console
