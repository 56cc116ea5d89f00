#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace fdi::console {

/// "event: NAME\ndata: DATA\n\n"; `data` without line ends, as JSON is.
std::shared_ptr<const std::string> StreamEvent(const std::string& name,
                                               const std::string& data);

/// One who listens: a bounded queue between who makes the events and the
/// thread that writes them to the socket. Thread safe.
class StreamClient {
 public:
  using Message = std::shared_ptr<const std::string>;
  enum class Outcome : std::uint8_t { kMessage, kTimeout, kEnded };

  /// Of which valve it wants the samples, from which one on.
  struct Wish {
    std::string valve;  ///< Empty: of none.
    std::uint64_t next_sample{0};
  };

  /// @param max_bytes that may wait; at least one message may.
  StreamClient(Wish wish, std::size_t max_bytes)
      : next_sample(wish.next_sample),
        valve_(std::move(wish.valve)),
        max_bytes_(max_bytes) {}

  /// Never waits. @returns false if the client was too slow: it is ended.
  bool Push(const Message& message);
  /// The next message. What waits when the client is ended is not given out.
  Outcome Next(std::chrono::milliseconds timeout, Message& message);
  void End();

  /// Whose samples it wants; empty: of none.
  const std::string& valve() const { return valve_; }

  /// For LiveBoard::Since(); of the thread that pushes.
  std::uint64_t next_sample;

 private:
  const std::string valve_;
  const std::size_t max_bytes_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Message> queue_;
  std::size_t bytes_{0};
  bool ended_{false};
};

/// Settings of StreamHub.
struct StreamOptions {
  std::size_t max_clients{16};
  std::size_t max_bytes{4 << 20};  ///< That wait for one client.
};

/// What became of the clients.
struct StreamCounts {
  std::uint64_t clients{0};  ///< Now.
  std::uint64_t admitted{0};
  std::uint64_t refused{0};  ///< All places were taken.
  std::uint64_t dropped{0};  ///< Too slow.
};

/// All who listen, a bounded number. Thread safe; nothing waits for a client.
class StreamHub {
 public:
  explicit StreamHub(StreamOptions options = {}) : options_(options) {}

  /// @param hello what it is told first. @returns null if all places are taken
  ///   or it was closed.
  std::shared_ptr<StreamClient> Admit(StreamClient::Wish wish,
                                      const StreamClient::Message& hello);
  void Release(const std::shared_ptr<StreamClient>& client);

  void Broadcast(const StreamClient::Message& message);
  void Send(StreamClient& client, const StreamClient::Message& message);

  std::vector<std::shared_ptr<StreamClient>> clients() const;
  StreamCounts counts() const;

  /// Ends all clients and admits none.
  void Close();

 private:
  const StreamOptions options_;
  mutable std::mutex mutex_;
  std::vector<std::shared_ptr<StreamClient>> clients_;
  StreamCounts counts_;
  bool closed_{false};
};

}  // namespace fdi::console
