#include "storage/database/locks.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/error.h"
#include "storage/database/database.h"

namespace fdi::storage {
namespace {

std::string ReadOwner(int file) {
  std::array<char, 32> text{};
  const ssize_t length = pread(file, text.data(), text.size() - 1, 0);
  return length > 0 ? std::string(text.data(), static_cast<std::size_t>(length))
                    : "unknown";
}

}  // namespace

ExclusiveLock::ExclusiveLock(const std::filesystem::path& path,
                             std::string_view purpose)
    : file_(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
  if (file_ < 0) {
    throw DataError("lock file " + path.string() +
                    " cannot be opened: " + std::strerror(errno));
  }
  if (flock(file_, LOCK_EX | LOCK_NB) != 0) {
    const int reason = errno;
    const std::string owner = ReadOwner(file_);
    close(std::exchange(file_, -1));
    if (reason != EWOULDBLOCK) {
      throw DataError("lock file " + path.string() +
                      " cannot be locked: " + std::strerror(reason));
    }
    throw DataError("process " + owner + " is already " + std::string(purpose) +
                    " here: it holds " + path.string());
  }
  // The pid is only used in the error message, so failing to write it is
  // harmless.
  const std::string pid = std::to_string(getpid());
  if (ftruncate(file_, 0) == 0) {
    [[maybe_unused]] const ssize_t written =
        pwrite(file_, pid.data(), pid.size(), 0);
  }
}

std::optional<std::string> ExclusiveLock::HolderOf(
    const std::filesystem::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    return std::nullopt;
  }
  std::optional<std::string> holder;
  if (flock(file, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    holder = ReadOwner(file);
  }
  close(file);
  return holder;
}

ExclusiveLock::~ExclusiveLock() {
  if (file_ >= 0) {
    close(file_);
  }
}

ExclusiveLock::ExclusiveLock(ExclusiveLock&& other) noexcept
    : file_(std::exchange(other.file_, -1)) {}

ExclusiveLock& ExclusiveLock::operator=(ExclusiveLock&& other) noexcept {
  std::swap(file_, other.file_);
  return *this;
}

WriteGate::WriteGate(const std::filesystem::path& database) {
  const std::string path = database.string() + ".gate";
  file_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (file_ < 0) {
    throw DataError("database " + database.string() + " cannot be written: " +
                    path + ": " + std::strerror(errno));
  }
}

WriteGate::~WriteGate() {
  close(file_);
}

bool WriteGate::Enter(std::chrono::milliseconds patience) {
  // flock has no timeout, and a suspended process may hold the gate forever.
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (flock(file_, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK && errno != EINTR) {
      return false;
    }
    if (std::chrono::steady_clock::now() >= deadline) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

void WriteGate::Leave() noexcept {
  flock(file_, LOCK_UN);
}

GateHolder::GateHolder(WriteGate& gate, const std::filesystem::path& database)
    : gate_(gate) {
  if (!gate_.Enter(kWritePatience)) {
    throw SqliteError(SQLITE_BUSY,
                      database.string() + ": another process keeps writing");
  }
}

GateHolder::~GateHolder() {
  gate_.Leave();
}

}  // namespace fdi::storage
