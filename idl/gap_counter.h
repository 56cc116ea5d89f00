#pragma once

#include <algorithm>
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

  /// A message, in any order, once each.
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

  /// How many lie between those counted, of all writers. Exact once all that
  /// has been received has been counted.
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
