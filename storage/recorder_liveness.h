#pragma once

#include <cstdint>
#include <filesystem>

namespace fdi::storage {

/// Tells which recorders of a database live: each locks the byte of its number
/// in `<database>.live`. The kernel frees it when the process ends, however.
class RecorderLiveness {
 public:
  /// @throws DataError naming the file and the reason.
  explicit RecorderLiveness(const std::filesystem::path& database);
  ~RecorderLiveness();
  RecorderLiveness(const RecorderLiveness&) = delete;
  RecorderLiveness& operator=(const RecorderLiveness&) = delete;

  /// This object stands for recorder `id` until it is destroyed.
  void Claim(std::int64_t id);
  /// Is `id` claimed by another object, of this process or another one?
  bool IsAlive(std::int64_t id) const;

  /// As IsAlive(), for those who may not write the file.
  static bool IsAlive(const std::filesystem::path& database, std::int64_t id);

 private:
  std::filesystem::path path_;
  int file_;
};

}  // namespace fdi::storage
