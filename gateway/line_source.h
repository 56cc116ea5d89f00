#pragma once

#include <cstddef>
#include <string>

#include "gateway/reading_source.h"
#include "import/reading_lines.h"

namespace fdi::gateway {

/// Readings from a pipe or a file, a line each (importer::ReadingLines).
class LineSource final : public ReadingSource {
 public:
  /// @param path of a file or a named pipe; "-" is stdin.
  /// @throws NotFoundError, std::system_error if it cannot be opened.
  explicit LineSource(const std::string& path);
  ~LineSource() override;
  LineSource(const LineSource&) = delete;
  LineSource& operator=(const LineSource&) = delete;

  /// @throws std::system_error if reading fails.
  bool Poll(std::chrono::milliseconds timeout,
            const ReadingHandlers& handlers) override;
  bool may_wait() const override { return true; }

 private:
  void TakeLine(std::string_view line, const ReadingHandlers& handlers);

  int descriptor_;
  std::string buffer_;    // Bytes without a line end yet.
  bool skipping_{false};  // The rest of a line that is too long.
  importer::ReadingLines lines_;
};

}  // namespace fdi::gateway
