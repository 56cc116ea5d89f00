#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>

namespace fdi::idl {

/// Counts what writers wrote and a reader never got, from the numbers that
/// every writer gives its messages 1, 2, 3, ... The library's own count leaves
/// out what a writer overwrote before sending.
///
/// What was written before `joined_ns` is no loss: a late joiner gets a part.
class GapCounter {
 public:
  explicit GapCounter(std::int64_t joined_ns) : joined_ns_(joined_ns) {}

  /// @returns how many messages are missing right before this one, which came
  ///   in the order of its writer and was sent at `sent_ns` UTC.
  std::uint64_t Missing(std::uint64_t writer_id, std::uint64_t number,
                        std::int64_t sent_ns) {
    if (writers_.size() >= kMaxWriters && !writers_.contains(writer_id)) {
      writers_.clear();
    }
    Last& last = writers_[writer_id];
    const bool counts = last.number > 0 && last.sent_ns >= joined_ns_;
    const std::uint64_t missing =
        counts && number > last.number + 1 ? number - last.number - 1 : 0;
    last = {number, sent_ns};
    return missing;
  }

 private:
  static constexpr std::size_t kMaxWriters = 4096;

  struct Last {
    std::uint64_t number{0};
    std::int64_t sent_ns{0};
  };

  std::int64_t joined_ns_;
  std::unordered_map<std::uint64_t, Last> writers_;
};

}  // namespace fdi::idl
