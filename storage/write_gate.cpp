#include "storage/write_gate.h"

#include <cerrno>
#include <cstring>
#include <string>
#include <thread>

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <unistd.h>

#include "diagnosis/error.h"
#include "storage/database.h"

namespace fdi::storage {

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
  // flock has no timeout, and a stopped process may hold the gate for ever.
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
