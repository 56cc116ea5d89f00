#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace fdi::storage {

static_assert(std::endian::native == std::endian::little,
              "stored numbers are little endian");

/// Appends numbers, little endian, to a growing block of bytes.
class ByteWriter {
 public:
  template <std::integral T>
  void Put(T value) {
    Append(&value, sizeof value);
  }
  void Put(double value) { Put(std::bit_cast<std::uint64_t>(value)); }
  void PutText(std::string_view text) {
    Put(static_cast<std::uint32_t>(text.size()));
    Append(text.data(), text.size());
  }
  void Append(const void* data, std::size_t size) {
    const auto* first = static_cast<const std::byte*>(data);
    bytes_.insert(bytes_.end(), first, first + size);
  }

  std::size_t size() const { return bytes_.size(); }
  std::span<const std::byte> view() const { return bytes_; }
  std::vector<std::byte> Take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

/// Reads back what ByteWriter wrote, with bounds checks.
class ByteReader {
 public:
  /// @param where the bytes come from, for error messages; outlives the reader.
  ByteReader(std::span<const std::byte> bytes, std::string_view where)
      : bytes_(bytes), where_(where) {}

  /// @throws DataError if fewer bytes are left.
  template <std::integral T>
  T Get() {
    T value{};
    std::memcpy(&value, TakeBytes(sizeof value).data(), sizeof value);
    return value;
  }
  double GetDouble() { return std::bit_cast<double>(Get<std::uint64_t>()); }
  std::string GetText(std::uint32_t max_size) {
    const std::uint32_t size = GetCount(max_size, "length of text");
    const auto text = TakeBytes(size);
    return size == 0
               ? std::string()
               : std::string(reinterpret_cast<const char*>(text.data()), size);
  }
  std::uint32_t GetCount(std::uint32_t max, std::string_view what) {
    const auto count = Get<std::uint32_t>();
    if (count > max) {
      Refuse(std::string(what) + " " + std::to_string(count) +
             " is beyond its limit " + std::to_string(max));
    }
    return count;
  }
  std::span<const std::byte> TakeBytes(std::size_t size) {
    if (size > bytes_.size()) {
      Refuse("bytes are missing");
    }
    const auto taken = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return taken;
  }

  /// @throws DataError if bytes remain.
  void ExpectEnd() const {
    if (!bytes_.empty()) {
      Refuse(std::to_string(bytes_.size()) + " bytes too many");
    }
  }
  [[noreturn]] void Refuse(const std::string& reason) const {
    throw DataError(std::string(where_) + " is damaged: " + reason);
  }

 private:
  std::span<const std::byte> bytes_;
  std::string_view where_;
};

}  // namespace fdi::storage
