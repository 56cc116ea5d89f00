#include <algorithm>
#include <mutex>
#include <utility>

#include <CLI/CLI.hpp>
#include <httplib.h>

#include "diagnosis/error.h"
#include "monitor/app/event_delivery.h"

namespace fdi::monitor {
namespace {

constexpr std::string_view kScheme = "http://";

[[noreturn]] void Refuse(const std::string& target, const std::string& why) {
  throw ConfigError("--on-event '" + target + "': " + why +
                    "; accepted are a command with its arguments and "
                    "http://HOST[:PORT][/PATH]");
}

class UrlDelivery : public EventDelivery {
 public:
  UrlDelivery(std::string server, std::string path,
              std::chrono::milliseconds limit)
      : server_(std::move(server)), path_(std::move(path)), limit_(limit) {}

  std::optional<std::string> Deliver(const std::string& json) override {
    httplib::Client client(server_);
    client.set_connection_timeout(limit_);
    client.set_read_timeout(limit_);
    client.set_write_timeout(limit_);
    {
      const std::lock_guard lock(mutex_);
      if (stopped_) {
        return "the monitor stops";
      }
      clients_.push_back(&client);
    }
    const httplib::Result answer = client.Post(path_, json, "application/json");
    {
      const std::lock_guard lock(mutex_);
      std::erase(clients_, &client);
    }
    if (!answer) {
      return httplib::to_string(answer.error());
    }
    return answer->status / 100 == 2
               ? std::nullopt
               : std::optional("HTTP status " + std::to_string(answer->status));
  }

  void Interrupt() override {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    for (httplib::Client* client : clients_) {
      client->stop();
    }
  }

 private:
  std::string server_;  // http://HOST[:PORT]
  std::string path_;
  std::chrono::milliseconds limit_;
  std::mutex mutex_;
  bool stopped_{false};
  std::vector<httplib::Client*> clients_;
};

}  // namespace

std::unique_ptr<EventDelivery> DeliverToUrl(const std::string& url,
                                            std::chrono::milliseconds limit) {
  const std::size_t slash = std::min(url.find('/', kScheme.size()), url.size());
  if (!url.starts_with(kScheme) || slash == kScheme.size()) {
    Refuse(url, "no host");
  }
  const std::string path = url.substr(slash);
  const std::string server = url.substr(0, slash);
  if (!httplib::Client(server).is_valid()) {
    Refuse(url, "no host and port");
  }
  return std::make_unique<UrlDelivery>(server, path.empty() ? "/" : path,
                                       limit);
}

std::unique_ptr<EventDelivery> MakeEventDelivery(
    const std::string& target, std::chrono::milliseconds limit) {
  if (target.starts_with(kScheme)) {
    return DeliverToUrl(target, limit);
  }
  if (target.find("://") != std::string::npos &&
      target.find("://") < target.find(' ')) {
    Refuse(target, "only http is spoken");
  }
  std::vector<std::string> words = CLI::detail::split_up(target);
  if (words.empty()) {
    Refuse(target, "nothing to run");
  }
  for (std::string& word : words) {
    CLI::detail::remove_quotes(word);
  }
  return DeliverToProgram(std::move(words), limit);
}

}  // namespace fdi::monitor
