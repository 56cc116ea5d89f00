#include "monitor/console/stream_hub.h"

#include <utility>

namespace fdi::console {

std::shared_ptr<const std::string> StreamEvent(const std::string& name,
                                               const std::string& data) {
  std::string text = "event: ";
  text.append(name).append("\ndata: ").append(data).append("\n\n");
  return std::make_shared<const std::string>(std::move(text));
}

bool StreamClient::Push(const Message& message) {
  const std::lock_guard lock(mutex_);
  if (ended_) {
    return true;  // On its way out.
  }
  if (!queue_.empty() && bytes_ + message->size() > max_bytes_) {
    ended_ = true;
    queue_.clear();
    changed_.notify_all();
    return false;
  }
  bytes_ += message->size();
  queue_.push_back(message);
  changed_.notify_all();
  return true;
}

StreamClient::Outcome StreamClient::Next(std::chrono::milliseconds timeout,
                                         Message& message) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout,
                    [this] { return ended_ || !queue_.empty(); });
  if (ended_) {
    return Outcome::kEnded;
  }
  if (queue_.empty()) {
    return Outcome::kTimeout;
  }
  message = std::move(queue_.front());
  queue_.pop_front();
  bytes_ -= message->size();
  return Outcome::kMessage;
}

void StreamClient::End() {
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

std::shared_ptr<StreamClient> StreamHub::Admit(
    StreamClient::Wish wish, const StreamClient::Message& hello) {
  const std::lock_guard lock(mutex_);
  if (closed_ || clients_.size() >= options_.max_clients) {
    ++counts_.refused;
    return nullptr;
  }
  auto client =
      std::make_shared<StreamClient>(std::move(wish), options_.max_bytes);
  client->Push(hello);
  clients_.push_back(client);
  ++counts_.admitted;
  return client;
}

void StreamHub::Release(const std::shared_ptr<StreamClient>& client) {
  const std::lock_guard lock(mutex_);
  std::erase(clients_, client);
}

void StreamHub::Broadcast(const StreamClient::Message& message) {
  for (const auto& client : clients()) {
    Send(*client, message);
  }
}

void StreamHub::Send(StreamClient& client,
                     const StreamClient::Message& message) {
  if (!client.Push(message)) {
    const std::lock_guard lock(mutex_);
    ++counts_.dropped;
  }
}

std::vector<std::shared_ptr<StreamClient>> StreamHub::clients() const {
  const std::lock_guard lock(mutex_);
  return clients_;
}

StreamCounts StreamHub::counts() const {
  const std::lock_guard lock(mutex_);
  StreamCounts counts = counts_;
  counts.clients = clients_.size();
  return counts;
}

void StreamHub::Close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  for (const auto& client : clients_) {
    client->End();
  }
}

}  // namespace fdi::console
