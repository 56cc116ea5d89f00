#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "base/bounded_queue.h"
#include "base/log.h"

struct mosquitto;
struct mosquitto_message;

namespace CLI {
class App;
}

namespace fdi::gateway {

/// The address of a broker and the keys to it. Secrets come by files or by the
/// environment, because everybody can see the arguments of a program.
struct MqttOptions {
  std::string url{};           ///< mqtt[s]://[USER@]HOST[:PORT]
  std::filesystem::path ca{};  ///< PEM; empty: the authorities of the system.
  std::filesystem::path certificate{};  ///< For this client, with its key.
  std::filesystem::path key{};
  std::filesystem::path password{};  ///< A file; empty: FDI_MQTT_PASSWORD.
  std::string sparkplug{};           ///< A group; empty: topics of our own.

  /// Adds --mqtt, --sparkplug, --ca, --certificate, --key and --password-file.
  void AddTo(CLI::App& verb);
};

/// An outgoing MQTT message.
struct Outgoing {
  std::string topic;
  std::string payload;
  bool retained{true};
  int qos{1};
};

/// An event of the connection, in order of arrival.
struct MqttEvent {
  enum class Kind : std::uint8_t { kConnected, kLost, kMessage };
  Kind kind{Kind::kMessage};
  std::string topic;
  std::string payload;
  bool retained{false};
  std::size_t size() const { return topic.size() + payload.size(); }
};

/// A connection to a broker that is made again whenever it is lost, after 1, 2,
/// 4 ... 60 s. A thread of its own speaks with the broker; messages wait in
/// a queue of at most 50 000 and 64 MiB, and are dropped and counted beyond it.
class MqttClient {
 public:
  /// @param will makes the message that the broker publishes when this client
  ///   is gone. The thread of the client calls it before each connection;
  ///   empty: none.
  /// @throws ConfigError for an URL, a file of keys or a password that cannot
  ///   be used; NotFoundError.
  MqttClient(const MqttOptions& options, std::function<Outgoing()> will,
             LogSink log);
  ~MqttClient();
  MqttClient(const MqttClient&) = delete;
  MqttClient& operator=(const MqttClient&) = delete;

  void Start();
  /// Says good-bye, so that the broker does not publish the will.
  void Stop();

  /// Takes the events so far, oldest first, after waiting up to `timeout`.
  void Take(std::vector<MqttEvent>& events, std::chrono::milliseconds timeout);
  /// Subscribes with QoS 0; call it at each kConnected.
  void Subscribe(const std::vector<std::string>& topics);
  void Unsubscribe(const std::vector<std::string>& topics);
  /// @returns false if the message does not fit, or if there is no connection
  ///   whose kConnected was taken: it is not kept for later. Call it, as
  ///   connected(), by the thread that takes.
  bool Publish(const Outgoing& message);

  bool connected() const { return connected_ && taken_ == connections_; }
  std::uint64_t dropped() const { return dropped_; }

 private:
  struct Address {
    bool tls{false};
    std::string user;
    std::string host;
    int port{0};
  };
  static Address Parse(const std::string& url);
  void SetUp(const MqttOptions& options);
  int Connect();
  void Run(const std::stop_token& stop);
  void OnConnect(int code);
  void OnMessage(const mosquitto_message& message);
  void SayLost(const std::string& why);

  Address address_;
  std::function<Outgoing()> will_;
  LogSink log_;
  mosquitto* library_{nullptr};
  BoundedQueue<MqttEvent> events_;
  std::atomic<bool> connected_{false};
  std::atomic<std::uint64_t> connections_{0};
  std::uint64_t taken_{0};  // Connections; of the thread that takes.
  std::atomic<std::uint64_t> dropped_{0};
  std::atomic<std::size_t> waiting_{0};  // Bytes in the queue.
  std::string refused_;  // Why the broker refused; of the thread.
  std::string said_;     // Last line logged; of the thread.
  std::jthread thread_;
};

}  // namespace fdi::gateway
