#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <unordered_map>

namespace fdi::idl {

/// Counts messages that were written and never received, from the sequence
/// numbers that every writer assigns: 1, 2, 3, ... The library's own count
/// omits what a writer overwrote before sending.
///
/// Messages from before `joined_ns` do not count: a late joiner gets only some.
class GapCounter {
 public:
  explicit GapCounter(std::int64_t joined_ns) : joined_ns_(joined_ns) {}

  /// Counts a message; any order, once each.
  void Count(std::uint64_t writer_id, std::uint64_t number,
             std::int64_t sent_ns) {
    if (sent_ns < joined_ns_) {
      return;
    }
    if (writers_.size() >= kMaxWriters && !writers_.contains(writer_id)) {
      writers_.clear();
    }
    Writer& writer = writers_[writer_id];
    const std::uint64_t before = writer.Missing();
    writer.lowest = std::min(writer.lowest, number);
    writer.highest = std::max(writer.highest, number);
    ++writer.count;
    missing_ += writer.Missing() - before;
  }

  /// Missing numbers between the counted ones, over all writers. Exact once
  /// everything received has been counted.
  std::uint64_t missing() const { return missing_; }

 private:
  static constexpr std::size_t kMaxWriters = 4096;

  struct Writer {
    std::uint64_t lowest{UINT64_MAX};
    std::uint64_t highest{0};
    std::uint64_t count{0};

    std::uint64_t Missing() const {
      return count == 0 ? 0 : highest - lowest + 1 - count;
    }
  };

  std::int64_t joined_ns_;
  std::uint64_t missing_{0};
  std::unordered_map<std::uint64_t, Writer> writers_;
};

}  // namespace fdi::idl
