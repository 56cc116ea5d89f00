#include <thread>

#include <gtest/gtest.h>

#include "monitor/console/stream_hub.h"

namespace fdi::console {
namespace {

using std::chrono::milliseconds;
using Outcome = StreamClient::Outcome;

StreamClient::Message Text(const std::string& text) {
  return std::make_shared<const std::string>(text);
}

TEST(ConsoleStreamTest, AnEventIsOneBlockOfText) {
  EXPECT_EQ(*StreamEvent("tiles", R"({"a":1})"),
            "event: tiles\ndata: {\"a\":1}\n\n");
}

TEST(ConsoleStreamTest, AClientGetsHelloAndThenAllInOrder) {
  StreamHub hub;
  const auto client = hub.Admit({"V1", 0}, Text("hello"));
  hub.Broadcast(Text("one"));
  hub.Send(*client, Text("two"));

  StreamClient::Message message;
  for (const char* expected : {"hello", "one", "two"}) {
    ASSERT_EQ(client->Next(milliseconds(0), message), Outcome::kMessage);
    EXPECT_EQ(*message, expected);
  }
  EXPECT_EQ(client->Next(milliseconds(0), message), Outcome::kTimeout);
}

TEST(ConsoleStreamTest, AClientThatDoesNotReadIsDroppedAndCounted) {
  StreamHub hub({2, 1000});
  const auto slow = hub.Admit({}, Text("hello"));
  const auto quick = hub.Admit({}, Text("hello"));
  StreamClient::Message message;
  for (int i = 0; i < 100; ++i) {
    hub.Broadcast(Text(std::string(100, 'x')));
    while (quick->Next(milliseconds(0), message) == Outcome::kMessage) {
    }
  }

  EXPECT_EQ(slow->Next(milliseconds(0), message), Outcome::kEnded);
  EXPECT_EQ(quick->Next(milliseconds(0), message), Outcome::kTimeout);
  EXPECT_EQ(hub.counts().dropped, 1U);
  hub.Release(slow);
  EXPECT_EQ(hub.counts().clients, 1U);
}

TEST(ConsoleStreamTest, OneMessageMayBeLargerThanTheQueue) {
  StreamHub hub({1, 10});
  const auto client = hub.Admit({}, Text(std::string(1000, 'x')));
  StreamClient::Message message;

  EXPECT_EQ(client->Next(milliseconds(0), message), Outcome::kMessage);
  EXPECT_EQ(hub.counts().dropped, 0U);
}

TEST(ConsoleStreamTest, PlacesAreBoundedAndComeFree) {
  StreamHub hub;
  std::vector<std::shared_ptr<StreamClient>> clients;
  for (int i = 0; i < 16; ++i) {
    clients.push_back(hub.Admit({}, Text("hello")));
    ASSERT_NE(clients.back(), nullptr);
  }

  EXPECT_EQ(hub.Admit({}, Text("hello")), nullptr);
  hub.Release(clients.front());
  EXPECT_NE(hub.Admit({}, Text("hello")), nullptr);
  EXPECT_EQ(hub.counts().admitted, 17U);
  EXPECT_EQ(hub.counts().refused, 1U);
}

TEST(ConsoleStreamTest, ClosingEndsThoseWhoWaitAndAdmitsNone) {
  StreamHub hub;
  const auto client = hub.Admit({}, Text("hello"));
  StreamClient::Message message;
  client->Next(milliseconds(0), message);
  Outcome outcome = Outcome::kMessage;
  std::thread waiting(
      [&] { outcome = client->Next(milliseconds(20'000), message); });
  hub.Close();
  waiting.join();

  EXPECT_EQ(outcome, Outcome::kEnded);
  EXPECT_EQ(hub.Admit({}, Text("hello")), nullptr);
}

}  // namespace
}  // namespace fdi::console
