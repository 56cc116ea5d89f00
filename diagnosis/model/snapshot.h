#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

namespace fdi {

static_assert(std::endian::native == std::endian::little,
              "snapshots are little endian");

template <typename T>
concept SnapshotNumber = std::integral<T> || std::same_as<T, double>;

/// Appends numbers, little endian, to the bytes of a snapshot.
class SnapshotWriter {
 public:
  template <SnapshotNumber... T>
  void Put(T... values) {
    (Append(&values, sizeof values), ...);
  }
  std::vector<std::byte> Take() { return std::move(bytes_); }

 private:
  void Append(const void* data, std::size_t size) {
    bytes_.resize(bytes_.size() + size);
    std::memcpy(bytes_.data() + bytes_.size() - size, data, size);
  }
  std::vector<std::byte> bytes_;
};

/// Reads the numbers back in the same order, with bounds checks.
class SnapshotReader {
 public:
  explicit SnapshotReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  /// @returns false if too few bytes are left.
  template <SnapshotNumber... T>
  bool Get(T&... values) {
    return (Take(&values, sizeof values) && ...);
  }
  bool AtEnd() const { return bytes_.empty(); }

 private:
  bool Take(void* data, std::size_t size) {
    if (size > bytes_.size()) {
      return false;
    }
    std::memcpy(data, bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
    return true;
  }
  std::span<const std::byte> bytes_;
};

}  // namespace fdi
