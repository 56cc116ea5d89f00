#include "gateway/line_source.h"

#include <array>
#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include "base/error.h"

namespace fdi::gateway {
namespace {

// Bounds the memory that input without line ends can take.
constexpr std::size_t kMaxLine = 64U << 10U;

}  // namespace

LineSource::LineSource(const std::string& path)
    : descriptor_(path == "-" ? dup(STDIN_FILENO)
                              : open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (descriptor_ < 0) {
    if (errno == ENOENT) {
      throw NotFoundError("--lines: there is no " + path);
    }
    throw std::system_error(errno, std::generic_category(), path);
  }
}

LineSource::~LineSource() {
  close(descriptor_);
}

bool LineSource::Poll(std::chrono::milliseconds timeout,
                      const ReadingHandlers& handlers) {
  pollfd entry{descriptor_, POLLIN, 0};
  const int ready = poll(&entry, 1, static_cast<int>(timeout.count()));
  if (ready <= 0) {
    if (ready < 0 && errno != EINTR) {
      throw std::system_error(errno, std::generic_category(), "poll");
    }
    return true;
  }
  std::array<char, 65536> bytes;
  const ssize_t count = read(descriptor_, bytes.data(), bytes.size());
  if (count < 0) {
    if (errno != EINTR && errno != EAGAIN) {
      throw std::system_error(errno, std::generic_category(), "read");
    }
    return true;
  }
  buffer_.append(bytes.data(), static_cast<std::size_t>(count));
  std::size_t begin = 0;
  // Searches only the bytes that are new.
  std::size_t end =
      buffer_.find('\n', buffer_.size() - static_cast<std::size_t>(count));
  for (; end != std::string::npos; end = buffer_.find('\n', begin)) {
    TakeLine(std::string_view(buffer_).substr(begin, end - begin), handlers);
    begin = end + 1;
  }
  buffer_.erase(0, begin);
  if (buffer_.size() > kMaxLine) {
    handlers.wrong("line", "it has more than 64 KiB");
    skipping_ = true;
    buffer_.clear();
  }
  if (count == 0 && !buffer_.empty()) {
    TakeLine(buffer_, handlers);  // The last line may lack its end.
    buffer_.clear();
  }
  return count > 0;
}

void LineSource::TakeLine(std::string_view line,
                          const ReadingHandlers& handlers) {
  if (skipping_) {
    skipping_ = false;
    return;
  }
  const importer::Said& said = lines_.Take(line);
  switch (said.kind) {
    case importer::Said::Kind::kReading:
      handlers.reading(said.reading);
      break;
    case importer::Said::Kind::kAlive:
      handlers.alive(said.reading.source, said.reading.stamp_ns);
      break;
    case importer::Said::Kind::kWrong:
      handlers.wrong(said.reading.tag.empty() ? "line" : said.reading.tag,
                     said.why);
      break;
    case importer::Said::Kind::kNothing:
      break;
  }
}

}  // namespace fdi::gateway
