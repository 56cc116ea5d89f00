// Payloads, URLs and connections of a broker.
#include "gateway/mqtt_source.h"

#include <array>
#include <semaphore>
#include <thread>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/error.h"
#include "base/time_units.h"

namespace fdi::gateway {
namespace {

using importer::Said;
using ::testing::HasSubstr;

class PayloadTest : public ::testing::Test {
 protected:
  Said Read(const std::string& payload) {
    payload_ = payload;
    return ReadPayload(topic_, payload_, stamps_, word_);
  }
  LiveTopic topic_{"plant/A/x", "A.ZT", "", ""};
  importer::StampReader stamps_;
  std::string payload_;
  std::string word_;
};

TEST_F(PayloadTest, ANumberOrAWord) {
  EXPECT_EQ(Read(" 41.5\n").reading.value, 41.5);
  EXPECT_EQ(Read("41.5").reading.tag, "A.ZT");
  EXPECT_EQ(Read("MAN").reading.word, "MAN");
  EXPECT_EQ(Read("Bad").reading.quality, SignalQuality::kBad);
  EXPECT_EQ(Read("").reading.quality, SignalQuality::kBad);
}

TEST_F(PayloadTest, AnObjectHasValueTimeAndQuality) {
  const Said said =
      Read(R"({"value": 41.5, "ts": 1767607200000, "quality": "uncertain"})");
  ASSERT_EQ(said.kind, Said::Kind::kReading);
  EXPECT_EQ(said.reading.value, 41.5);
  EXPECT_EQ(said.reading.stamp_ns, 1'767'607'200 * kNsPerSecond);
  EXPECT_EQ(said.reading.quality, SignalQuality::kUncertain);
}

TEST_F(PayloadTest, KeysAreThoseOfTheRow) {
  topic_.value_key = "position";
  topic_.time_key = "at";
  const Said said =
      Read(R"({"position": 3, "value": 9, "at": "2026-01-05T10:00:00Z"})");
  EXPECT_EQ(said.reading.value, 3.0);
  EXPECT_EQ(said.reading.stamp_ns, 1'767'607'200 * kNsPerSecond);
  // A payload of several signals need not have all of them.
  EXPECT_EQ(Read(R"({"command": 3})").kind, Said::Kind::kNothing);
}

TEST_F(PayloadTest, OtherTextIsRefusedWithTheReason) {
  EXPECT_THAT(Read("{41}").why, HasSubstr("not a JSON object"));
  EXPECT_THAT(Read(R"({"speed": 1})").why, HasSubstr("no key \"value\""));
  EXPECT_THAT(Read(R"({"value": 1, "t": "noon"})").why, HasSubstr("time"));
  EXPECT_EQ(Read(std::string(70'000, '1')).kind, Said::Kind::kWrong);
}

TEST(MqttUrl, IsThatOfABrokerWithoutASecret) {
  const auto error = [](const std::string& url) -> std::string {
    try {
      MqttClient client({.url = url}, {}, {});
      return "";
    } catch (const ConfigError& refused) {
      return refused.what();
    }
  };
  EXPECT_EQ(error("mqtt://127.0.0.1"), "");
  EXPECT_EQ(error("mqtts://fdi@[::1]:8884/"), "");
  EXPECT_THAT(error("http://127.0.0.1"), HasSubstr("mqtt://HOST"));
  EXPECT_THAT(error("mqtt://"), HasSubstr("no host"));
  EXPECT_THAT(error("mqtt://a:70000"), HasSubstr("1..65535"));
  EXPECT_THAT(error("mqtt://fdi:secret@a"), HasSubstr("--password-file"));
  EXPECT_THAT(error("mqtt://fdi:secret@a"),
              ::testing::Not(HasSubstr("secret@")));
}

TEST(MqttOptions, WhatTheUrlHasNoUseForIsRefused) {
  const auto error = [](const MqttOptions& options) -> std::string {
    try {
      MqttClient client(options, {}, {});
      return "";
    } catch (const ConfigError& refused) {
      return refused.what();
    }
  };
  const std::string file = FDI_FAULT_CATALOGUE;
  EXPECT_THAT(error({.url = "mqtt://a", .password = file}),
              HasSubstr("mqtt://USER@HOST"));
  EXPECT_THAT(error({.url = "mqtt://a", .key = file}),
              HasSubstr("are of mqtts://"));
}

// A broker that accepts connections, and says nothing else.
class Broker {
 public:
  Broker() {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    auto* const any = reinterpret_cast<sockaddr*>(&address);
    EXPECT_EQ(bind(listener_, any, size), 0);
    EXPECT_EQ(listen(listener_, 1), 0);
    EXPECT_EQ(getsockname(listener_, any, &size), 0);
    port_ = ntohs(address.sin_port);
  }
  ~Broker() {
    Drop();
    close(listener_);
  }
  Broker(const Broker&) = delete;
  Broker& operator=(const Broker&) = delete;
  void Accept() {
    client_ = accept(listener_, nullptr, nullptr);
    std::array<char, 256> connect{};
    EXPECT_GT(recv(client_, connect.data(), connect.size(), 0), 0);
    constexpr std::array<char, 4> kConnack{0x20, 2, 0, 0};
    EXPECT_EQ(send(client_, kConnack.data(), kConnack.size(), 0), 4);
  }
  void Publish(std::size_t size) {  // Of 16 KiB to 2 MiB, with topic "t".
    const std::size_t rest = size + 3;
    std::string packet{0x30,
                       static_cast<char>(rest | 0x80U),
                       static_cast<char>((rest >> 7U) | 0x80U),
                       static_cast<char>(rest >> 14U),
                       0,
                       1,
                       't'};
    packet.append(size, 'x');
    EXPECT_EQ(send(client_, packet.data(), packet.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(packet.size()));
  }
  void Drop() { close(std::exchange(client_, -1)); }
  std::string url() const {
    return "mqtt://127.0.0.1:" + std::to_string(port_);
  }

 private:
  int listener_{socket(AF_INET, SOCK_STREAM, 0)};
  int client_{-1};
  int port_{0};
};

// A birth has to be the first message on each connection.
TEST(MqttClient, NothingIsPublishedOnAConnectionBeforeItIsTaken) {
  Broker broker;
  MqttOptions options;
  options.url = broker.url();
  std::counting_semaphore<> said(0);  // A line at each connection and loss.
  MqttClient client(options, {},
                    [&](LogLevel, std::string_view) { said.release(); });
  client.Start();
  const Outgoing message{"t", "x", false, 0};
  std::vector<MqttEvent> events;
  broker.Accept();
  said.acquire();
  EXPECT_FALSE(client.connected());
  EXPECT_FALSE(client.Publish(message));
  client.Take(events, std::chrono::seconds(60));
  ASSERT_EQ(events.size(), 1U);
  EXPECT_TRUE(client.connected());
  EXPECT_TRUE(client.Publish(message));
  broker.Drop();
  said.acquire();
  broker.Accept();
  said.acquire();
  EXPECT_FALSE(client.connected());
  EXPECT_FALSE(client.Publish(message));
}

TEST(MqttClient, LargePayloadsFillNoMemory) {
  Broker broker;
  MqttOptions options;
  options.url = broker.url();
  MqttClient client(options, {}, [](LogLevel, std::string_view) {});
  client.Start();
  broker.Accept();
  for (int i = 0; i < 70; ++i) {
    broker.Publish((1U << 20U) - 1);
  }
  std::vector<MqttEvent> events;
  for (int i = 0; i < 600 && client.dropped() < 6; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(client.dropped(), 6U);
  client.Take(events, std::chrono::seconds(60));
  EXPECT_EQ(events.size(), 65U);  // The first is the connection.
  broker.Publish(1U << 20U);
  client.Take(events, std::chrono::seconds(60));
  EXPECT_EQ(events.size(), 1U);
}

}  // namespace
}  // namespace fdi::gateway
