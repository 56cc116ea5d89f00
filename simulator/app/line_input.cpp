#include "simulator/app/line_input.h"

#include <array>
#include <cerrno>
#include <system_error>

#include <poll.h>
#include <unistd.h>

#include "diagnosis/error.h"

namespace fdi::simulator {
namespace {

constexpr std::size_t kMaxLine = 1U << 20U;

[[noreturn]] void Fail(const char* operation) {
  throw std::system_error(errno, std::generic_category(), operation);
}

}  // namespace

std::optional<std::string> LineInput::Next() {
  std::size_t searched = begin_;
  while (true) {
    const std::size_t end = buffer_.find('\n', searched);
    if (end != std::string::npos) {
      std::string line = buffer_.substr(begin_, end - begin_);
      begin_ = end + 1;
      return line;
    }
    if (buffer_.size() - begin_ > kMaxLine) {
      throw DataError("stdin: a line has more than 1 MiB");
    }
    buffer_.erase(0, begin_);
    begin_ = 0;
    searched = buffer_.size();
    if (ended_ || !Fill()) {
      break;
    }
  }
  if (buffer_.empty() || signals_.stop_requested()) {
    return std::nullopt;
  }
  std::string line;
  line.swap(buffer_);  // The last one may lack its end.
  return line;
}

// Waits for bytes. @returns false on a stop.
bool LineInput::Fill() {
  std::array<pollfd, 2> entries{
      {{descriptor_, POLLIN, 0}, {signals_.descriptor(), POLLIN, 0}}};
  while (!signals_.stop_requested()) {
    if (poll(entries.data(), entries.size(), -1) < 0) {
      if (errno != EINTR) {
        Fail("poll of stdin");
      }
      continue;
    }
    if (entries[0].revents == 0) {
      signals_.WaitFor(std::chrono::milliseconds(0));  // A reload: not for us.
      continue;
    }
    std::array<char, 65536> bytes;
    const ssize_t count = read(descriptor_, bytes.data(), bytes.size());
    if (count < 0) {
      if (errno != EINTR && errno != EAGAIN) {
        Fail("read of stdin");
      }
      continue;
    }
    ended_ = count == 0;
    buffer_.append(bytes.data(), static_cast<std::size_t>(count));
    return true;
  }
  return false;
}

}  // namespace fdi::simulator
