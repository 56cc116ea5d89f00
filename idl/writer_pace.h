#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <unordered_map>

#include "base/mutex.h"

namespace fdi::idl {

/// Participant prefix and entity id of a writer, as transmitted.
using WriterGuid = std::array<std::uint8_t, 16>;

/// Recognises built-in discovery writers by the last byte of the GUID.
constexpr bool IsOfDiscovery(std::uint8_t entity_kind) {
  return (entity_kind & 0xc0U) == 0xc0U;
}

/// Numbers that one message may leave out, after a pause.
constexpr std::int64_t kLargestGap = 16'384;

/// Limits how fast the sequence numbers of each writer may grow.
///
/// Fast DDS 2.9.1 iterates, with the reader's mutex held, from the last known
/// number to the first one that a heartbeat announces, and stores every number
/// of a gap. One datagram that says 2^50 would occupy a receiving thread for
/// weeks. So a writer may advance only by what it can have written since its
/// last message; its first position is trusted. Thread safe.
class WriterPace {
 public:
  using Clock = std::chrono::steady_clock;

  /// True if `writer` can have reached `number` at `now` while skipping
  /// `left_out` numbers, which cost more. If so, its position is updated.
  bool Admit(const WriterGuid& writer, std::int64_t number,
             std::int64_t left_out, Clock::time_point now);
  /// Takes back the price of numbers left out that were admitted in a datagram
  /// which then leaves out too many: the library does not see them, and they
  /// come again with each heartbeat.
  void Refund(const WriterGuid& writer, std::int64_t left_out);

 private:
  struct State {
    std::int64_t number{0};
    std::int64_t burst{0};  ///< Remaining burst.
    Clock::time_point last_message;
  };
  struct Hash {
    std::size_t operator()(const WriterGuid& writer) const;
  };
  using States = std::unordered_map<WriterGuid, State, Hash>;

  State& Find(const WriterGuid& writer, std::int64_t number,
              Clock::time_point now) REQUIRES(mutex_);

  Mutex mutex_;
  States recent_ GUARDED_BY(mutex_);
  States older_ GUARDED_BY(mutex_);  ///< Dropped when `recent_` is full again.
};

}  // namespace fdi::idl
