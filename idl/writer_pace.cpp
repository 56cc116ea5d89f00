#include "idl/writer_pace.h"

#include <algorithm>
#include <string_view>
#include <utility>

namespace fdi::idl {
namespace {

using std::chrono::duration_cast;
using std::chrono::seconds;

constexpr std::int64_t kBurst = std::int64_t{1} << 20;  // 2 ms of counting.
// Well above what a writer can send, briefly or for longer.
constexpr std::int64_t kPerSecond = 1'000'000;
constexpr std::int64_t kPerSecondOfSilence = 100'000;
constexpr seconds kSilence{10};
// The library keeps each skipped number in a set, at 48 bytes.
constexpr std::int64_t kCostOfLeftOut = 64;
static_assert(kLargestGap == kBurst / kCostOfLeftOut);
constexpr std::size_t kMaxRecentWriters = 32'768;

std::int64_t Growth(WriterPace::Clock::duration since) {
  const auto of = [](WriterPace::Clock::duration time, std::int64_t rate) {
    return duration_cast<std::chrono::microseconds>(time).count() * rate /
           1'000'000;
  };
  const auto talking = std::min<WriterPace::Clock::duration>(since, kSilence);
  return of(talking, kPerSecond) + of(since - talking, kPerSecondOfSilence);
}

}  // namespace

std::size_t WriterPace::Hash::operator()(const WriterGuid& writer) const {
  return std::hash<std::string_view>{}(
      {reinterpret_cast<const char*>(writer.data()), writer.size()});
}

WriterPace::State& WriterPace::Find(const WriterGuid& writer,
                                    std::int64_t number,
                                    Clock::time_point now) {
  if (const auto found = recent_.find(writer); found != recent_.end()) {
    return found->second;
  }
  if (recent_.size() == kMaxRecentWriters) {
    older_ = std::exchange(recent_, {});
  }
  // Discovery writers start at 1 with their participant; others may have been
  // writing for months.
  State state{IsOfDiscovery(writer.back()) ? 0 : number, kBurst, now};
  if (const auto found = older_.find(writer); found != older_.end()) {
    state = found->second;
  }
  return recent_.emplace(writer, state).first->second;
}

bool WriterPace::Admit(const WriterGuid& writer, std::int64_t number,
                       std::int64_t left_out, Clock::time_point now) {
  const MutexLock lock(mutex_);
  State& state = Find(writer, number, now);
  const std::int64_t allowed = state.burst + Growth(now - state.last_message);
  const std::int64_t cost = std::max<std::int64_t>(0, number - state.number) +
                            std::min(left_out, allowed + 1) * kCostOfLeftOut;
  if (cost > allowed) {
    return false;
  }
  state.number = std::max(state.number, number);
  state.burst = std::min(kBurst, allowed - cost);
  state.last_message = now;
  return true;
}

void WriterPace::Refund(const WriterGuid& writer, std::int64_t left_out) {
  const MutexLock lock(mutex_);
  if (const auto found = recent_.find(writer); found != recent_.end()) {
    std::int64_t& burst = found->second.burst;
    burst = std::min(kBurst, burst + left_out * kCostOfLeftOut);
  }
}

}  // namespace fdi::idl
