#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include <sys/mount.h>

namespace fdi::storage {

/// A file system of its own in memory; removed at the end.
class SmallDisk {
 public:
  SmallDisk(std::filesystem::path path, const std::string& size)
      : path_(std::move(path)) {
    std::filesystem::create_directory(path_);
    const std::string options = "size=" + size;
    mounted_ = mount("none", path_.c_str(), "tmpfs", 0, options.c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) {
      umount2(path_.c_str(), MNT_DETACH);
    }
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool mounted() const { return mounted_; }
  const std::filesystem::path& path() const { return path_; }

  /// Takes all space that is left.
  void Fill() const {
    std::ofstream file(path_ / "ballast", std::ios::binary);
    const std::string block(65536, 'x');
    while (file.write(block.data(), 65536).flush()) {
    }
    file.close();
    std::ofstream rest(path_ / "ballast2", std::ios::binary);
    while (rest.put('x').flush()) {
    }
  }
  void Free() const {
    std::filesystem::remove(path_ / "ballast");
    std::filesystem::remove(path_ / "ballast2");
  }

 private:
  std::filesystem::path path_;
  bool mounted_{false};
};

}  // namespace fdi::storage
