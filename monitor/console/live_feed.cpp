#include "monitor/console/live_feed.h"

#include <exception>

namespace fdi::console {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kTick{250};
constexpr milliseconds kTilePeriod{1000};
// What other programs do to the history is noticed so late.
constexpr milliseconds kAlarmPeriod{2000};
constexpr std::size_t kUnstoredLimit = 1000;

}  // namespace

LiveFeed::LiveFeed(FeedParts parts) : parts_(std::move(parts)) {}

LiveFeed::~LiveFeed() {
  Stop();
}

void LiveFeed::Start() {
  parts_.alarms.Refresh(parts_.utc_now_ns());  // What changes from here on.
  thread_ = std::thread([this] { Run(); });
}

void LiveFeed::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) {
    thread_.join();
  }
}

void LiveFeed::Wake() {
  const std::lock_guard lock(mutex_);
  woken_ = true;
  changed_.notify_all();
}

void LiveFeed::TellUnstored(const monitor::EpisodeEvent& event) {
  const std::lock_guard lock(mutex_);
  if (unstored_.size() < kUnstoredLimit) {
    unstored_.push_back(event);
  }
  woken_ = true;
  changed_.notify_all();
}

void LiveFeed::Run() {
  while (true) {
    {
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, kTick, [this] { return stopping_ || woken_; });
      if (stopping_) {
        return;
      }
      if (std::exchange(woken_, false)) {
        next_alarms_ = {};
      }
    }
    // A history that fails now may answer next time; nothing else throws but
    // for want of memory.
    try {
      Step(std::chrono::steady_clock::now());
    } catch (const std::exception& error) {
      parts_.log(
          LogLevel::kWarning,
          std::string("console_feed_failed reason=\"") + error.what() + "\"");
    }
  }
}

void LiveFeed::Step(std::chrono::steady_clock::time_point now) {
  if (now >= next_alarms_) {
    next_alarms_ = now + kAlarmPeriod;
    TellAlarms();
  }
  if (parts_.hub.counts().clients == 0) {
    return;
  }
  TellSamples();
  TellGaps();
  if (now >= next_tiles_) {
    next_tiles_ = now + kTilePeriod;
    TellTiles();
  }
}

void LiveFeed::TellAlarms() {
  std::vector<monitor::EpisodeEvent> unstored;
  {
    const std::lock_guard lock(mutex_);
    unstored.swap(unstored_);
  }
  for (const monitor::EpisodeEvent& event : unstored) {
    parts_.hub.Broadcast(
        StreamEvent("alarm", Dump(AlarmJson(AlarmOf(event), parts_.texts))));
  }
  for (const Json& row : parts_.alarms.Refresh(parts_.utc_now_ns())) {
    parts_.hub.Broadcast(StreamEvent("alarm", Dump(row)));
  }
}

void LiveFeed::TellSamples() {
  for (const auto& client : parts_.hub.clients()) {
    if (client->valve().empty()) {
      continue;
    }
    const auto trend = parts_.board.Since(client->valve(), client->next_sample);
    if (!trend) {
      continue;  // Not seen yet.
    }
    client->next_sample = trend->next;
    Json samples = Json::array();
    for (const monitor::TracePoint& point : trend->points) {
      samples.push_back(SampleJson(client->valve(), point));
    }
    if (!samples.empty()) {
      parts_.hub.Send(*client, StreamEvent("sample", Dump(samples)));
    }
  }
}

void LiveFeed::TellTiles() {
  const auto alarms = parts_.alarms.ByValve();
  Json tiles = Json::array();
  for (const ValveState& valve : parts_.board.Valves(false)) {
    const auto found = alarms->find(valve.id);
    const ValveAlarm alarm =
        found == alarms->end() ? ValveAlarm{} : found->second;
    auto& told = told_[valve.id];
    if (told != std::pair{valve.version, alarm}) {
      told = {valve.version, alarm};
      tiles.push_back(TileJson(valve, alarm, true));
    }
  }
  if (!tiles.empty()) {
    parts_.hub.Broadcast(
        StreamEvent("tiles", Dump({{"now_ms", Ms(parts_.utc_now_ns())},
                                   {"tiles", std::move(tiles)}})));
  }
}

void LiveFeed::TellGaps() {
  for (const monitor::DataGap& gap : parts_.board.TakeGaps()) {
    parts_.hub.Broadcast(StreamEvent("gap", Dump(GapJson(gap))));
  }
}

}  // namespace fdi::console
