#include "console/live_stream.h"

#include <algorithm>
#include <exception>
#include <utility>

namespace fdi::console {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kTick{250};
constexpr milliseconds kTilePeriod{1000};
// Latency of changes that other programs make to the history.
constexpr milliseconds kAlarmPeriod{2000};
// Longest pause between attempts to read an unavailable history.
constexpr milliseconds kMaxPause{60'000};
constexpr std::size_t kUnstoredLimit = 1000;

}  // namespace

struct LiveStream::Client {
  std::string valve;
  std::uint64_t next_sample{0};  // Used by the feeding thread only.
  std::deque<Message> queue;
  std::size_t bytes{0};
  bool ended{false};
};

Message StreamEvent(const std::string& name, const std::string& data) {
  std::string text = "event: ";
  text.append(name).append("\ndata: ").append(data).append("\n\n");
  return std::make_shared<const std::string>(std::move(text));
}

std::shared_ptr<LiveStream::Client> LiveStream::Admit(const std::string& valve,
                                                      std::uint64_t next_sample,
                                                      const Message& hello) {
  const MutexLock lock(mutex_);
  if (closed_ || clients_.size() >= options_.max_clients) {
    ++counts_.refused;
    return nullptr;
  }
  // Under the lock until the end, so that no broadcast comes before the hello.
  ++counts_.admitted;
  clients_.push_back(
      std::make_shared<Client>(Client{valve, next_sample, {}, 0, false}));
  Push(*clients_.back(), hello);
  return clients_.back();
}

void LiveStream::Release(const std::shared_ptr<Client>& client) {
  const MutexLock lock(mutex_);
  std::erase(clients_, client);
}

// A single message may exceed max_bytes.
void LiveStream::Push(Client& client, const Message& message) {
  if (client.ended) {
    return;
  }
  if (!client.queue.empty() &&
      client.bytes + message->size() > options_.max_bytes) {
    // Ended, not skipped: a page that reconnects reads the whole state, but it
    // could not notice that a change is missing.
    client.ended = true;
    client.queue.clear();
    ++counts_.dropped;
  } else {
    client.bytes += message->size();
    client.queue.push_back(message);
  }
  // All, because streams and both threads wait for different conditions of the
  // same variable: notify_one() could wake one whose condition does not hold.
  changed_.notify_all();
}

LiveStream::Outcome LiveStream::Next(Client& client, milliseconds timeout,
                                     Message& message) {
  MutexLock lock(mutex_);
  changed_.wait_for(lock, timeout, [&client] {
    return client.ended || !client.queue.empty();
  });
  if (client.ended) {
    return Outcome::kEnded;
  }
  if (client.queue.empty()) {
    return Outcome::kTimeout;
  }
  message = std::move(client.queue.front());
  client.queue.pop_front();
  client.bytes -= message->size();
  return Outcome::kMessage;
}

void LiveStream::Broadcast(const Message& message) {
  const MutexLock lock(mutex_);
  for (const auto& client : clients_) {
    Push(*client, message);
  }
}

StreamCounts LiveStream::counts() const {
  const MutexLock lock(mutex_);
  StreamCounts counts = counts_;
  counts.clients = clients_.size();
  return counts;
}

void LiveStream::Start(FeedParts parts) {
  parts_ = std::make_unique<FeedParts>(std::move(parts));
  // Read here, so that an unreadable history ends the start. The history of a
  // plant may be away.
  if (!parts_->plant) {
    parts_->alarms.Refresh(parts_->utc_now_ns());  // The initial alarms.
  }
  thread_ = std::thread([this] { Run(); });
  alarms_thread_ = std::thread([this] { FollowAlarms(); });
}

void LiveStream::Close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  for (const auto& client : clients_) {
    client->ended = true;
  }
  changed_.notify_all();
}

void LiveStream::Stop() {
  Close();
  for (std::thread* thread : {&thread_, &alarms_thread_}) {
    if (thread->joinable()) {
      thread->join();
    }
  }
}

void LiveStream::Wake() {
  const MutexLock lock(mutex_);
  woken_ = true;
  changed_.notify_all();
}

void LiveStream::AddUnstored(const FaultEvent& event) {
  const MutexLock lock(mutex_);
  if (unstored_.size() < kUnstoredLimit) {
    unstored_.push_back(event);
  }
  changed_.notify_all();
}

void LiveStream::Run() {
  while (true) {
    {
      MutexLock lock(mutex_);
      changed_.wait_for(lock, kTick, [this]() REQUIRES(mutex_) {
        return closed_ || !unstored_.empty();
      });
      if (closed_) {
        return;
      }
    }
    try {
      Step(std::chrono::steady_clock::now());
    } catch (const std::exception& error) {
      parts_->log(
          LogLevel::kWarning,
          std::string("console_feed_failed reason=\"") + error.what() + "\"");
    }
  }
}

// A history that fails is retried after 4, 8, ... s, at most 60 s, and from 2 s
// on if it has never answered. Each reason is logged once.
void LiveStream::FollowAlarms() {
  milliseconds pause{0};
  std::string reason;
  while (true) {
    {
      MutexLock lock(mutex_);
      changed_.wait_for(
          lock, pause, [this]() REQUIRES(mutex_) { return closed_ || woken_; });
      if (closed_) {
        return;
      }
      // Before the read: a change that comes during it must cause another one.
      woken_ = false;
    }
    try {
      for (const Json& row : parts_->alarms.Refresh(parts_->utc_now_ns())) {
        Broadcast(StreamEvent("alarm", JsonText(row)));
      }
      pause = kAlarmPeriod;
      if (!std::exchange(reason, "").empty()) {
        parts_->log(LogLevel::kInfo, "console_history_goes_on");
      }
    } catch (const std::exception& error) {
      pause = std::clamp(2 * pause, kAlarmPeriod, kMaxPause);
      if (reason != error.what()) {
        reason = error.what();
        parts_->log(LogLevel::kWarning,
                    "console_history_failed reason=\"" + reason + "\"");
      }
    }
  }
}

void LiveStream::Step(std::chrono::steady_clock::time_point now) {
  // Also without clients: Run() does not wait while unstored_ has events and
  // would spin.
  SendUnstored();
  if (counts().clients == 0) {
    return;
  }
  SendSamples();
  for (const DataGap& gap : parts_->board.TakeGaps()) {
    Broadcast(StreamEvent("gap", JsonText(GapJson(gap))));
  }
  if (now >= next_tiles_) {
    next_tiles_ = now + kTilePeriod;
    SendTiles();
    if (parts_->plant) {
      Broadcast(StreamEvent("plant", JsonText(parts_->plant())));
    }
  }
}

void LiveStream::SendUnstored() {
  std::vector<FaultEvent> unstored;
  {
    const MutexLock lock(mutex_);
    unstored.swap(unstored_);
  }
  for (const FaultEvent& event : unstored) {
    Broadcast(StreamEvent(
        "alarm", JsonText(AlarmJson(storage::AlarmOf(event), parts_->texts,
                                    *parts_->alarms.Facts()))));
  }
}

void LiveStream::SendSamples() {
  // A copy, so that no client waits for the lock while samples become JSON. One
  // that leaves meanwhile is kept by its pointer.
  std::vector<std::shared_ptr<Client>> clients;
  {
    const MutexLock lock(mutex_);
    clients = clients_;
  }
  for (const auto& client : clients) {
    const auto trend = parts_->board.Since(client->valve, client->next_sample);
    if (!trend) {
      continue;  // No valve is wanted, or it has not been seen yet.
    }
    client->next_sample = trend->next;
    Json samples = Json::array();
    for (const TracePoint& point : trend->points) {
      samples.push_back(SampleJson(client->valve, point));
    }
    if (!samples.empty()) {
      const Message message = StreamEvent("sample", JsonText(samples));
      const MutexLock lock(mutex_);
      Push(*client, message);
    }
  }
}

void LiveStream::SendTiles() {
  const auto alarms = parts_->alarms.ByValve();
  Json tiles = Json::array();
  const std::vector<ValveState> valves = parts_->board.Valves(false);
  for (const ValveState& valve : valves) {
    const std::pair now{valve.version, AlarmFor(*alarms, valve.id)};
    // Versions are compared, so that JSON is made only for what has changed.
    if (std::exchange(sent_[valve.id], now) != now) {
      tiles.push_back(TileJson(valve, now.second, true));
    }
  }
  if (sent_.size() > valves.size()) {  // Some have left the board.
    std::erase_if(sent_, [&](const auto& sent) {
      return std::ranges::find(valves, sent.first, &ValveState::id) ==
             valves.end();
    });
  }
  if (!tiles.empty()) {
    Broadcast(
        StreamEvent("tiles", JsonText({{"now_ms", Ms(parts_->utc_now_ns())},
                                       {"tiles", std::move(tiles)}})));
  }
}

}  // namespace fdi::console
