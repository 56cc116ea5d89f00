#include "storage/database/open_files.h"

#include <chrono>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include "storage/database/database.h"
#include "storage/database/locks.h"

namespace fdi::storage {
namespace {

namespace fs = std::filesystem;

// Locks the open file description, because a lock of the process would be lost
// when any descriptor of the file is closed. SQLite locks the -shm instead.
bool LockLog(int file, int command, short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  lock.l_len = 1;
  return fcntl(file, command, &lock) == 0 && lock.l_type != F_UNLCK;
}

// True if another descriptor than `file` holds the lock.
bool IsHeldByOthers(int file) {
  return LockLog(file, F_OFD_GETLK, F_WRLCK);
}

bool IsInUse(const fs::path& log) {
  const int file = open(log.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  const bool in_use = file >= 0 && IsHeldByOthers(file);
  close(file);
  return in_use;
}

}  // namespace

OpenFiles::OpenFiles(fs::path database)
    : path_(std::move(database)),
      database_(IdOf("")),
      wal_(IdOf("-wal")),
      shm_(IdOf("-shm")),
      gate_(IdOf(".gate")) {
  if (!database_ || !wal_) {
    return;
  }
  // Whoever closed the database last is about to remove the second names.
  const auto deadline = std::chrono::steady_clock::now() + kWritePatience;
  while (OthersHaveAnotherLog()) {
    if (!HasLog() || std::chrono::steady_clock::now() >= deadline) {
      throw SqliteError(SQLITE_BUSY, path_.string() +
                                         ": its -wal is not the one that other "
                                         "programs have open: try again");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  log_ = open((path_.string() + "-wal").c_str(),
              O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (log_ >= 0 && LockLog(log_, F_OFD_SETLK, F_RDLCK)) {
    PutBack();
  }
}

OpenFiles::~OpenFiles() {
  if (log_ < 0) {
    return;
  }
  if (!IsHeldByOthers(log_)) {
    for (const auto& [suffix, file] :
         {std::pair("-wal", wal_), std::pair("-shm", shm_)}) {
      std::error_code ignored;
      if (IdOf(Second(suffix)) == file) {
        fs::remove(Second(suffix), ignored);
      }
    }
  }
  close(log_);
}

OpenFiles& OpenFiles::operator=(OpenFiles&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(database_, other.database_);
  std::swap(wal_, other.wal_);
  std::swap(shm_, other.shm_);
  std::swap(gate_, other.gate_);
  std::swap(log_, other.log_);
  return *this;
}

void OpenFiles::PutBackLogOf(const fs::path& database) {
  OpenFiles files;
  files.path_ = database;
  files.database_ = files.IdOf("");
  if (!files.database_ || !IsInUse(files.Second("-wal"))) {
    return;
  }
  for (const char* suffix : {"-wal", "-shm"}) {
    std::error_code exists;
    fs::create_hard_link(files.Second(suffix), database.string() + suffix,
                         exists);
  }
}

void OpenFiles::PutBack() const {
  if (log_ >= 0 && HasDatabase()) {
    PutBack("-wal", wal_);
    PutBack("-shm", shm_);
  }
}

void OpenFiles::PutBack(const char* suffix, const Id& file) const {
  const fs::path name = path_.string() + suffix;
  const fs::path second = Second(suffix);
  const bool has_name = Has(suffix, file);
  if (has_name == (IdOf(second) == file)) {
    return;  // Both are there, or nothing is left to link to.
  }
  std::error_code ignored;
  if (has_name) {
    fs::remove(second, ignored);
    fs::create_hard_link(name, second, ignored);
  } else {
    fs::rename(name, name.string() + ".replaced", ignored);
    fs::create_hard_link(second, name, ignored);
  }
}

OpenFiles::Id OpenFiles::IdOf(const fs::path& path) {
  struct stat facts {};
  return stat(path.c_str(), &facts) == 0 ? Id({facts.st_dev, facts.st_ino})
                                         : std::nullopt;
}

OpenFiles::Id OpenFiles::IdOf(const char* suffix) const {
  return IdOf(fs::path(path_.string() + suffix));
}

fs::path OpenFiles::Second(const char* suffix) const {
  return path_.parent_path() / ("." + path_.filename().string() + "." +
                                std::to_string(database_->second) + suffix);
}

bool OpenFiles::OthersHaveAnotherLog() const {
  const fs::path second = Second("-wal");
  const Id log = IdOf(second);
  return log && log != wal_ && IsInUse(second);
}

}  // namespace fdi::storage
