#include "gateway/mqtt_client.h"

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <random>
#include <utility>

#include <CLI/CLI.hpp>
#include <mosquitto.h>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/mutex.h"
#include "base/text.h"

namespace fdi::gateway {
namespace {

// The least that the library accepts: a link that is cut is found out within
// one and a half of it.
constexpr int kKeepAliveS = 5;
constexpr int kLoopMs = 200;
constexpr std::chrono::seconds kLongestPause(60);
// Some seconds of a flood of 10 000 readings a second, but for large payloads.
constexpr std::size_t kQueue = 50'000;
constexpr std::size_t kQueueBytes = 64U << 20U;
// A packet of SUBSCRIBE stays far below the 256 MB of the protocol, and below
// what brokers take by default.
constexpr std::size_t kTopicsAtOnce = 100;

std::string ErrorOf(int code) {
  return code == MOSQ_ERR_ERRNO ? std::strerror(errno)
                                : mosquitto_strerror(code);
}

// The first line, without its end.
std::string PasswordOf(const MqttOptions& options) {
  if (!options.password.empty()) {
    const std::string text = ReadTextFile(options.password);
    return text.substr(0, text.find_first_of("\r\n"));
  }
  const char* const password = std::getenv("FDI_MQTT_PASSWORD");
  return password != nullptr ? password : "";
}

void RequireFile(const std::filesystem::path& path, const char* option) {
  if (!path.empty() && !std::filesystem::exists(path)) {
    throw NotFoundError(std::string(option) + ": there is no " + path.string());
  }
}

const char* OrNull(const std::string& text) {
  return text.empty() ? nullptr : text.c_str();
}

}  // namespace

void MqttOptions::AddTo(CLI::App& verb) {
  verb.add_option("--mqtt", url, "The broker; mqtts is encrypted")
      ->type_name("mqtt[s]://[USER@]HOST[:PORT]");
  verb.add_option("--sparkplug", sparkplug,
                  "Speak Sparkplug B in GROUP instead (docs/connect.md)")
      ->type_name("GROUP")
      ->needs("--mqtt")
      ->check([](const std::string& group) -> std::string {
        return group.empty() || group.find_first_of("/+#") != std::string::npos
                   ? "a group is a name without /, + and #"
                   : "";
      });
  verb.add_option("--password-file", password,
                  "The user's password (default: the variable "
                  "FDI_MQTT_PASSWORD)")
      ->type_name("FILE");
  verb.add_option("--ca", ca,
                  "Certificate of the authority that the broker's is of "
                  "(default: those of the system)")
      ->type_name("FILE");
  verb.add_option("--certificate", certificate, "Certificate of this client")
      ->type_name("FILE");
  verb.add_option("--key", key, "Its key")->type_name("FILE");
}

MqttClient::Address MqttClient::Parse(const std::string& url) {
  const auto refuse = [&](const std::string& why) -> ConfigError {
    return ConfigError("--mqtt " + url + ": " + why +
                       "; expected mqtt://HOST, mqtts://USER@HOST:PORT");
  };
  Address address;
  std::string rest;
  if (url.starts_with("mqtt://")) {
    rest = url.substr(7);
  } else if (url.starts_with("mqtts://")) {
    rest = url.substr(8);
    address.tls = true;
  } else {
    throw refuse("neither mqtt:// nor mqtts://");
  }
  if (const std::size_t at = rest.rfind('@'); at != std::string::npos) {
    address.user = rest.substr(0, at);
    rest.erase(0, at + 1);
    if (address.user.find(':') != std::string::npos) {
      throw ConfigError(
          "--mqtt: a password in the arguments is seen by everybody on this "
          "host; write it to a file for --password-file, or to "
          "FDI_MQTT_PASSWORD");
    }
  }
  while (!rest.empty() && rest.back() == '/') {
    rest.pop_back();
  }
  address.port = address.tls ? 8883 : 1883;
  const std::size_t bracket = rest.rfind(']');  // End of an IPv6 address.
  const std::size_t colon = rest.rfind(':');
  if (colon != std::string::npos &&
      (bracket == std::string::npos || colon > bracket)) {
    const auto port = ParseWhole<int>(rest.substr(colon + 1));
    if (!port || *port < 1 || *port > 65535) {
      throw refuse("the port is none of 1..65535");
    }
    address.port = *port;
    rest.resize(colon);
  }
  if (rest.size() > 2 && rest.front() == '[' && rest.back() == ']') {
    rest = rest.substr(1, rest.size() - 2);
  }
  if (rest.empty() || rest.find('/') != std::string::npos) {
    throw refuse("no host");
  }
  address.host = rest;
  return address;
}

MqttClient::MqttClient(const MqttOptions& options,
                       std::function<Outgoing()> will, LogSink log)
    : address_(Parse(options.url)),
      will_(std::move(will)),
      log_(std::move(log)),
      events_(kQueue) {
  RequireFile(options.ca, "--ca");
  RequireFile(options.certificate, "--certificate");
  RequireFile(options.key, "--key");
  [[maybe_unused]] static const int once = mosquitto_lib_init();
  const std::string id =
      "fdi-gateway-" + std::to_string(std::random_device()());
  library_ = mosquitto_new(id.c_str(), true, this);
  if (library_ == nullptr) {
    throw std::bad_alloc();
  }
  try {
    SetUp(options);
  } catch (...) {
    mosquitto_destroy(library_);
    throw;
  }
}

void MqttClient::SetUp(const MqttOptions& options) {
  const auto check = [](int code, const std::string& what) {
    if (code != MOSQ_ERR_SUCCESS) {
      throw ConfigError(what + ": " + ErrorOf(code));
    }
  };
  // Publish() is called beside the thread that speaks with the broker.
  check(mosquitto_threaded_set(library_, true), "--mqtt");
  if (!address_.user.empty()) {
    const std::string password = PasswordOf(options);
    check(mosquitto_username_pw_set(library_, address_.user.c_str(),
                                    OrNull(password)),
          "--mqtt");
  } else if (!options.password.empty()) {
    throw ConfigError(
        "--password-file: no user; expected --mqtt mqtt://USER@HOST");
  }
  if (address_.tls) {
    check(mosquitto_tls_set(library_, OrNull(options.ca.string()),
                            options.ca.empty() ? "/etc/ssl/certs" : nullptr,
                            OrNull(options.certificate.string()),
                            OrNull(options.key.string()), nullptr),
          "--ca, --certificate, --key");
  } else if (!options.ca.empty() || !options.certificate.empty() ||
             !options.key.empty()) {
    throw ConfigError("--ca, --certificate and --key are of mqtts://");
  }
  mosquitto_connect_callback_set(
      library_, [](mosquitto*, void* self, int code) {
        static_cast<MqttClient*>(self)->OnConnect(code);
      });
  mosquitto_message_callback_set(
      library_, [](mosquitto*, void* self, const mosquitto_message* message) {
        static_cast<MqttClient*>(self)->OnMessage(*message);
      });
  // An error of TLS is but a number otherwise, whatever is wrong with which
  // certificate.
  mosquitto_log_callback_set(
      library_, [](mosquitto*, void* self, int level, const char* text) {
        if (level == MOSQ_LOG_ERR) {
          static_cast<MqttClient*>(self)->refused_ = text;
        }
      });
}

MqttClient::~MqttClient() {
  Stop();
  mosquitto_destroy(library_);
}

void MqttClient::Start() {
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void MqttClient::Stop() {
  if (thread_.joinable()) {
    events_.Close();
    thread_.request_stop();
    thread_.join();
  }
}

// The library has a loop of its own, but that ends for good where a name cannot
// be resolved or a certificate has expired, which may both change.
void MqttClient::Run(const std::stop_token& stop) {
  Mutex mutex;
  std::condition_variable_any stopped;
  std::chrono::seconds pause(1);
  while (!stop.stop_requested()) {
    refused_.clear();
    int code = Connect();
    while (code == MOSQ_ERR_SUCCESS && !stop.stop_requested()) {
      code = mosquitto_loop(library_, kLoopMs, 1);
      pause = connected_ ? std::chrono::seconds(1) : pause;
    }
    if (stop.stop_requested()) {
      break;
    }
    SayLost(refused_.empty() ? ErrorOf(code) : refused_);
    MutexLock lock(mutex);
    stopped.wait_for(lock, stop, pause, [] { return false; });
    pause = std::min(2 * pause, kLongestPause);
  }
  // Sends the last messages, then says good-bye.
  for (int i = 0; connected_ && i < 10; ++i) {
    if (!mosquitto_want_write(library_)) {
      break;
    }
    mosquitto_loop(library_, kLoopMs / 10, 1);
  }
  mosquitto_disconnect(library_);
  mosquitto_loop(library_, kLoopMs, 1);
  connected_ = false;
}

int MqttClient::Connect() {
  if (will_) {
    const Outgoing will = will_();
    mosquitto_will_set(library_, will.topic.c_str(),
                       static_cast<int>(will.payload.size()),
                       will.payload.data(), will.qos, will.retained);
  }
  return mosquitto_connect(library_, address_.host.c_str(), address_.port,
                           kKeepAliveS);
}

void MqttClient::SayLost(const std::string& why) {
  if (connected_.exchange(false)) {
    events_.Push(MqttEvent{MqttEvent::Kind::kLost, {}, {}, false});
  }
  if (std::exchange(said_, why) != why) {
    log_(LogLevel::kWarning,
         EventLine("broker_lost", {{"broker", address_.host},
                                   {"reason", why},
                                   {"effect", "trying again"}}));
  }
}

void MqttClient::OnConnect(int code) {
  if (code != 0) {
    refused_ = mosquitto_connack_string(code);
    return;
  }
  said_.clear();
  refused_.clear();
  ++connections_;
  connected_ = true;
  log_(LogLevel::kInfo,
       EventLine("broker_connected", {{"broker", address_.host}}));
  events_.Push(MqttEvent{MqttEvent::Kind::kConnected, {}, {}, false});
}

void MqttClient::OnMessage(const mosquitto_message& message) {
  MqttEvent event{MqttEvent::Kind::kMessage, message.topic,
                  std::string(static_cast<const char*>(message.payload),
                              static_cast<std::size_t>(message.payloadlen)),
                  message.retain};
  const std::size_t size = event.size();
  if ((waiting_ += size) > kQueueBytes || !events_.TryPush(std::move(event))) {
    waiting_ -= size;
    ++dropped_;
  }
}

void MqttClient::Take(std::vector<MqttEvent>& events,
                      std::chrono::milliseconds timeout) {
  events_.PopAll(events, timeout);
  for (const MqttEvent& event : events) {
    taken_ += event.kind == MqttEvent::Kind::kConnected ? 1U : 0U;
    waiting_ -= event.size();
  }
}

void MqttClient::Subscribe(const std::vector<std::string>& topics) {
  for (std::size_t begin = 0; begin < topics.size(); begin += kTopicsAtOnce) {
    std::vector<char*> chunk;
    const std::size_t end = std::min(begin + kTopicsAtOnce, topics.size());
    for (std::size_t i = begin; i < end; ++i) {
      // The library takes them as writable, and does not write.
      chunk.push_back(const_cast<char*>(topics[i].c_str()));
    }
    mosquitto_subscribe_multiple(library_, nullptr,
                                 static_cast<int>(chunk.size()), chunk.data(),
                                 0, 0, nullptr);
  }
}

void MqttClient::Unsubscribe(const std::vector<std::string>& topics) {
  for (const std::string& topic : topics) {
    mosquitto_unsubscribe(library_, nullptr, topic.c_str());
  }
}

bool MqttClient::Publish(const Outgoing& message) {
  return connected() &&
         mosquitto_publish(library_, nullptr, message.topic.c_str(),
                           static_cast<int>(message.payload.size()),
                           message.payload.data(), message.qos,
                           message.retained) == MOSQ_ERR_SUCCESS;
}

}  // namespace fdi::gateway
