#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <unordered_map>

namespace fdi::idl {

/// Prefix of the participant and number of the writer, as they are sent.
using WriterGuid = std::array<std::uint8_t, 16>;

/// By the last byte of its GUID: a writer of participants and endpoints.
constexpr bool IsOfDiscovery(std::uint8_t entity_kind) {
  return (entity_kind & 0xc0U) == 0xc0U;
}

/// How fast the sequence numbers of each writer may grow.
///
/// Fast DDS 2.9.1 counts one by one, with the reader's mutex held, from the
/// last number that it knows to the first that a heartbeat says there is, and
/// keeps every number of a gap. One datagram that says 2^50 would occupy a
/// receiving thread for weeks. So a writer may be ahead of its last word by
/// what it can have written since; where it stood at its first word is
/// believed. Thread safe.
class WriterPace {
 public:
  using Clock = std::chrono::steady_clock;

  /// Whether `writer` can have reached `number` at `now`, and can have left out
  /// `left_out` numbers, which count more. If so, it stands there from now on.
  bool Admit(const WriterGuid& writer, std::int64_t number,
             std::int64_t left_out, Clock::time_point now);

 private:
  struct State {
    std::int64_t number{0};
    std::int64_t burst{0};  ///< What is left of it.
    Clock::time_point last_word;
  };
  struct Hash {
    std::size_t operator()(const WriterGuid& writer) const;
  };
  using States = std::unordered_map<WriterGuid, State, Hash>;

  State& Find(const WriterGuid& writer, std::int64_t number,
              Clock::time_point now);

  std::mutex mutex_;
  States recent_;
  States older_;  ///< Forgotten when `recent_` is full again.
};

}  // namespace fdi::idl
