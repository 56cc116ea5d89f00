#include "storage/recorder_liveness.h"

#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <unistd.h>

#include "diagnosis/error.h"

namespace fdi::storage {
namespace {

// Locks of the open file, not of the process: two recorders in one process see
// each other, and closing another descriptor of the file frees nothing.
struct flock ByteLock(std::int64_t id) {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  lock.l_start = id;
  lock.l_len = 1;
  return lock;
}

bool IsLocked(int file, std::int64_t id) {
  struct flock lock = ByteLock(id);
  return fcntl(file, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

std::string LivePath(const std::filesystem::path& database) {
  return database.string() + ".live";
}

}  // namespace

RecorderLiveness::RecorderLiveness(const std::filesystem::path& database)
    : path_(LivePath(database)),
      file_(open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
  if (file_ < 0) {
    throw DataError(path_.string() +
                    " cannot be opened: " + std::strerror(errno));
  }
}

RecorderLiveness::~RecorderLiveness() {
  close(file_);
}

void RecorderLiveness::Claim(std::int64_t id) {
  struct flock lock = ByteLock(id);
  if (fcntl(file_, F_OFD_SETLK, &lock) != 0) {
    throw DataError(path_.string() +
                    " cannot be locked: " + std::strerror(errno));
  }
}

bool RecorderLiveness::IsAlive(std::int64_t id) const {
  return IsLocked(file_, id);
}

bool RecorderLiveness::IsAlive(const std::filesystem::path& database,
                               std::int64_t id) {
  const int file = open(LivePath(database).c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) {
    return false;
  }
  const bool alive = IsLocked(file, id);
  close(file);
  return alive;
}

}  // namespace fdi::storage
